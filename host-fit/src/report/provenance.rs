//! The origin of the figures of a report: command, versions, inputs.

use super::table::Table;
use super::text::file_name;
use hallstage_input::axis::counted;
use hallstage_input::dataset::Dataset;
use sha2::{Digest, Sha256};
use std::ffi::{OsStr, OsString};
use std::fmt::Write;
use std::fs::File;
use std::io::Read;
use std::path::Path;

/// Everything that is needed to repeat the calibration: name, description, and SHA-256 of each file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Provenance(pub Table);

impl Provenance {
    /// The command, by the arguments of this program, its own name first, and the version; no absolute path.
    pub fn new(arguments: impl Iterator<Item = OsString>) -> Self {
        let words = arguments.skip(1);
        let words: Vec<String> = words.map(|word| quoted(&without_folder(&word))).collect();
        let mut provenance = Self::default();
        let program = env!("CARGO_PKG_NAME");
        let version = env!("CARGO_PKG_VERSION");
        provenance.add("command", format!("{program} {}", words.join(" ")), "");
        provenance.add("program", format!("{program} {version}"), "");
        provenance
    }

    /// The number of a page that is no certificate: a hash of what it is made of, and of these facts.
    pub fn document(&self, facts: &[[String; 2]]) -> String {
        let hash = hex(&Sha256::digest(format!(
            "{:?}",
            (facts, self.0.cells().rows)
        )));
        format!("document {}", &hash[..8])
    }

    /// Adds a row: of a file its SHA-256 in hexadecimal digits too.
    fn add(&mut self, name: impl Into<String>, what: String, sha256: &str) {
        let what = match sha256 {
            "" => what,
            hash => format!("{what}, SHA-256 {hash}"),
        };
        self.0.row(name, [what.into()]);
    }

    /// Adds a file by its bytes; nothing where it cannot be read any more.
    pub fn add_file(&mut self, path: &Path, what: &str) {
        if let Ok(bytes) = std::fs::read(path) {
            self.add_bytes(path, &bytes, what);
        }
    }

    /// Adds a file with these bytes.
    pub fn add_bytes(&mut self, path: &Path, bytes: &[u8], what: &str) {
        let hash = hex(&Sha256::digest(bytes));
        self.add(file_name(path), what.to_owned(), &hash);
    }

    /// Adds the logs, each with the hash of its file, and the hash of their text, which the blob holds too.
    pub fn add_logs(&mut self, dataset: &Dataset) {
        for (k, log) in dataset.logs.iter().enumerate() {
            let movements = counted(log.movements_read, "movement");
            let (rows, drawn) = (log.rows_read, log.rows.len());
            let runs = dataset.movements.iter().filter(|m| m.log == k).count();
            let drawn = match drawn < rows {
                true => format!("; {drawn} of them, in {}, are drawn", counted(runs, "run")),
                false => String::new(),
            };
            let what = format!("log, {rows} rows in {movements}{drawn}");
            self.add(
                file_name(&log.path),
                what,
                &hash_of_file(&log.path).unwrap_or_default(),
            );
        }
        let what = "without compression, one after the other; the blob holds this hash";
        self.add("text of all logs", what.to_owned(), &hex(&dataset.sha256));
    }
}

/// The SHA-256 of a file as it lies on the disk; `None` of standard input.
fn hash_of_file(path: &Path) -> Option<String> {
    let (mut file, mut hash) = (File::open(path).ok()?, Sha256::new());
    let mut part = vec![0; 1 << 16];
    loop {
        match file.read(&mut part).ok()? {
            0 => return Some(hex(&hash.finalize())),
            bytes => hash.update(&part[..bytes]),
        }
    }
}

/// A word of a command line, of an absolute path the name alone: a report is mailed.
fn without_folder(word: &OsStr) -> String {
    let path = Path::new(word);
    match path.is_absolute() {
        true => file_name(path),
        false => word.to_string_lossy().into_owned(),
    }
}

/// A word of a command line as a shell takes it.
fn quoted(word: &str) -> String {
    let plain = |c: char| c.is_alphanumeric() || "-_./=:,+%@".contains(c);
    if !word.is_empty() && word.chars().all(plain) {
        word.to_owned()
    } else {
        format!("'{}'", word.replace('\'', r"'\''"))
    }
}

/// Bytes in hexadecimal digits.
pub fn hex(bytes: &[u8]) -> String {
    bytes.iter().fold(String::new(), |mut out, byte| {
        // Writing to a string cannot fail.
        let _ = write!(out, "{byte:02x}");
        out
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use hallstage_input::log::{ReadOptions, read, read_bytes};
    use hallstage_input::shipped::{self, LOG_GZ, RUN_GZ};

    #[test]
    fn the_command_can_be_given_again_as_it_stands() {
        let words = [
            "/usr/bin/host-fit",
            "fit",
            "/home/me/my log.csv",
            "--serial",
            "it's",
            "",
        ];
        let Provenance(table) = Provenance::new(words.into_iter().map(OsString::from));
        let rows = table.cells().rows;
        assert_eq!(
            rows[0][1],
            r"host-fit fit 'my log.csv' --serial 'it'\''s' ''"
        );
    }

    #[test]
    fn the_hash_of_a_log_is_of_its_file_as_it_lies_on_the_disk() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("log.csv.gz");
        std::fs::write(&path, RUN_GZ).expect("written");
        let log = read(&[&path], &shipped::stage(), &ReadOptions::FIT).expect("sound");
        let mut provenance = Provenance::default();
        provenance.add_logs(&log.dataset);
        let rows = provenance.0.cells().rows;
        assert!(rows[0][1].ends_with(&hex(&Sha256::digest(RUN_GZ))));
        assert!(rows[1][1].ends_with(&hex(&log.dataset.sha256)));
    }

    #[test]
    fn a_report_says_how_much_of_a_long_log_is_drawn() {
        let stage = shipped::stage();
        let options = ReadOptions {
            rows_max: 50_000,
            ..ReadOptions::FIT
        };
        let reading = read_bytes(LOG_GZ, "log".as_ref(), &stage, &options).expect("sound");
        let sample = reading.dataset;
        let mut provenance = Provenance::default();
        provenance.add_logs(&sample);
        let (rows, runs) = (sample.rows.len(), sample.movements.len());
        let want = format!(
            "log, 57000 rows in 57 movements; {rows} of them, in {}, are drawn",
            counted(runs, "run")
        );
        assert!(provenance.0.cells().rows[0][1].starts_with(&want));
    }
}
