//! The header of the C interface is what its source says.

use std::path::Path;

/// With `UPDATE_HEADER` set the header is written instead.
#[test]
fn the_c_header_is_made_from_the_source() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../runtime/c");
    let config =
        cbindgen::Config::from_file(folder.join("cbindgen.toml")).expect("a configuration");
    let mut builder = cbindgen::Builder::new().with_config(config);
    for source in ["lib.rs", "storage.rs", "types.rs"] {
        builder = builder.with_src(folder.join("src").join(source));
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
}
