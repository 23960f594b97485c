//! Gives the images their memory map, and the measuring one the C code to count beside.

use std::path::Path;

fn main() {
    let folder = std::env::var("CARGO_MANIFEST_DIR").unwrap_or_default();
    println!(
        "cargo::rustc-link-search={}",
        Path::new(&folder).join("mps2").display()
    );
    println!("cargo::rustc-link-arg-bins=-Tlink.x");
    println!("cargo::rerun-if-changed=mps2/memory.x");
    println!("cargo::rustc-check-cfg=cfg(c_reference)");
    // The C code takes its floats in FPU registers.
    if std::env::var("CARGO_FEATURE_C_REFERENCE").is_ok() {
        println!("cargo::rustc-cfg=c_reference");
        println!("cargo::rerun-if-changed=c_reference.c");
        for (name, contract) in [("c", "fast"), ("c_uncontracted", "off")] {
            cc::Build::new()
                .file("c_reference.c")
                .compiler("arm-none-eabi-gcc")
                .opt_level(3)
                .flag("-mcpu=cortex-m4")
                .flag("-fno-math-errno")
                .flag(format!("-ffp-contract={contract}"))
                .define("NAME(x)", format!("counted_{name}_##x").as_str())
                .cargo_metadata(true)
                .compile(&format!("counted_{name}"));
        }
    }
}
