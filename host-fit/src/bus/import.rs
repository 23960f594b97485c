//! `import`: a record of the bus and a log of the interferometers, each with its own clock, become one
//! calibration log.
//!
//! | step | module |
//! |---|---|
//! | lines of `candump -L` to ticks, by the receiver of the bus | `bus_reader`, [`bus_log`] |
//! | the time of each tick's sample, by the clock of the node | `node_clock` |
//! | the interferometers' CSV | [`reference`](mod@reference) |
//! | offset and difference in speed of the clocks, from the motion | [`offset`] |
//! | the reference at the times of the ticks | [`join`](mod@join) |

pub mod bus_log;
mod bus_reader;
mod error;
pub mod join;
mod node_clock;
pub mod offset;
pub mod reference;

pub use error::ImportError;

use crate::bus::BusAddress;
use crate::output::Output;
use bus_log::BusCounts;
use hallstage_input::log_format::LogFormat;
use hallstage_input::stage::Stage;
use hallstage_input::watch::Watch;
use join::{JoinCounts, join};
use node_clock::Tick;
use offset::{Offset, Records};
use reference::{Reference, ReferenceCounts};
use runtime::frame::MISSING_CODE;
use std::path::PathBuf;

/// Settings of `import`.
#[derive(Clone, Debug)]
pub(crate) struct ImportSettings {
    /// Record of the bus, as `record`, `live --record` or `candump -L` writes it.
    pub(crate) bus: PathBuf,
    /// Log of the interferometers: CSV with time, movement and beams (or pose), in the
    /// columns that stage.toml names.
    pub(crate) reference: PathBuf,
    /// The stage as designed.
    pub(crate) stage: PathBuf,
    /// Where to write the calibration log.
    pub(crate) out: PathBuf,
    /// Largest time from a tick to the reference samples before and after it, us; one servo
    /// period if not given.
    pub(crate) tolerance_us: Option<u32>,
    /// Start of the search: time of the bus less time of the reference, us. Without it, both records start
    /// together.
    pub(crate) offset_us: Option<f64>,
    /// How far from its start the offset is searched, s.
    pub(crate) search_s: f64,
    /// Only frames of this interface, where the record holds several; can0@5 for the frames of node 5.
    pub(crate) interface: Option<BusAddress>,
    /// Leave out lines that cannot be read, and count them.
    pub(crate) skip_bad_lines: bool,
}

/// The result of an import.
#[derive(Clone, Debug, PartialEq)]
pub struct ImportReport {
    /// Frames and ticks of the record.
    pub bus: BusCounts,
    /// Rows of the reference.
    pub reference: ReferenceCounts,
    /// Offset between the clocks.
    pub offset: Offset,
    /// Rows of the log.
    pub join: JoinCounts,
    /// The record has temperatures, but the stage names no columns for them: the log has none.
    pub temperatures_left_out: bool,
}

/// Bytes of the log that are written at a time, about.
const TEXT_BYTES: usize = 1 << 16;

/// Reads both records, joins them and writes the log.
///
/// # Errors
/// See [`ImportError`]; nothing is written then.
pub(crate) fn run(
    settings: &ImportSettings,
    watch: Watch<'static>,
) -> Result<ImportReport, ImportError> {
    let stage = Stage::from_file(&settings.stage)?;
    let (run, bus) = bus_reader::read(settings, &stage, watch)?;
    let reference = Reference::read(&settings.reference, &stage)?;
    let records = Records::new(&run, &reference, &stage);
    let (clocks, offset) = records.estimate(settings.offset_us, settings.search_s * 1e6)?;

    let has_temperature = |tick: &Tick| tick.codes.temperature_mc != [MISSING_CODE; 2];
    let has_temperatures = run.ticks.iter().any(has_temperature);
    let format = LogFormat::new(reference.quantities, has_temperatures, &stage);
    let mut log = Output::create(&settings.out)?;
    let mut text = format.header();
    let period_us = stage.servo_period_s * 1e6;
    let tolerance_us = settings.tolerance_us.map_or(period_us, f64::from);
    let join = join(
        &run.ticks,
        &reference.samples,
        |t_us| clocks.on_reference_us(t_us),
        (tolerance_us, period_us),
        &mut |row| {
            format.append(&mut text, (row.movement, row.t_us), row.values, &row.codes);
            if text.len() > TEXT_BYTES {
                log.write(text.as_bytes())?;
                text.clear();
            }
            Ok(())
        },
    )?;
    join.check()?;
    log.write(text.as_bytes())?;
    log.finish()?;
    Ok(ImportReport {
        bus,
        reference: reference.counts,
        offset,
        join,
        temperatures_left_out: has_temperatures
            && stage.temperature.columns.iter().all(Option::is_none),
    })
}

#[cfg(test)]
#[path = "import/tests.rs"]
mod tests;

#[cfg(test)]
#[path = "import/clock_tests.rs"]
mod clock_tests;

#[cfg(test)]
#[path = "import/hostile_tests.rs"]
mod hostile_tests;

#[cfg(test)]
#[path = "import/loss_tests.rs"]
mod loss_tests;
