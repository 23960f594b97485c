//! The key of a stage.

use crate::cli::error::HostError;
use clap::Args;
use hal_adapters::can::update::Key;
use std::path::{Path, PathBuf};

/// The key file of a command that asks a controller.
#[derive(Debug, Args)]
pub(crate) struct KeyFile {
    /// The key of the stage, if the controller has one: a file with 32 hexadecimal digits.
    #[arg(long, value_name = "FILE")]
    key: Option<PathBuf>,
}

impl KeyFile {
    /// The key, if a file is named.
    pub(super) fn read(&self) -> Result<Option<Key>, HostError> {
        self.key.as_deref().map(read).transpose()
    }
}

fn read(path: &Path) -> Result<Key, HostError> {
    let refused = |problem: String| {
        let path = path.display();
        HostError::input(format!(
            "{path}: {problem}; name the file with the key of this stage"
        ))
    };
    let text = std::fs::read_to_string(path).map_err(|error| refused(error.to_string()))?;
    let digits = text.trim();
    let is_hex = digits.bytes().all(|byte| byte.is_ascii_hexdigit());
    match u128::from_str_radix(digits, 16) {
        Ok(key) if is_hex && digits.len() == 32 => Ok(key.to_be_bytes()),
        // The text itself is not shown: it may be most of a key.
        _ => Err(refused(
            "32 hexadecimal digits are expected, and nothing else".to_owned(),
        )),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_key_is_32_hexadecimal_digits_and_no_error_shows_it() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("key");
        let read_text = |text: &str| {
            std::fs::write(&path, text).expect("written");
            read(&path)
        };
        let key = read_text("000102030405060708090a0b0c0d0e0F\n").expect("a key");
        assert_eq!(key, [0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15]);
        for wrong in [
            "",
            "00010203",
            "+00102030405060708090a0b0c0d0e0f",
            &"0".repeat(33),
        ] {
            let error = read_text(wrong).expect_err("no key").to_string();
            assert!(error.contains("32 hexadecimal digits"), "{error}");
            assert!(wrong.is_empty() || !error.contains(wrong), "{error}");
        }
    }
}
