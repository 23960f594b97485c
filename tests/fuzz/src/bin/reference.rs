//! A log of the interferometers beside a sound record of the bus: what `join` writes, `decode`
//! takes.

#![no_main]

use fuzz::Folder;
use libfuzzer_sys::fuzz_target;
use std::sync::LazyLock;

static FOLDER: LazyLock<Folder> = LazyLock::new(|| {
    let folder = Folder::new();
    folder.write(
        "bus",
        include_bytes!("../../../../hal-adapters/examples/data/bus.log"),
    );
    folder
});

fuzz_target!(|reference: &[u8]| {
    FOLDER.write("reference", reference);
    FOLDER.join(&[]);
    FOLDER.join(&["--search-s", "1"]);
});
