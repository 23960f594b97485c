//! `import`: a record of the bus and a log of the interferometers, each with its own clock,
//! become one calibration log.
//!
//! | step | module |
//! |---|---|
//! | lines of `candump -L` to ticks, by the receiver of the bus | [`bus_log`] |
//! | receive times to sample times: the node samples evenly, the bus delivers unevenly | [`clock`] |
//! | the interferometers' CSV | [`reference`](mod@reference) |
//! | offset between the clocks and difference in speed, where asked for | [`offset`] |
//! | reference between its samples, at the times of the ticks | [`join`] |
//! | the log | [`write`](mod@write) |

pub mod bus_log;
pub mod clock;
mod error;
pub mod join;
pub mod offset;
pub mod reference;
mod refine;
pub mod write;

pub use error::ImportError;

use crate::input::stage::Stage;
use crate::output::write_atomically;
use bus_log::{BusCounts, BusReading};
use clock::Smoothing;
use hal_adapters::can::Layout;
use join::JoinCounts;
use offset::Offset;
use reference::ReferenceCounts;
use std::path::PathBuf;

/// What is joined, and how.
#[derive(Clone, Debug)]
pub struct ImportSettings {
    /// Record of the bus, as `candump -L` writes it.
    pub bus: PathBuf,
    /// Log of the interferometers.
    pub reference: PathBuf,
    /// The stage file.
    pub stage: PathBuf,
    /// Where to write the calibration log.
    pub out: PathBuf,
    /// Largest time from a tick to the reference samples before and after it, us; one servo
    /// period if `None`.
    pub tolerance_us: Option<u32>,
    /// Time of the bus less time of the reference, us; not used with `estimate_offset`.
    pub offset_us: f64,
    /// Find the offset between the clocks, and how much faster one runs, by the motion that both saw.
    pub estimate_offset: bool,
    /// How far from "both records start together" the offset is looked for, s.
    pub search_s: f64,
    /// Only frames of this interface; all frames are of one if `None`.
    pub interface: Option<String>,
    /// How codes were put into frames; as the first frame with codes shows if `None`.
    pub layout: Option<Layout>,
    /// Leave out lines that cannot be read, and count them.
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
pub fn run(settings: &ImportSettings) -> Result<ImportReport, ImportError> {
    let stage = Stage::from_file(&settings.stage)?;
    let reading = bus_log::read(settings)?;
    let (times_us, smoothing) = clock::sample_times_us(&reading.ticks);
    if smoothing.rms_us > stage.servo_period_s * 1e6 {
        let rms_us = smoothing.rms_us;
        return Err(ImportError::UnevenTimes { rms_us });
    }
    let (reference, reference_counts) = reference::read(&settings.reference, &stage)?;
    let offset = choose_offset(settings, &stage, &reading, &times_us, &reference)?;
    let tolerance_us = settings
        .tolerance_us
        .map_or(stage.servo_period_s * 1e6, f64::from);
    let reference_times = times_us.iter().map(|t| offset.on_reference_us(*t));
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
        &settings.out,
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

fn choose_offset(
    settings: &ImportSettings,
    stage: &Stage,
    reading: &BusReading,
    times_us: &[f64],
    reference: &reference::Reference,
) -> Result<Offset, ImportError> {
    if !settings.estimate_offset {
        return Ok(Offset {
            us: settings.offset_us,
            rate: 0.0,
            middle_us: 0.0,
            explained: None,
        });
    }
    let search_us = settings.search_s * 1e6;
    offset::estimate(&reading.ticks, times_us, reference, stage, search_us)
}

#[cfg(test)]
#[path = "import/tests.rs"]
mod tests;

#[cfg(test)]
#[path = "import/controller_tests.rs"]
mod controller_tests;
