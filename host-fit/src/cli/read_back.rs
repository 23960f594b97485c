//! `host-fit read-back`.

use super::identify;
use super::interrupt;
use crate::bus::BusAddress;
use crate::bus::update::{on, talk_to};
use crate::cli::error::HostError;
use crate::cli::terminal;
use crate::output::{kept, write_atomically};
use clap::Args;
use std::path::PathBuf;

/// Arguments of `read-back`.
#[derive(Debug, Args)]
pub(super) struct ReadBackArgs {
    /// CAN interface, for instance can0; can0@5 for node 5 of the bus.
    #[arg(long, value_name = "IFACE")]
    can: BusAddress,
    /// Where to write the parameter blob; `-` for standard output.
    #[arg(long, value_name = "params.bin")]
    out: PathBuf,
}

/// Writes the parameters that a controller runs, as a blob, bit for bit.
pub(super) fn run(args: &ReadBackArgs) -> Result<(), HostError> {
    super::check_outputs([Some(args.out.as_path())], None, [])?;
    kept::check_own(&args.out, kept::BLOB)?;
    let (identity, blob) = talk_to(
        &args.can,
        interrupt::watch(),
        "reading",
        |talk, progress| on::read_back(talk, progress),
    )?;
    write_atomically(&args.out, &blob)?;
    let parameters = identify::parameters(&identity);
    terminal::print(&format!("{}: runs {parameters}\n", identity.serial))?;
    super::wrote([args.out.clone()])
}
