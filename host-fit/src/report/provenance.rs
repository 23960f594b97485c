//! Where the figures of a report come from: command, versions, inputs, seed.

use crate::input::dataset::{Dataset, Movement};
use serde::Serialize;
use sha2::{Digest, Sha256};
use std::fmt::Write;
use std::path::Path;

/// What somebody needs to make the same calibration again.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Provenance {
    /// The command as it was given.
    pub command: String,
    /// Name and version of the program.
    pub program: String,
    /// Serial number of the stage, as given.
    pub serial: String,
    /// Creation time, as given.
    pub created: String,
    /// The files that were read.
    pub inputs: Vec<Input>,
    /// Seed of everything random.
    pub seed: u64,
}

/// One file that was read.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Input {
    /// Its name, as given.
    pub name: String,
    /// What it is.
    pub what: String,
    /// SHA-256 in hexadecimal digits: of a log without compression.
    pub sha256: String,
}

impl Provenance {
    /// Of a run of this program with these arguments, the name of the program first.
    pub fn new(arguments: impl Iterator<Item = String>) -> Self {
        let words: Vec<String> = arguments.skip(1).map(|word| quoted(&word)).collect();
        Self {
            command: format!("{} {}", env!("CARGO_PKG_NAME"), words.join(" ")),
            program: concat!(env!("CARGO_PKG_NAME"), " ", env!("CARGO_PKG_VERSION")).to_owned(),
            ..Self::default()
        }
    }

    /// Adds a file by its bytes; nothing where it cannot be read any more.
    pub fn add_file(&mut self, path: &Path, what: &str) {
        if let Ok(bytes) = std::fs::read(path) {
            self.add_bytes(path, &bytes, what);
        }
    }

    /// Adds a file with these bytes.
    pub fn add_bytes(&mut self, path: &Path, bytes: &[u8], what: &str) {
        self.inputs.push(Input {
            name: path.display().to_string(),
            what: what.to_owned(),
            sha256: hex(&Sha256::digest(bytes)),
        });
    }

    /// Adds the logs. They have one hash, which the blob holds too.
    pub fn add_logs(&mut self, dataset: &Dataset) {
        let hash = hex(&dataset.sha256);
        for (k, log) in dataset.logs.iter().enumerate() {
            let count = |movements: &[Movement]| {
                let of_log = movements.iter().filter(|m| m.log == k);
                of_log.fold((0, 0), |(rows, n), m| (rows + m.rows.len(), n + 1))
            };
            let here = count(&dataset.movements);
            let (rows, movements) = match &dataset.whole {
                Some(whole) => count(whole.movements()),
                None => here,
            };
            let movements = match movements {
                1 => "one movement".to_owned(),
                several => format!("{several} movements"),
            };
            let drawn = match (&dataset.whole, here) {
                (Some(_), (rows, runs)) => format!("; {rows} of them, in {runs} runs, are drawn"),
                (None, _) => String::new(),
            };
            self.inputs.push(Input {
                name: log.path.display().to_string(),
                what: format!("log, {rows} rows in {movements}{drawn}"),
                sha256: match dataset.logs.len() {
                    1 => hash.clone(),
                    _ => String::new(),
                },
            });
        }
        if dataset.logs.len() > 1 {
            self.inputs.push(Input {
                name: "all logs".to_owned(),
                what: "one after the other".to_owned(),
                sha256: hash,
            });
        }
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

    #[test]
    fn the_command_can_be_given_again_as_it_stands() {
        let words = [
            "/usr/bin/host-fit",
            "fit",
            "my log.csv",
            "--serial",
            "it's",
            "",
        ];
        let provenance = Provenance::new(words.into_iter().map(str::to_owned));
        assert_eq!(
            provenance.command,
            r"host-fit fit 'my log.csv' --serial 'it'\''s' ''"
        );
    }
}
