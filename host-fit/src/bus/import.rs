//! `import`: a record of the bus and a log of the interferometers, each with its own clock,
//! become one calibration log.
//!
//! | step | module |
//! |---|---|
//! | lines of `candump -L` to ticks, by the receiver of the bus | `bus_reader`, [`bus_log`] |
//! | ticks at the times when the node sampled them, by its own clock | `node_clock` |
//! | the interferometers' CSV | [`reference`](mod@reference) |
//! | offset between the clocks and difference in speed, found or checked by the motion | [`offset`] |
//! | reference between its samples, at the times of the ticks | [`join`] |

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
use hal_adapters::can::Layout;
use hallstage_input::log_format::LogFormat;
use hallstage_input::stage::Stage;
use hallstage_input::watch::Watch;
use join::{JoinCounts, JoinedRow, join};
use node_clock::Tick;
use offset::{Clocks, Offset, Records};
use reference::{Reference, ReferenceCounts};
use runtime::frame::MISSING_CODE;
use serde::Serialize;
use std::path::PathBuf;

/// What is joined, and how.
#[derive(Clone, Debug)]
pub struct ImportSettings {
    /// Record of the bus, as `record`, `live --record` or `candump -L` writes it.
    pub bus: PathBuf,
    /// Log of the interferometers: CSV with time, movement and beams (or pose), in the
    /// columns that stage.toml names.
    pub reference: PathBuf,
    /// The stage as designed.
    pub stage: PathBuf,
    /// Where to write the calibration log.
    pub out: PathBuf,
    /// Largest time from a tick to the reference samples before and after it, us; one servo
    /// period if not given.
    pub tolerance_us: Option<u32>,
    /// Time of the bus less time of the reference, us.
    pub offset_us: f64,
    /// Find the offset between the clocks, and how much faster one runs, by the motion that both
    /// saw.
    pub estimate_offset: bool,
    /// How far from "both records start together" the offset is looked for, s.
    pub search_s: f64,
    /// Only frames of this interface, where the record holds several; can0@5 for those of node 5.
    pub interface: Option<BusAddress>,
    /// How codes are put into frames; auto: as the first frame with codes shows.
    pub layout: Option<Layout>,
    /// Leave out lines that cannot be read, and count them.
    pub skip_bad_lines: bool,
    /// Shows how far the reading is, and can end it.
    pub watch: Watch<'static>,
}

/// How an import went.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ImportReport {
    /// What the record of the bus held.
    pub bus: BusCounts,
    /// What the log of the interferometers held.
    pub reference: ReferenceCounts,
    /// Offset between the clocks.
    pub offset: Offset,
    /// How ticks and reference went together.
    pub join: JoinCounts,
    /// The record has temperatures for which the stage names no columns: they are not in the log.
    #[serde(skip)]
    pub temperatures_left_out: bool,
}

/// Bytes of the log that are written at a time, about.
const TEXT_BYTES: usize = 1 << 16;

/// Reads both records, joins them and writes the log.
///
/// # Errors
/// See [`ImportError`]; nothing is written then.
pub fn run(settings: &ImportSettings) -> Result<ImportReport, ImportError> {
    let stage = Stage::from_file(&settings.stage)?;
    let (run, bus) = bus_reader::read(settings, &stage)?;
    let reference = Reference::read(&settings.reference, &stage)?;
    let period_us = stage.servo_period_s * 1e6;
    let tolerance_us = settings.tolerance_us.map_or(period_us, f64::from);
    let joined = |clocks: &Clocks, take: &mut dyn FnMut(&JoinedRow) -> Result<(), ImportError>| {
        let reference_us = |t_us| clocks.on_reference_us(t_us);
        let limits_us = (tolerance_us, period_us);
        join(
            &run.ticks,
            &reference.samples,
            reference_us,
            limits_us,
            take,
        )
    };
    let records = Records::new(&run, &reference, &stage);
    let recorder_us = run.recorder_less_node_us();
    let (clocks, seen) = if settings.estimate_offset {
        records.estimate(settings.search_s * 1e6)?
    } else {
        let given = Clocks {
            us: settings.offset_us - recorder_us,
            rate: 0.0,
            middle_us: records.middle_us(),
        };
        joined(&given, &mut |_| Ok(()))?.check()?;
        records.checked(given)?
    };
    let is_warm = |tick: &Tick| tick.codes.temperature_mc != [MISSING_CODE; 2];
    let has_temperatures = run.ticks.iter().any(is_warm);
    let format = LogFormat::new(reference.quantities, has_temperatures, &stage);
    let mut log = Output::create(&settings.out)?;
    let mut text = format.header();
    let join = joined(&clocks, &mut |row| {
        format.append(&mut text, (row.movement, row.t_us), row.values, &row.codes);
        if text.len() > TEXT_BYTES {
            log.write(text.as_bytes())?;
            text.clear();
        }
        Ok(())
    })?;
    join.check()?;
    log.write(text.as_bytes())?;
    log.finish()?;
    Ok(ImportReport {
        bus,
        reference: reference.counts,
        offset: Offset {
            us: clocks.us + recorder_us,
            rate: clocks.rate,
            seen,
        },
        join,
        temperatures_left_out: has_temperatures
            && stage.temperature.columns.iter().all(Option::is_none),
    })
}

#[cfg(test)]
#[path = "import/tests.rs"]
mod tests;

#[cfg(test)]
#[path = "import/controller_tests.rs"]
mod controller_tests;

#[cfg(test)]
#[path = "import/hostile_tests.rs"]
mod hostile_tests;

#[cfg(test)]
#[path = "import/loss_tests.rs"]
mod loss_tests;
