//! The header of the C interface agrees with its source.

use runtime::Status;
use std::path::Path;

/// With `UPDATE_HEADER` set the header is written instead.
#[test]
fn the_c_header_is_made_from_the_source() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../runtime/c");
    let config =
        cbindgen::Config::from_file(folder.join("cbindgen.toml")).expect("a configuration");
    let mut builder = cbindgen::Builder::new().with_config(config);
    for source in [
        "src/lib.rs",
        "src/storage.rs",
        "src/types.rs",
        "../src/frame.rs",
        "../src/motion.rs",
        "../src/tracker.rs",
    ] {
        builder = builder.with_src(folder.join(source));
    }
    let mut made = Vec::new();
    builder.generate().expect("a header").write(&mut made);
    let header = folder.join("hall_runtime.h");
    if std::env::var_os("UPDATE_HEADER").is_some() {
        std::fs::write(&header, &made).expect("written");
    }
    let kept = std::fs::read_to_string(&header).expect("the header");
    let made = String::from_utf8(made).expect("text");
    assert_eq!(
        kept.replace("\r\n", "\n"),
        made,
        "set UPDATE_HEADER=1 to write it anew"
    );
    // Every bit of the status has a name there, lowest first, and the version is the crate's.
    let bits = made
        .lines()
        .filter(|line| line.starts_with("#define HALL_STATUS_"));
    let bits: Vec<_> = bits
        .map(|line| line.rsplit_once(" (").expect("a bit").1)
        .collect();
    let all = Status::NAMES.map(|(bit, _)| format!("1 << {})", bit.bits().trailing_zeros()));
    assert_eq!(bits, all);
    let manifest = std::fs::read_to_string(folder.join("Cargo.toml")).expect("a manifest");
    let of = |part: &str| {
        let line = made.split_once(&format!("#define HALL_RUNTIME_VERSION_{part} "));
        line.and_then(|(_, rest)| rest.lines().next()).expect(part)
    };
    let version = ["MAJOR", "MINOR", "PATCH"].map(of).join(".");
    assert!(
        manifest.contains(&format!("version = \"{version}\"")),
        "{version}"
    );
}
