//! `host-fit decode`.

use super::args::DecodeArgs;
use crate::error::HostError;
use crate::log::{self, ReadOptions};
use crate::pose_file;
use crate::stage::Stage;
use runtime::servo::OnInvalid;

/// Decodes a log into a pose file.
pub fn run(args: &DecodeArgs) -> Result<(), HostError> {
    let set = super::read_blob(&args.params)?;
    let stage = Stage::from_file(&args.stage)?;
    super::same_scales(&set, &stage, &args.stage)?;
    let log = log::read(std::slice::from_ref(&args.log), &stage, &ReadOptions::for_decode())?;
    let on_invalid = match args.hold {
        0 => OnInvalid::Zero,
        ticks => OnInvalid::Hold { ticks },
    };
    let decoded = pose_file::decode(&set.decoder(), &log.dataset, on_invalid);
    pose_file::write(&args.out, &decoded)?;
    super::print(&pose_file::summary(&decoded))?;
    super::print(&format!("wrote {}\n", args.out.display()))?;
    for warning in &log.warnings {
        eprintln!("warning: {warning}");
    }
    Ok(())
}
