//! `host-fit update`.

use super::identify;
use super::inspect;
use super::interrupt;
use super::key::KeyFile;
use crate::bus::BusAddress;
use crate::bus::update::{UpdateSettings, Updated, on, talk_to};
use crate::cli::error::HostError;
use crate::cli::terminal;
use crate::output::blob_file;
use clap::Args;
use std::path::{Path, PathBuf};

/// Arguments of `update`.
#[derive(Debug, Args)]
pub(super) struct UpdateArgs {
    /// The parameter blob; with --activate alone the newest parameters in the controller are activated.
    #[arg(value_name = "params.bin", required_unless_present = "activate")]
    params: Option<PathBuf>,
    /// CAN interface, for instance can0; can0@5 for node 5 of the bus.
    #[arg(long, value_name = "IFACE")]
    can: BusAddress,
    #[command(flatten)]
    key: KeyFile,
    /// Update only the controller with this serial number. Without it, a controller with another serial
    /// number than the blob is refused.
    #[arg(long, value_name = "TEXT")]
    serial: Option<String>,
    /// Declare that the servo is off, for the time of the update. Switch it off first.
    #[arg(long)]
    servo_off: bool,
    /// Reset the controller at the end, so that it runs the new parameters. Otherwise they wait for an
    /// activation or for power-on.
    #[arg(long)]
    activate: bool,
}

/// Stores new parameters in a controller, and prints which it had and has.
pub(super) fn run(args: &UpdateArgs) -> Result<(), HostError> {
    let blob = match &args.params {
        Some(path) => Some(read_blob(path, args.serial.as_deref())?),
        None => None,
    };
    let settings = UpdateSettings {
        blob,
        serial: args.serial.clone(),
        key: args.key.read()?,
        declares_servo_off: args.servo_off,
        activates: args.activate,
    };
    let updated = talk_to(
        &args.can,
        interrupt::watch(),
        "updating",
        |talk, progress| on::update(talk, &settings, progress),
    )?;
    terminal::print(&as_text(&updated))?;
    identify::warn_without_key(&updated.before);
    let (words, transfers) = (updated.repeated_words, updated.repeated_transfers);
    if words + transfers > 0 {
        terminal::warn(&[format!(
            "{words} lost words and {transfers} failed transfers were sent again; look at the bus and its load"
        )]);
    }
    Ok(())
}

/// The blob, unless it belongs to another stage than `--serial` says.
fn read_blob(path: &Path, asked: Option<&str>) -> Result<Vec<u8>, HostError> {
    let set = blob_file::read(path)?;
    inspect::warn_if_forced(&set);
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

/// The parameters that the controller had and has.
fn as_text(updated: &Updated) -> String {
    let (serial, sequence) = (&updated.before.serial, updated.sequence);
    let before = identify::parameters(&updated.before);
    let ran = (updated.before.running).is_some_and(|(id, _)| id.sequence == sequence);
    match (updated.is_stored, updated.is_active) {
        (false, true) if ran => {
            format!("{serial}: runs these parameters already ({before}); nothing was sent\n")
        }
        (_, true) => format!("{serial}: had {before}\n{serial}: runs number {sequence}\n"),
        (false, false) => format!(
            "{serial}: runs {before}\n{serial}: has these parameters already as number {sequence}, which waits for --activate \
             or power-on; nothing was sent\n"
        ),
        (true, false) => format!(
            "{serial}: runs {before}\n{serial}: stored number {sequence}, which waits for --activate or power-on\n"
        ),
    }
}
