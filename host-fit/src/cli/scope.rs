//! `host-fit scope`.

use super::arguments::StageFile;
use super::interrupt;
use crate::cli::error::HostError;
use crate::scope::file;
use clap::Args;
use std::path::PathBuf;

/// Arguments of `scope`.
#[derive(Debug, Args)]
pub(super) struct ScopeArgs {
    /// The log: CSV, also while it grows, or CSV.gz; it needs no reference.
    #[arg(value_name = "LOG")]
    log: PathBuf,
    #[command(flatten)]
    stage: StageFile,
}

/// Shows a log in the terminal.
pub(super) fn run(args: &ScopeArgs) -> Result<(), HostError> {
    Ok(file::run(
        &args.log,
        &args.stage.read()?,
        interrupt::watch().stop,
    )?)
}
