//! `import`: a record of the bus and a log of the interferometers, each with its own clock,
//! become one calibration log.
//!
//! | step | module |
//! |---|---|
//! | lines of `candump -L` to ticks, by the receiver of the bus | [`bus_log`] |
//! | receive times to sample times: the node samples evenly, the bus delivers unevenly | [`clock`] |
//! | the interferometers' CSV | [`reference`](mod@reference) |
//! | the offset between the clocks, where asked for | [`offset`] |
//! | reference between its samples, at the times of the ticks | [`join`] |
//! | the log | [`write`](mod@write) |

pub mod bus_log;
pub mod clock;
mod error;
pub mod join;
pub mod offset;
pub mod reference;
pub mod write;

pub use error::ImportError;

use crate::bus::replay::LayoutChoice;
use crate::input::stage::Stage;
use crate::output::write_atomically;
use bus_log::{BusCounts, BusReading};
use clap::Args;
use clock::Smoothing;
use hal_adapters::can::Layout;
use join::JoinCounts;
use offset::Offset;
use reference::ReferenceCounts;
use std::path::PathBuf;

/// Arguments of `import`.
#[derive(Clone, Debug, Args)]
pub struct ImportArgs {
    /// Record of the bus, as `candump -L` or `live --record` writes it.
    #[arg(value_name = "CANDUMP")]
    pub bus: PathBuf,
    /// Log of the interferometers: CSV with time, movement and beams (or pose), in the
    /// columns that stage.toml names.
    #[arg(value_name = "REFERENCE")]
    pub reference: PathBuf,
    /// The stage as designed.
    #[arg(long, value_name = "stage.toml")]
    pub stage: PathBuf,
    /// Where to write the calibration log.
    #[arg(long, value_name = "LOG.csv")]
    pub out: PathBuf,
    /// Largest time from a tick to the reference samples before and after it, us; one servo
    /// period if not given.
    #[arg(long, value_name = "US", value_parser = clap::value_parser!(u32).range(1..=10_000_000))]
    pub tolerance_us: Option<u32>,
    /// Time of the bus less time of the reference, us.
    #[arg(
        long,
        value_name = "US",
        default_value_t = 0.0,
        allow_negative_numbers = true
    )]
    pub offset_us: f64,
    /// Find the offset between the clocks by the motion that both saw.
    #[arg(long, conflicts_with = "offset_us")]
    pub estimate_offset: bool,
    /// How far from "both records start together" the offset is looked for, s.
    #[arg(
        long,
        value_name = "SECONDS",
        default_value_t = 2.0,
        requires = "estimate_offset"
    )]
    pub search_s: f64,
    /// Only frames of this interface, where the record holds several.
    #[arg(long, value_name = "IFACE")]
    pub interface: Option<String>,
    /// How codes are put into frames.
    #[arg(long, value_enum, default_value = "auto")]
    pub layout: LayoutChoice,
    /// Leave out lines that cannot be read, and count them.
    #[arg(long)]
    pub skip_bad_lines: bool,
}

/// How an import went.
#[derive(Clone, Debug, PartialEq)]
pub struct ImportReport {
    /// What the record of the bus held.
    pub bus: BusCounts,
    /// How even its times were.
    pub smoothing: Smoothing,
    /// What the log of the interferometers held.
    pub reference: ReferenceCounts,
    /// Offset between the clocks.
    pub offset: Offset,
    /// How ticks and reference went together.
    pub join: JoinCounts,
}

/// Reads both records, joins them and writes the log.
///
/// # Errors
/// See [`ImportError`]; nothing is written then.
pub fn run(args: &ImportArgs) -> Result<ImportReport, ImportError> {
    let stage = Stage::from_file(&args.stage)?;
    let layout = layout(args, &stage)?;
    let reading = bus_log::read(args, layout)?;
    let (times_us, smoothing) = clock::sample_times_us(&reading.ticks);
    let (reference, reference_counts) = reference::read(&args.reference, &stage)?;
    let offset = choose_offset(args, &stage, &reading, &times_us, &reference)?;
    let tolerance_us = args
        .tolerance_us
        .map_or(stage.servo_period_s * 1e6, f64::from);
    let reference_times = times_us.iter().map(|t| t - offset.us);
    let (rows, join) = join::join(
        &reading.ticks,
        reference_times,
        &reference.samples,
        tolerance_us,
    );
    if rows.is_empty() {
        return Err(ImportError::no_overlap(&times_us, &reference, offset.us));
    }
    write_atomically(
        &args.out,
        write::to_csv(&rows, &reference, &stage).as_bytes(),
    )?;
    Ok(ImportReport {
        bus: reading.counts,
        smoothing,
        reference: reference_counts,
        offset,
        join,
    })
}

fn layout(args: &ImportArgs, stage: &Stage) -> Result<Layout, ImportError> {
    crate::bus::replay::choose_layout(args.layout, stage).map_err(|error| ImportError::Layout {
        problem: error.to_string(),
    })
}

fn choose_offset(
    args: &ImportArgs,
    stage: &Stage,
    reading: &BusReading,
    times_us: &[f64],
    reference: &reference::Reference,
) -> Result<Offset, ImportError> {
    if !args.estimate_offset {
        return Ok(Offset {
            us: args.offset_us,
            explained: None,
        });
    }
    let search_us = args.search_s * 1e6;
    offset::estimate(&reading.ticks, times_us, reference, stage, search_us)
}

#[cfg(test)]
#[path = "import/tests.rs"]
mod tests;
