//! `host-fit live`.

use super::interrupt;
use crate::bus::live::{self, LiveSettings};
use crate::cli::error::HostError;

/// Decodes a bus.
pub(super) fn run(args: &LiveSettings) -> Result<(), HostError> {
    super::check_outputs([args.record.as_deref()], None, [args.params.as_path()])?;
    Ok(live::run(args, interrupt::watch().stop)?)
}
