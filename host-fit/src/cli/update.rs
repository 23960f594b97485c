//! `host-fit update`.

use super::identify;
use super::key::KeyFile;
use crate::bus::BusAddress;
use crate::bus::update::{self, Plan, Updated, Wanted};
use crate::cli::error::HostError;
use crate::cli::terminal;
use crate::output::blob_file;
use clap::Args;
use std::path::{Path, PathBuf};

/// Arguments of `update`.
#[derive(Debug, Args)]
pub(super) struct UpdateArgs {
    /// The parameter blob; with --activate it may be left out: what the controller keeps is activated.
    #[arg(value_name = "params.bin", required_unless_present_any = ["previous", "activate"])]
    params: Option<PathBuf>,
    /// CAN interface, for instance can0; can0@5 for node 5 of the bus.
    #[arg(long, value_name = "IFACE")]
    can: BusAddress,
    #[command(flatten)]
    key: KeyFile,
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
    let key = args.key.read()?;
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
