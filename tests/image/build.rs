//! Gives the images their memory map.
fn main() {
    println!("cargo:rustc-link-search={}", std::env::var("CARGO_MANIFEST_DIR").unwrap() + "/mps2");
    println!("cargo:rustc-link-arg-bins=-Tlink.x");
}
