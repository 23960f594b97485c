//! A record of the bus beside a sound log of the reference: what `join` writes, `decode` takes.

#![no_main]

use fuzz::Folder;
use libfuzzer_sys::fuzz_target;
use std::sync::LazyLock;

static FOLDER: LazyLock<Folder> = LazyLock::new(|| {
    let folder = Folder::new();
    folder.write(
        "reference",
        include_bytes!("../../seeds/reference/beams.csv"),
    );
    folder
});

fuzz_target!(|record: &[u8]| {
    FOLDER.write("bus", record);
    FOLDER.join(&[]);
    FOLDER.join(&["--bad-rows", "skip"]);
});
