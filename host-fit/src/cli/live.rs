//! `host-fit live`.

use crate::bus::live::{self, LiveSettings};
use crate::cli::error::HostError;

/// Decodes a bus.
pub(super) fn run(args: &LiveSettings) -> Result<(), HostError> {
    super::keep_apart([args.record.as_deref()], [args.params.as_path()])?;
    Ok(live::run(args)?)
}
