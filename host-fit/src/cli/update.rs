//! `host-fit update`.

use super::identify;
use crate::bus::update::{self, Plan, Updated, Wanted};
use crate::cli::error::HostError;
use crate::cli::terminal;
use crate::output::blob_file;
use clap::Args;
use hal_adapters::can::update::Key;
use std::path::{Path, PathBuf};

/// Arguments of `update`.
#[derive(Debug, Args)]
pub(super) struct UpdateArgs {
    /// The parameter blob; with --activate it may be left out: what the controller keeps is activated.
    #[arg(value_name = "params.bin", required_unless_present_any = ["previous", "activate"])]
    params: Option<PathBuf>,
    /// CAN interface, for instance can0.
    #[arg(long, value_name = "IFACE")]
    can: String,
    /// The key of the stage: a file with 32 hexadecimal digits.
    #[arg(long, value_name = "FILE")]
    key: Option<PathBuf>,
    /// Update only a controller that tells this serial number; without it, not one that tells another
    /// than the blob.
    #[arg(long, value_name = "TEXT")]
    serial: Option<String>,
    /// Declare that the servo is off, for the time of the update. Switch it off first.
    #[arg(long)]
    servo_off: bool,
    /// Reset the controller at the end, so that it runs the new parameters; else they wait for that, or
    /// for power-on.
    #[arg(long)]
    activate: bool,
    /// Go back to the parameters that were stored before the newest.
    #[arg(long, conflicts_with = "params")]
    previous: bool,
}

/// Stores new parameters in a controller, and says what it had and has.
pub(super) fn run(args: &UpdateArgs) -> Result<(), HostError> {
    let key = args.key.as_deref().map(read_key).transpose()?;
    let wanted = match &args.params {
        Some(path) => Wanted::Blob(read_blob(path, args.serial.as_deref())?),
        None if args.previous => Wanted::Previous,
        None => Wanted::Newest,
    };
    let updated = update::update(
        &args.can,
        &Plan {
            wanted,
            serial: args.serial.clone(),
            key,
            declares_servo_off: args.servo_off,
            activates: args.activate,
        },
    )?;
    terminal::print(&as_text(&updated))?;
    let (words, transfers) = updated.repeated;
    if words + transfers > 0 {
        terminal::warn(&[format!(
            "{words} words were lost and {transfers} transfers came to nothing, and were sent again; look at the bus and \
             its load"
        )]);
    }
    Ok(())
}

/// The blob, if it is that of the stage that was asked for.
fn read_blob(path: &Path, asked: Option<&str>) -> Result<Vec<u8>, HostError> {
    let set = blob_file::read(path)?;
    let own = set.serial.as_str();
    match asked {
        Some(asked) if !own.is_empty() && asked != own => {
            let path = path.display();
            let problem = format!("{path} belongs to the stage `{own}`, not `{asked}`");
            Err(HostError::usage("--serial", problem))
        }
        _ => Ok(blob_file::to_bytes(path, &set)?),
    }
}

/// What the controller had and has.
fn as_text(updated: &Updated) -> String {
    let had = updated.before.running.as_ref();
    let before = identify::parameters(had);
    let (serial, record) = (&updated.before.serial, updated.record);
    let ran = had.is_some_and(|running| running.sequence == record);
    match (updated.sequence, updated.is_active) {
        (None, true) if ran => {
            format!("{serial}: runs these parameters already ({before}); nothing was sent\n")
        }
        (_, true) => format!("{serial}: had {before}\n{serial}: runs number {record}\n"),
        (None, false) => format!(
            "{serial}: runs {before}\n{serial}: keeps these parameters already, as number {record}, which waits for \
             --activate or power-on; nothing was sent\n"
        ),
        (Some(_), false) => format!(
            "{serial}: runs {before}\n{serial}: stored number {record}, which waits for --activate or power-on\n"
        ),
    }
}

/// A key file: 32 hexadecimal digits.
fn read_key(path: &Path) -> Result<Key, HostError> {
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
        let read = |text: &str| {
            std::fs::write(&path, text).expect("written");
            read_key(&path)
        };
        let key = read("000102030405060708090a0b0c0d0e0F\n").expect("a key");
        assert_eq!(key, [0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15]);
        for wrong in [
            "",
            "00010203",
            "+00102030405060708090a0b0c0d0e0f",
            &"0".repeat(33),
        ] {
            let error = read(wrong).expect_err("no key").to_string();
            assert!(error.contains("32 hexadecimal digits"), "{error}");
            assert!(wrong.is_empty() || !error.contains(wrong), "{error}");
        }
    }
}
