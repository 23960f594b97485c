//! Shows the linker where `memory.x` lies: at the top of the repository.
fn main() {
    let manifest = std::env::var("CARGO_MANIFEST_DIR").unwrap_or_default();
    println!("cargo:rustc-link-search={manifest}/../..");
    println!("cargo:rerun-if-changed=../../memory.x");
    for name in ["STAGE_SERIAL", "STAGE_NODE", "STAGE_PERIOD_US"] {
        println!("cargo:rerun-if-env-changed={name}");
    }
    if std::env::var("CARGO_CFG_TARGET_OS").is_ok_and(|os| os == "none") {
        println!("cargo:rustc-link-arg-bins=-Tlink.x");
        if std::env::var_os("CARGO_FEATURE_DEFMT_RTT").is_some() {
            println!("cargo:rustc-link-arg-bins=-Tdefmt.x");
        }
    }
}
