//! `host-fit import`.

use crate::bus::import::{self, ImportSettings};
use crate::cli::error::HostError;
use crate::cli::terminal;
use crate::report::table::{as_text, tables};
use hallstage_input::interrupt;
use std::path::PathBuf;

/// Joins a record of the bus and a reference, and shows how it went.
pub(super) fn run(args: &ImportSettings) -> Result<(), HostError> {
    let inputs = [&args.bus, &args.reference, &args.stage].map(PathBuf::as_path);
    super::keep_apart([Some(args.out.as_path())], inputs)?;
    interrupt::watch();
    let report = import::run(args)?;
    terminal::print(&as_text(&tables(&report, &[])))?;
    let unnamed = "temperatures are left out: name their columns in [temperature] of the stage file (mount, body)";
    terminal::warn(
        report
            .temperatures_left_out
            .then(|| unnamed.to_owned())
            .as_slice(),
    );
    super::wrote([args.out.clone()])
}
