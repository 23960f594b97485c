use super::*;

#[track_caller]
fn refused_file(bytes: &[u8]) -> LogError {
    let path = Path::new("log.csv.gz");
    let error = read_bytes(bytes, path, stage(), &ReadOptions::default()).expect_err("refused");
    let message = error.to_string();
    assert!(message.starts_with("log.csv.gz: "), "{message}");
    assert!(message.contains("; "), "names a remedy: {message}");
    error
}

#[test]
fn no_log_no_file_and_a_folder() {
    let read =
        |paths: &[&Path]| read(paths, stage(), &ReadOptions::default()).expect_err("refused");
    let error = read(&[]);
    assert!(matches!(error, LogError::NoLog), "{error}");
    let folder = tempfile::tempdir().expect("a folder");
    let error = read(&[folder.path()]);
    assert!(
        matches!(&error, LogError::Source(SourceError::IsFolder { path }) if path == folder.path()),
        "{error}"
    );
    let error = read(&[&folder.path().join("none.csv")]);
    assert!(
        matches!(error, LogError::Source(SourceError::NotFound { .. })),
        "{error}"
    );
    assert!(error.to_string().contains("check the path"), "{error}");
}

#[test]
fn the_same_log_twice() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = |name: &str| folder.path().join(name);
    let renamed = LOG.replace("\n4,", "\n5,");
    std::fs::write(at("a"), LOG).expect("written");
    std::fs::write(at("b"), LOG.replace(",97,", ",98,")).expect("written");
    std::fs::write(at("c"), gzip(renamed.as_bytes())).expect("written");
    let logs = [at("a"), at("b"), at("c")];
    let error = read(&logs, stage(), &ReadOptions::default()).expect_err("a and c are one");
    let LogError::SameLog { path, first } = &error else {
        panic!("{error}");
    };
    assert_eq!((path, first), (&logs[2], &logs[0]));
    assert!(error.to_string().contains("name each log once"), "{error}");
    read(&logs[..2], stage(), &ReadOptions::default()).expect("two logs");
}

#[test]
fn binary_files() {
    let error = refused_file(b"\x7fELF\x02\x01\x01\0\0\0");
    assert!(
        matches!(
            error,
            LogError::Source(SourceError::Binary { offset: 0, .. })
        ),
        "{error}"
    );
    let error = refused_file(format!("{LOG}\0").as_bytes());
    assert!(
        matches!(error, LogError::Source(SourceError::Binary { offset, .. }) if offset == LOG.len()),
        "{error}"
    );
    for (bytes, name, remedy) in [
        (&b"PK\x03\x04rest"[..], ".xlsx", "export it as CSV"),
        (b"\x93NUMPY\x01\0v\0", ".npy", "CSV"),
        (
            b"MATLAB 5.0 MAT-file, Platform: GLNXA64\0\x01IM",
            ".mat",
            "writetable",
        ),
        (
            b"MATLAB 7.3 MAT-file, Platform: GLNXA64\0\x02IM",
            ".mat",
            "writetable",
        ),
        (b"\x89HDF\r\n\x1a\n\0", ".h5", "as CSV"),
        (b"TDSm\x0e\0\0\0", ".tdms", "export it as CSV"),
        (b"PAR1\x15\x04", "Parquet", "as CSV"),
        (
            b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1",
            ".xls",
            "export it as CSV",
        ),
    ] {
        let message = refused_file(bytes).to_string();
        assert!(
            message.contains(name) && message.contains(remedy),
            "{message}"
        );
        let message = refused_file(&gzip(bytes)).to_string();
        assert!(message.contains(name), "{message}");
    }
    let error = refused_file(&gzip(&gzip(LOG.as_bytes())));
    assert!(error.to_string().contains("gzip inside gzip"), "{error}");
    // Bytes that no text has further on are a bad cell, shown without them.
    let latin = LOG.replace(",161,", ",\u{b5}61,").into_bytes();
    let error = read_bytes(
        &latin,
        Path::new("log.csv"),
        stage(),
        &ReadOptions::default(),
    );
    assert_eq!(place(&error.expect_err("refused")).0, 3);
}

/// Unpacking stops before the end, where the fault of the gzip stream would show.
#[test]
fn a_gzip_file_of_binary_data_is_unpacked_no_further_than_its_start() {
    let packed = gzip(&[0; 1 << 20]);
    let error = refused_file(&packed[..packed.len() - 9]);
    assert!(
        matches!(
            error,
            LogError::Source(SourceError::Binary { offset: 0, .. })
        ),
        "{error}"
    );
}

#[cfg(target_os = "linux")]
#[test]
fn a_device_without_end() {
    let error = read(&["/dev/zero"], stage(), &ReadOptions::default()).expect_err("refused");
    assert!(
        matches!(error, LogError::Source(SourceError::Binary { .. })),
        "{error}"
    );
}

#[test]
fn a_gzip_file_cut_anywhere_damaged_or_followed_by_rubbish() {
    let packed = gzip(LOG.as_bytes());
    for end in 2..packed.len() {
        let error = refused_file(&packed[..end]);
        assert!(
            matches!(error, LogError::Source(SourceError::GzipCut { .. })),
            "{end}: {error}"
        );
    }
    let last = packed.len() - 1;
    for at in [last, last - 4] {
        let mut wrong = packed.clone();
        wrong[at] ^= 1;
        let error = refused_file(&wrong);
        assert!(
            matches!(error, LogError::Source(SourceError::GzipDamaged { .. })),
            "checksum and length: {error}"
        );
    }
    let mut wrong = packed.clone();
    wrong[3] = 0xe0;
    let error = refused_file(&wrong);
    assert!(
        matches!(error, LogError::Source(SourceError::GzipDamaged { .. })),
        "header flags: {error}"
    );
    let error = refused_file(&[packed.as_slice(), b"rubbish"].concat());
    assert!(
        matches!(
            error,
            LogError::Source(SourceError::GzipTrailing { bytes: 7, .. })
        ),
        "{error}"
    );
    let error = refused_file(&gzip(b""));
    assert!(matches!(error, LogError::Empty { .. }), "{error}");
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
