use super::*;

/// How the file is refused: with these words and a remedy.
#[track_caller]
fn refused_file(bytes: &[u8], part: &str) {
    let path = Path::new("log.csv.gz");
    let error = read_bytes(bytes, path, stage(), &ReadOptions::default()).expect_err("refused");
    let message = error.to_string();
    assert!(message.starts_with("log.csv.gz: "), "{message}");
    assert!(message.contains("; "), "names a remedy: {message}");
    assert!(message.contains(part), "{part}: {message}");
}

#[test]
fn no_log_no_file_and_a_folder() {
    let folder = tempfile::tempdir().expect("a folder");
    let none = folder.path().join("none.csv");
    let shown = folder.path().display().to_string();
    for (paths, part) in [
        (&[][..], "no log was named"),
        (&[folder.path()], &format!("{shown}: is a folder")),
        (&[&none], "none.csv: no such file; check the path"),
        #[cfg(target_os = "linux")]
        (&[Path::new("/dev/zero")], "/dev/zero: not a text file"),
    ] {
        let error = read(paths, stage(), &ReadOptions::default()).expect_err(part);
        assert!(error.to_string().contains(part), "{error}");
    }
}

#[test]
fn binary_files() {
    for (bytes, part) in [
        (&b"\x7fELF\x02\x01\x01\0\0\0"[..], "(byte 0)"),
        (
            format!("{LOG}\0").as_bytes(),
            &format!("(byte {})", LOG.len()),
        ),
        (b"PK\x03\x04rest", ".xlsx"),
        (b"\x93NUMPY\x01\0v\0", ".npy"),
        (
            b"MATLAB 5.0 MAT-file, Platform: GLNXA64\0\x01IM",
            "writetable",
        ),
        (
            b"MATLAB 7.3 MAT-file, Platform: GLNXA64\0\x02IM",
            "writetable",
        ),
        (b"\x89HDF\r\n\x1a\n\0", ".h5"),
        (b"TDSm\x0e\0\0\0", ".tdms"),
        (b"PAR1\x15\x04", "Parquet"),
        (b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1", ".xls"),
        (&gzip(&gzip(LOG.as_bytes())), "gzip inside gzip"),
    ] {
        refused_file(bytes, part);
        refused_file(
            &gzip(bytes),
            if part.starts_with("gzip") {
                "gzip"
            } else {
                part
            },
        );
    }
    // Bytes that no text has further on are a bad cell, shown without them.
    let latin = LOG.replace(",161,", ",\u{b5}61,").into_bytes();
    assert_eq!(place(&read_in(latin, stage()).expect_err("refused")).0, 3);
    // Unpacking stops before the end, where the fault of the gzip stream would show.
    let packed = gzip(&[0; 1 << 20]);
    refused_file(&packed[..packed.len() - 9], "(byte 0)");
}

#[test]
fn a_gzip_file_cut_anywhere_damaged_or_followed_by_rubbish() {
    let packed = gzip(LOG.as_bytes());
    for end in 2..packed.len() {
        refused_file(&packed[..end], "is cut short");
    }
    let last = packed.len() - 1;
    // Checksum, length, and flags of the header.
    for (at, flip) in [(last, 1), (last - 4, 1), (3, 0xe0)] {
        let mut wrong = packed.clone();
        wrong[at] ^= flip;
        refused_file(&wrong, "is damaged");
    }
    refused_file(&[packed.as_slice(), b"some rubbish"].concat(), "is damaged");
    refused_file(&gzip(b""), "the log is empty");
}

#[test]
fn every_flipped_bit_of_a_gzip_file_is_refused_or_harmless() {
    let packed = gzip(LOG.as_bytes());
    let want = sound(LOG).dataset;
    for bit in 0..8 * packed.len() {
        let mut wrong = packed.clone();
        wrong[bit / 8] ^= 1 << (bit % 8);
        // Time, file name and system of the gzip header mean nothing to the log.
        if let Ok(reading) = read_bytes(&wrong, Path::new("log"), stage(), &ReadOptions::default())
        {
            assert_eq!(reading.dataset.rows, want.rows, "bit {bit}");
        }
    }
}
