//! `join`: a record of the sensors and a record of the reference, each with its own clock, become one calibration log.
//!
//! | step | module |
//! |---|---|
//! | lines of `candump -L` to ticks, by the receiver of the bus | `bus_reader`, [`bus_log`](crate::bus::bus_log) |
//! | the time of each tick's sample, by the clock of the node | `node_clock` |
//! | the sensors: a record of the bus, or a table | `sensors` |
//! | the reference: a table | [`reference`](mod@reference) |
//! | offset and difference in speed of the clocks, from the motion | [`offset`] |
//! | the reference at the times of the ticks | [`pairing`] |

mod bus_reader;
mod error;
mod node_clock;
pub mod offset;
pub mod pairing;
pub mod reference;
mod sensors;

pub use error::JoinError;

use crate::arguments::{StageFile, between, choice};
use crate::bus::BusAddress;
use crate::bus::bus_log::BusCounts;
use crate::output::{Output, packed};
use clap::Args;
use hallstage_input::finding::Finding;
use hallstage_input::log::BadRows;
use hallstage_input::log::cell::WHOLE_MAX;
use hallstage_input::log_format::LogFormat;
use hallstage_input::stage::Stage;
use hallstage_input::watch::Watch;
use node_clock::Tick;
use offset::{Offset, Records};
use pairing::{JoinCounts, join};
use reference::{Reference, ReferenceCounts};
use runtime::frame::MISSING_CODE;
use sensors::{Sensors, sensors_first};
use std::path::{Path, PathBuf};

/// The two records, and how they are joined.
#[derive(Clone, Debug, Args)]
pub(crate) struct JoinSettings {
    /// The record of the sensors: of the bus, as `record`, `live --record` or `candump` writes it, or a table with
    /// Hall probes and gaps. The other file is the reference.
    #[arg(value_name = "A")]
    pub(crate) a: PathBuf,
    /// The record of the reference: a table with time, movement and beams (or pose). Columns of tables are those that
    /// stage.toml names.
    #[arg(value_name = "B")]
    pub(crate) b: PathBuf,
    #[command(flatten)]
    pub(crate) stage: StageFile,
    /// Where to write the calibration log: CSV, or CSV.gz if the name ends so.
    #[arg(long, value_name = "LOG.csv")]
    pub(crate) out: PathBuf,
    /// Largest time from the sample of the reference before a row of the sensors to the sample after it, us; one and a
    /// half of the longer of both periods if not given.
    #[arg(long, value_name = "US", value_parser = clap::value_parser!(u32).range(1..=10_000_000))]
    pub(crate) tolerance_us: Option<u32>,
    /// Start of the search: time of the sensors less time of the reference, us.
    #[arg(long, value_name = "US", allow_negative_numbers = true, value_parser = microseconds)]
    pub(crate) offset_us: Option<f64>,
    /// How far from its start, or from a common start of both records, the offset is searched, s. Without it and
    /// without a start: wherever half of the shorter record has a partner.
    #[arg(long, value_name = "SECONDS", value_parser = search_seconds)]
    pub(crate) search_s: Option<f64>,
    /// Only frames of this interface, where a record of the bus holds several; can0@5 for the frames of node 5.
    #[arg(long, value_name = "IFACE")]
    pub(crate) interface: Option<BusAddress>,
    /// What to do with rows that cannot be used, and with lines of a record of the bus that cannot be read.
    #[arg(long, value_parser = choice::<BadRows>(), default_value = "refuse")]
    pub(crate) bad_rows: BadRows,
}

/// A time that is exact in `f64`.
fn microseconds(text: &str) -> Result<f64, String> {
    between(text, -WHOLE_MAX, WHOLE_MAX, "a number of microseconds")
}

/// For records further apart than an hour, `--offset-us` gives the start.
fn search_seconds(text: &str) -> Result<f64, String> {
    between(text, 0.0, 3600.0, "a number of seconds")
}

