//! `host-fit import`.

use crate::bus::import::{self, ImportSettings};
use crate::cli::error::HostError;
use crate::cli::terminal;
use crate::interrupt;
use std::path::PathBuf;

/// Joins a record of the bus and a reference, and says how it went.
pub(super) fn run(args: &ImportSettings) -> Result<(), HostError> {
    let inputs = [&args.bus, &args.reference, &args.stage].map(PathBuf::as_path);
    super::keep_apart([Some(args.out.as_path())], inputs)?;
    interrupt::watch();
    let report = import::run(args)?;
    terminal::print(&format!("{report}wrote {}\n", args.out.display()))
}
