//! `host-fit record`.

use super::arguments::seconds;
use super::interrupt;
use super::key::KeyFile;
use crate::bus::BusAddress;
use crate::bus::recorder::{self, RecordSettings};
use crate::cli::error::HostError;
use crate::cli::terminal;
use clap::Args;
use std::path::PathBuf;
use std::time::Duration;

/// Arguments of `record`.
#[derive(Debug, Args)]
pub(super) struct RecordArgs {
    /// CAN interface, for instance can0; can0@5 for node 5 of the bus.
    #[arg(value_name = "IFACE")]
    can: BusAddress,
    /// Where to write the record, as `candump -L` does, for `join`: a new file.
    #[arg(long, value_name = "BUS.log")]
    out: PathBuf,
    #[command(flatten)]
    key: KeyFile,
    /// End after this many seconds; without it, on Ctrl-C.
    #[arg(long, value_name = "SECONDS", value_parser = seconds)]
    seconds: Option<Duration>,
}

impl RecordArgs {
    fn settings(&self) -> RecordSettings {
        RecordSettings {
            can: self.can.clone(),
            out: self.out.clone(),
            seconds: self.seconds,
        }
    }
}

/// Records, and says what the record holds.
pub(super) fn run(args: &RecordArgs) -> Result<(), HostError> {
    super::check_outputs([Some(args.out.as_path())], None, [])?;
    let (key, shows) = (args.key.read()?, !terminal::is_quiet());
    let recorded = recorder::run(&args.settings(), key, shows, interrupt::watch().stop)?;
    if !recorded.is_stopped {
        terminal::warn(&["the controller did not confirm that it sends no more codes".to_owned()]);
    }
    let (watch, path) = (recorded.watch, args.out.display());
    terminal::print(&format!("recorded {watch}\nwrote {path}\n"))
}