/// The result of a join.
#[derive(Clone, Debug, PartialEq)]
pub struct JoinReport {
    /// Frames and ticks of a record of the bus.
    pub bus: Option<BusCounts>,
    /// Warnings of a table of the sensors.
    pub warnings: Vec<Finding>,
    /// Rows of the reference.
    pub reference: ReferenceCounts,
    /// Offset between the clocks.
    pub offset: Offset,
    /// Rows of the log.
    pub join: JoinCounts,
    /// The record has temperatures, but the stage names no columns for them: the log has none.
    pub temperatures_left_out: bool,
}

#[cfg(test)]
impl JoinReport {
    fn bus(&self) -> &BusCounts {
        self.bus.as_ref().expect("a record of the bus")
    }
}

/// Most rows of a table: two hours at 1 kHz.
const ROWS_MAX: usize = 7_200_000;

/// A longer time between samples of the reference is a gap, in the longer of both periods.
const GAP_PERIODS: f64 = 1.5;

/// Bytes of the log that are written at a time, about.
const TEXT_BYTES: usize = 1 << 16;

/// Checks that one more row is not too many.
///
/// # Errors
/// `TooLong`.
fn check_length(path: &Path, rows: usize) -> Result<(), JoinError> {
    match rows < ROWS_MAX {
        true => Ok(()),
        false => Err(JoinError::TooLong {
            path: path.to_path_buf(),
            what: "rows",
            most: ROWS_MAX,
        }),
    }
}

/// Reads both records, joins them and writes the log.
///
/// # Errors
/// See [`JoinError`]; nothing is written then.
pub(crate) fn run(
    settings: &JoinSettings,
    stage: &Stage,
    watch: Watch<'static>,
) -> Result<JoinReport, JoinError> {
    let [sensors, reference] = sensors_first(&settings.a, &settings.b, stage)?;
    let sensors = Sensors::read(sensors, settings, stage, watch)?;
    let reference = Reference::read(reference, settings.bad_rows, stage, watch)?;
    reference.check_speed(stage)?;
    let records = Records::new(&sensors, &reference, stage);
    let (clocks, offset) = records.estimate(settings.offset_us, settings.search_s)?;

    let has_temperature = |tick: &Tick| tick.frame.codes.temperature_mc != [MISSING_CODE; 2];
    let has_temperatures = sensors.ticks.iter().any(has_temperature);
    let format = LogFormat::new(
        reference.quantities,
        sensors.vertical(),
        has_temperatures,
        stage,
    );
    let mut log = Output::create(&settings.out)?;
    let mut text = format.header();
    let period_us = sensors.period_us.max(reference.period_us);
    let tolerance_us = settings
        .tolerance_us
        .map_or(GAP_PERIODS * period_us, f64::from);
    let join = join(
        &sensors.ticks,
        &reference.samples,
        |t_us| clocks.on_reference_us(t_us),
        (tolerance_us, period_us),
        &mut |row| {
            format.append(&mut text, (row.movement, row.t_us), row.values, &row.frame);
            if text.len() > TEXT_BYTES {
                log.write(&packed(&settings.out, std::mem::take(&mut text))?)?;
            }
            Ok(())
        },
    )?;
    join.check()?;
    log.write(&packed(&settings.out, text)?)?;
    log.finish()?;
    Ok(JoinReport {
        bus: sensors.bus,
        warnings: sensors.warnings,
        reference: reference.counts,
        offset,
        join,
        temperatures_left_out: has_temperatures
            && stage.temperature.columns.iter().all(Option::is_none),
    })
}

#[cfg(test)]
#[path = "join/records_for_tests.rs"]
mod records_for_tests;

#[cfg(test)]
#[path = "join/offset_tests.rs"]
mod offset_tests;

#[cfg(test)]
#[path = "join/fault_tests.rs"]
mod fault_tests;

#[cfg(test)]
#[path = "join/table_tests.rs"]
mod table_tests;

#[cfg(test)]
#[path = "join/clock_tests.rs"]
mod clock_tests;

#[cfg(test)]
#[path = "join/hostile_tests.rs"]
mod hostile_tests;

#[cfg(test)]
#[path = "join/loss_tests.rs"]
mod loss_tests;
