//! `host-fit record`.

use super::interrupt;
use crate::bus::recorder::{self, RecordArgs};
use crate::cli::error::HostError;
use crate::cli::terminal;

/// Records, and says what the record holds.
pub(super) fn run(args: &RecordArgs) -> Result<(), HostError> {
    super::check_outputs([Some(args.out.as_path())], None, [])?;
    let (key, shows) = (args.key.read()?, !terminal::is_quiet());
    let recorded = recorder::run(args, key, shows, interrupt::watch().stop)?;
    if !recorded.is_stopped {
        terminal::warn(&["the controller did not confirm that it sends no more codes".to_owned()]);
    }
    let (watch, path) = (recorded.watch, args.out.display());
    terminal::print(&format!("recorded {watch}\nwrote {path}\n"))
}
