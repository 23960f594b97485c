//! A record of the sensors: of the bus, or a table with the codes of the Hall probes and of the gaps.

use super::node_clock::Tick;
use super::{JoinError, JoinSettings, bus_reader, check_length};
use crate::bus::bus_log::BusCounts;
use hallstage_input::dataset::Row;
use hallstage_input::finding::{Finding, Kind};
use hallstage_input::log::header::Header;
use hallstage_input::log::layout::Quantity;
use hallstage_input::log::table::Table;
use hallstage_input::log::{LogError, LogRows, Place, ReadOptions};
use hallstage_input::other_format;
use hallstage_input::source::SourceProblem;
use hallstage_input::stage::Stage;
use hallstage_input::text::TextReader;
use hallstage_input::watch::Watch;
use std::path::Path;

/// A record of the sensors with its own clock.
pub(super) struct Sensors {
    /// In ascending order of time.
    pub(super) ticks: Vec<Tick>,
    /// When the record starts, us.
    pub(super) start_us: f64,
    /// Time of the recorder less time of the ticks, us.
    pub(super) recorder_us: f64,
    /// The usual time from tick to tick, us.
    pub(super) period_us: f64,
    /// Contents of a record of the bus.
    pub(super) bus: Option<BusCounts>,
    /// Warnings of a table.
    pub(super) warnings: Vec<Finding>,
}

impl Sensors {
    /// Reads a record.
    ///
    /// # Errors
    /// Errors of a log and of a record of the bus; `TimeRestarts`, `TooLong`, `NoInterface`.
    pub(super) fn read(
        path: &Path,
        settings: &JoinSettings,
        stage: &Stage,
        watch: Watch<'static>,
    ) -> Result<Self, JoinError> {
        let text = TextReader::open(path).map_err(LogError::from)?;
        if !is_bus(&text) {
            return Self::of_table(text, settings, stage, watch);
        }
        let (run, bus) = bus_reader::read(text, settings, stage, watch)?;
        Ok(Self {
            start_us: -run.since_start_us,
            recorder_us: run.recorder_less_node_us(),
            ticks: run.ticks,
            period_us: stage.servo_period_s * 1e6,
            bus: Some(bus),
            warnings: Vec::new(),
        })
    }

    fn of_table(
        text: TextReader<'_>,
        settings: &JoinSettings,
        stage: &Stage,
        watch: Watch<'static>,
    ) -> Result<Self, JoinError> {
        let options = ReadOptions {
            bad_rows: settings.bad_rows,
            watch,
            ..ReadOptions::SENSORS
        };
        let path = text.path().to_path_buf();
        if settings.interface.is_some() {
            return Err(JoinError::NoInterface { path });
        }
        let mut rows = LogRows::new(text, "reading the sensors", stage, &options)?;
        let mut ticks: Vec<Tick> = Vec::new();
        while let Some(found) = rows.next_row()? {
            let Row { t_us, frame, .. } = found.row;
            let tick = Tick {
                t_us: t_us as f64,
                frame,
            };
            if ticks.last().is_some_and(|before| tick.t_us <= before.t_us) {
                return Err(JoinError::TimeRestarts {
                    path,
                    movement: found.movement,
                });
            }
            check_length(&path, ticks.len())?;
            ticks.push(tick);
        }
        let period_us = rows.period_us();
        let mut warnings = rows.end()?.warnings;
        // The reference has the movements.
        warnings.retain(|found| !matches!(found.kind, Kind::MovementsByTime { .. }));
        Ok(Self {
            start_us: ticks.first().map_or(0.0, |tick| tick.t_us),
            recorder_us: 0.0,
            ticks,
            period_us,
            bus: None,
            warnings,
        })
    }

    /// The quantities of the vertical motion in a log of these ticks.
    pub(super) fn vertical(&self) -> [Quantity; 3] {
        match self.ticks.first().map(|tick| tick.frame.vertical) {
            Some(Some(_)) => Quantity::VERTICAL,
            _ => Quantity::GAPS,
        }
    }
}

/// The file with the sensors, and the file with the reference. Standard input is the partner of
/// the other file.
///
/// # Errors
/// `Roles`, and errors of opening.
pub(super) fn sensors_first<'p>(
    a: &'p Path,
    b: &'p Path,
    stage: &Stage,
) -> Result<[&'p Path; 2], JoinError> {
    match [has_sensors(a, stage)?, has_sensors(b, stage)?] {
        [Some(true), Some(false) | None] | [None, Some(false)] => Ok([a, b]),
        [Some(false) | None, Some(true)] | [Some(false), None] => Ok([b, a]),
        [one, _] => Err(JoinError::Roles {
            a: a.to_path_buf(),
            b: b.to_path_buf(),
            both: one == Some(true),
        }),
    }
}

/// Whether a file has sensors; `None` for standard input, which can be read only once.
fn has_sensors(path: &Path, stage: &Stage) -> Result<Option<bool>, JoinError> {
    if path == Path::new("-") {
        return Ok(None);
    }
    let text = TextReader::open(path).map_err(LogError::from)?;
    if is_bus(&text) {
        return Ok(Some(true));
    }
    let other = other_format::in_text(text.opening());
    let table = Table::open(text, |name| stage.log.knows(name))?;
    let header = Header::new(&table.head, &stage.log)?;
    let has_sensors = header.find(Quantity::HallA).is_some();
    match other.filter(|_| !has_sensors && header.one_of(&Quantity::REFERENCES).is_err()) {
        Some(looks_like) => {
            let problem = SourceProblem::OtherFormat { looks_like };
            Err(Place::new(path, None).refuse(problem.into()).into())
        }
        None => Ok(Some(has_sensors)),
    }
}

/// Whether a text is a record of candump.
fn is_bus(text: &TextReader<'_>) -> bool {
    text.opening().first() == Some(&b'(')
}
