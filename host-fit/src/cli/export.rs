//! `host-fit export`.

use crate::cli::error::HostError;
use crate::cli::terminal;
use crate::output::blob_file;
use crate::output::export::{ExportError, ExportFormat, Place, SLOTS, export};
use crate::output::write_atomically;
use clap::builder::PossibleValue;
use clap::{Args, ValueEnum};
use runtime::blob::MAX_BYTES;
use std::path::PathBuf;

impl ValueEnum for ExportFormat {
    fn value_variants<'a>() -> &'a [Self] {
        &[Self::Bin, Self::Hex]
    }

    fn to_possible_value(&self) -> Option<PossibleValue> {
        let help = match self {
            Self::Bin => "The bytes of the blob; the flash tool is told the address",
            Self::Hex => "Intel HEX",
        };
        Some(PossibleValue::new(self.extension()).help(help))
    }
}

/// Arguments of `export`.
#[derive(Debug, Args)]
pub(super) struct ExportArgs {
    /// The parameter blob.
    #[arg(value_name = "params.bin")]
    params: PathBuf,
    /// Format of the file.
    #[arg(long, value_enum, default_value = "hex")]
    format: ExportFormat,
    /// Where in flash: a number, or 0x and a hexadecimal one.
    #[arg(long, value_name = "A", value_parser = address, required_unless_present = "slot")]
    address: Option<u32>,
    /// Which parameter slot of memory.x: 0 or 1.
    #[arg(long, value_name = "0|1", conflicts_with = "address")]
    slot: Option<u8>,
    /// Where to write; next to the blob, named after the address, if not given.
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
    let place = match (args.address, args.slot) {
        (Some(address), _) => Place::Address(address),
        (None, slot) => Place::Slot(slot.unwrap_or(0)),
    };
    let file = export(blob, args.format, place)?;
    let address = place.address()?;
    let stem = args
        .params
        .file_stem()
        .unwrap_or_default()
        .to_string_lossy();
    let name = format!("{stem}-{address:08x}.{}", args.format.extension());
    let out = (args.out.clone()).unwrap_or_else(|| args.params.with_file_name(name));
    super::keep_apart(&[Some(&out)], &[&args.params])?;
    write_atomically(&out, &file)?;
    let slot = SLOTS.iter().position(|slot| *slot == address);
    let slot = slot.map_or(String::new(), |slot| format!(", slot {slot}"));
    terminal::print(&format!(
        "wrote {}: {} bytes for {address:#010x}{slot}\n",
        out.display(),
        blob.len()
    ))
}
