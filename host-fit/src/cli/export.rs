//! `host-fit export`.

use super::arguments::choice;
use super::inspect;
use crate::cli::error::HostError;
use crate::cli::terminal;
use crate::output::blob_file;
use crate::output::export::{ExportError, ExportFormat, SLOTS, address_of, export};
use crate::output::{kept, write_atomically};
use clap::Args;
use runtime::blob::MAX_BYTES;
use std::path::PathBuf;

crate::calibrate::values! {
    ExportFormat {
        Bin: "bin", "The bytes of the blob; give the address to the flash tool";
        Hex: "hex", "Intel HEX";
    }
}

/// Arguments of `export`.
#[derive(Debug, Args)]
pub(super) struct ExportArgs {
    /// The parameter blob.
    #[arg(value_name = "params.bin")]
    params: PathBuf,
    /// Format of the file.
    #[arg(long, value_parser = choice::<ExportFormat>(), default_value = "hex")]
    format: ExportFormat,
    /// Where in flash, in place of both slots of memory.x: a number, or 0x and a hexadecimal one.
    #[arg(long, value_name = "A", value_parser = address)]
    address: Option<u32>,
    /// One slot alone, 0 or 1: the parameters in the other slot may be newer, and run.
    #[arg(long, value_name = "0|1", conflicts_with = "address")]
    slot: Option<u8>,
    /// Where to write; next to the blob, named after the first address, if not given.
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
}

fn address(text: &str) -> Result<u32, String> {
    let parsed = match text.strip_prefix("0x").or_else(|| text.strip_prefix("0X")) {
        Some(digits) => u32::from_str_radix(digits, 16),
        None => text.parse(),
    };
    parsed.map_err(|_| "an address like 0x08004000 is expected".to_owned())
}

/// Writes a blob as the file that a flash tool takes.
pub(super) fn run(args: &ExportArgs) -> Result<(), HostError> {
    let set = blob_file::read(&args.params)?;
    let mut buffer = [0; MAX_BYTES];
    let blob = set.to_bytes(&mut buffer).map_err(ExportError::Blob)?;
    let addresses = match (args.address, args.slot) {
        (Some(address), _) => vec![address],
        (None, Some(slot)) => vec![address_of(slot)?],
        (None, None) => SLOTS.to_vec(),
    };
    let file = export(blob, args.format, &addresses)?;
    let address = addresses.first().copied().unwrap_or_default();
    let stem = args
        .params
        .file_stem()
        .unwrap_or_default()
        .to_string_lossy();
    let name = format!("{stem}-{address:08x}.{}", args.format.extension());
    let out = (args.out.clone()).unwrap_or_else(|| args.params.with_file_name(name));
    super::check_outputs([Some(out.as_path())], None, [args.params.as_path()])?;
    kept::check_own(&out, kept::IMAGE)?;
    write_atomically(&out, &file)?;
    inspect::warn_if_forced(&set);
    let places: Vec<_> = addresses.iter().map(|at| format!("{at:#010x}")).collect();
    terminal::print(&format!(
        "wrote {}: {} bytes for {}\n",
        out.display(),
        blob.len(),
        places.join(" and ")
    ))
}
