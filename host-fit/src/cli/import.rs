//! `host-fit import`.

use super::args::{LayoutChoice, StageFile, between};
use crate::bus::BusAddress;
use crate::bus::import::{self, ImportSettings};
use crate::cli::error::HostError;
use crate::cli::terminal;
use crate::interrupt;
use clap::Args;
use std::path::PathBuf;

/// Arguments of `import`.
#[derive(Debug, Args)]
pub(super) struct ImportArgs {
    /// Record of the bus, as `record`, `live --record` or `candump -L` writes it.
    #[arg(value_name = "CANDUMP")]
    bus: PathBuf,
    /// Log of the interferometers: CSV with time, movement and beams (or pose), in the
    /// columns that stage.toml names.
    #[arg(value_name = "REFERENCE")]
    reference: PathBuf,
    #[command(flatten)]
    stage: StageFile,
    /// Where to write the calibration log.
    #[arg(long, value_name = "LOG.csv")]
    out: PathBuf,
    /// Largest time from a tick to the reference samples before and after it, us; one servo
    /// period if not given.
    #[arg(long, value_name = "US", value_parser = clap::value_parser!(u32).range(1..=10_000_000))]
    tolerance_us: Option<u32>,
    /// Time of the bus less time of the reference, us.
    #[arg(
        long,
        value_name = "US",
        default_value_t = 0.0,
        allow_negative_numbers = true
    )]
    offset_us: f64,
    /// Find the offset between the clocks, and how much faster one runs, by the motion that both
    /// saw.
    #[arg(long, conflicts_with = "offset_us")]
    estimate_offset: bool,
    /// How far from "both records start together" the offset is looked for, s.
    #[arg(
        long,
        value_name = "SECONDS",
        default_value_t = 2.0,
        value_parser = search_seconds,
        requires = "estimate_offset"
    )]
    search_s: f64,
    /// Only frames of this interface, where the record holds several; can0@5 for those of node 5.
    #[arg(long, value_name = "IFACE")]
    interface: Option<BusAddress>,
    /// How codes are put into frames; auto: as the first frame with codes shows.
    #[arg(long, value_enum, default_value = "auto")]
    layout: LayoutChoice,
    /// Leave out lines that cannot be read, and count them.
    #[arg(long)]
    skip_bad_lines: bool,
}

/// Further than an hour apart, two records are dated by hand: `--offset-us`.
fn search_seconds(text: &str) -> Result<f64, String> {
    between(text, 0.0, 3600.0, "a number of seconds")
}

/// Joins a record of the bus and a reference, and says how it went.
pub(super) fn run(args: &ImportArgs) -> Result<(), HostError> {
    let inputs = [&args.bus, &args.reference, &args.stage.path].map(PathBuf::as_path);
    super::keep_apart([Some(args.out.as_path())], inputs)?;
    interrupt::watch();
    let settings = ImportSettings {
        bus: args.bus.clone(),
        reference: args.reference.clone(),
        stage: args.stage.path.clone(),
        out: args.out.clone(),
        tolerance_us: args.tolerance_us,
        offset_us: args.offset_us,
        estimate_offset: args.estimate_offset,
        search_s: args.search_s,
        address: args.interface.clone(),
        layout: args.layout.layout(),
        skip_bad_lines: args.skip_bad_lines,
    };
    let report = import::run(&settings)?;
    terminal::print(&format!("{report}wrote {}\n", settings.out.display()))
}
