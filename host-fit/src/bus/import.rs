//! `import`: a record of the bus and a log of the interferometers, each with its own clock,
//! become one calibration log.
//!
//! | step | module |
//! |---|---|
//! | lines of text, from a file as often as needed | `input` |
//! | lines of `candump -L` to ticks, by the receiver of the bus | `bus_reader`, [`bus_log`] |
//! | numbers of the ticks by the node's own count, so that no lost tick shifts the others | `numbering` |
//! | receive times to sample times: the node samples evenly, the bus delivers unevenly | [`clock`] |
//! | the interferometers' CSV | [`reference`](mod@reference) |
//! | offset between the clocks and difference in speed, found or checked by the motion | `survey`, [`offset`], `explained`, `refine`, `agreement` |
//! | reference between its samples, at the times of the ticks | [`join`] |
//! | the log | [`write`](mod@write) |

mod agreement;
pub mod bus_log;
mod bus_reader;
pub mod clock;
mod error;
mod explained;
mod input;
pub mod join;
mod numbering;
pub mod offset;
pub mod reference;
mod refine;
mod survey;
pub mod write;

pub use error::ImportError;

use crate::input::stage::Stage;
use crate::output::streamed_file::StreamedFile;
use bus_log::BusCounts;
use bus_reader::BusReader;
use clock::{EvenTicks, Smoothing};
use hal_adapters::can::Layout;
use input::Input;
use join::{Join, JoinCounts};
use offset::{Offset, Seen};
use reference::{ReferenceCounts, ReferenceInput};
use std::path::PathBuf;
use survey::Survey;
use write::LogFormat;

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

/// Reads both records, joins them and writes the log. Each is read from its start as often as
/// it is needed and never held as a whole; a pipe is copied to a temporary file for that.
///
/// # Errors
/// See [`ImportError`]; nothing is written then.
pub fn run(settings: &ImportSettings) -> Result<ImportReport, ImportError> {
    let stage = Stage::from_file(&settings.stage)?;
    let bus = Input::new(&settings.bus, settings.estimate_offset)?;
    let reference = ReferenceInput::new(&settings.reference, true, &stage)?;
    let offset = match settings.estimate_offset {
        true => estimate(settings, &stage, &bus, &reference)?,
        false => Offset {
            us: settings.offset_us,
            rate: 0.0,
            middle_us: 0.0,
            seen: Seen::default(),
        },
    };
    write(settings, &stage, &bus, &reference, offset)
}

fn estimate(
    settings: &ImportSettings,
    stage: &Stage,
    bus: &Input,
    reference: &ReferenceInput<'_>,
) -> Result<Offset, ImportError> {
    let mut ticks = EvenTicks::new(BusReader::open(bus, "clocks", settings, stage)?);
    let mut survey = Survey::default();
    while let Some(timed) = ticks.next_tick()? {
        survey.take(&timed);
    }
    survey.end();
    ticks.finish(settings, stage)?;
    let search_us = settings.search_s * 1e6;
    offset::estimate(&survey, reference, stage, search_us)
}

/// Bytes of the log that are written at a time, about.
const TEXT_BYTES: usize = 1 << 16;

/// Joins the two and writes the log.
fn write(
    settings: &ImportSettings,
    stage: &Stage,
    bus: &Input,
    input: &ReferenceInput<'_>,
    mut offset: Offset,
) -> Result<ImportReport, ImportError> {
    let mut ticks = EvenTicks::new(BusReader::open(bus, "importing", settings, stage)?);
    let tolerance_us = settings
        .tolerance_us
        .map_or(stage.servo_period_s * 1e6, f64::from);
    let reference = input.reader()?;
    let format = LogFormat::new(reference.quantities, stage);
    let mut join = Join::new(reference, tolerance_us)?;
    let mut log = StreamedFile::create(&settings.out)?;
    let mut text = format.header();
    let mut survey = Survey::default();
    while let Some((tick, t_us)) = ticks.next_tick()? {
        survey.take(&(tick, t_us));
        let period_us = ticks.smoothing().period_us;
        if let Some(row) = join.take(&tick, offset.on_reference_us(t_us), period_us)? {
            format.append(&row, &mut text);
            if text.len() > TEXT_BYTES {
                log.write(text.as_bytes())?;
                text.clear();
            }
        }
    }
    let (bus, smoothing) = ticks.finish(settings, stage)?;
    let (join, reference) = join.finish()?;
    join.check()?;
    if !settings.estimate_offset {
        survey.end();
        offset = offset::checked(&survey, input, stage, offset)?;
    }
    log.write(text.as_bytes())?;
    log.finish()?;
    Ok(ImportReport {
        bus,
        smoothing,
        reference,
        offset,
        join,
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
