//! Gives the images their memory maps, and the measuring one the C code to count beside.

use std::path::{Path, PathBuf};

/// Images for the boards that QEMU models for tests; the others have the project's own map.
const MPS2: [&str; 6] = [
    "compare",
    "measure",
    "panic_free",
    "bare",
    "rtic_task",
    "embassy_task",
];
const STM32F405: [&str; 1] = ["control_loop"];

fn main() {
    let folder = PathBuf::from(std::env::var_os("CARGO_MANIFEST_DIR").unwrap_or_default());
    memory_map(&MPS2, &folder.join("mps2"));
    memory_map(&STM32F405, &folder.join("../.."));
    println!("cargo::rustc-link-arg-bins=-Tlink.x");
    println!("cargo::rerun-if-env-changed=HALL_STAGE_SERIAL");
    println!("cargo::rustc-check-cfg=cfg(c_reference)");
    // The C code takes its floats in FPU registers.
    if std::env::var_os("CARGO_FEATURE_C_REFERENCE").is_some() {
        println!("cargo::rustc-cfg=c_reference");
        c_reference();
    }
}

/// Lets some images be linked by the memory.x of a folder.
fn memory_map(images: &[&str], folder: &Path) {
    for image in images {
        println!("cargo::rustc-link-arg-bin={image}=-L{}", folder.display());
    }
    let map = folder.join("memory.x");
    println!("cargo::rerun-if-changed={}", map.display());
}

/// Compiles the C code.
fn c_reference() {
    println!("cargo::rerun-if-changed=c_reference.c");
    cc::Build::new()
        .file("c_reference.c")
        .compiler("arm-none-eabi-gcc")
        .opt_level(3)
        .flag("-mcpu=cortex-m4")
        .flag("-fno-math-errno")
        .compile("c_reference");
}
