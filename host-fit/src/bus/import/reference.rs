//! The log of the interferometers.

use super::ImportError;
use super::input::Input;
use crate::input::log::LogError;
use crate::input::log::cell::{self, CellFault};
use crate::input::log::header::{Header, Source, UnknownColumns};
use crate::input::log::layout::{Kind, Quantity};
use crate::input::log::rows::{ROTATION_MAX_RAD, displacement_max_m};
use crate::input::log::table::Table;
use crate::input::log::time::Clock;
use crate::input::stage::Stage;
use crate::input::text::TextReader;
use std::collections::{HashMap, VecDeque};
use std::path::Path;

/// One sample of the reference.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// Its time, us.
    pub t_us: f64,
    /// Number of the movement.
    pub movement: i64,
    /// Three beams, or X, Y, Rz, in the units of the log's columns.
    pub values: [f64; 3],
}

/// What a log of the reference held.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ReferenceCounts {
    /// Rows.
    pub rows: usize,
    /// Rows that were left out: the time of the row before again.
    pub duplicates: usize,
    /// Places where more than one and a half of the usual time passes between rows of a
    /// movement.
    pub gaps: usize,
    /// Movements that started their time anew; each was put one period after the last.
    pub restarts: usize,
    /// Whether there is a column for the movement; without one everything is movement 0.
    pub has_movements: bool,
}

/// Which cells hold what.
struct Cells {
    time: Source,
    movement: Option<usize>,
    values: [Value; 3],
}

/// A cell of a displacement or rotation.
struct Value {
    source: Source,
    /// Units of the log's column per unit of this one.
    log_units: f64,
    /// Largest sensible magnitude, m or rad.
    limit: f64,
    unit: &'static str,
}

/// Rows by which the time from row to row is told: the first ones.
const PERIOD_ROWS: usize = 10_000;

/// Movements that a log may have: a day of them, half a second each.
const MOVEMENTS_MAX: usize = 200_000;

/// A log of the reference that is read as often as it is needed.
pub(super) struct ReferenceInput<'s> {
    input: Input,
    stage: &'s Stage,
}

impl<'s> ReferenceInput<'s> {
    /// `again` as for [`Input::new`].
    ///
    /// # Errors
    /// `Reference`.
    pub(super) fn new(path: &Path, again: bool, stage: &'s Stage) -> Result<Self, ImportError> {
        let input = Input::new(path, again).map_err(LogError::from)?;
        Ok(Self { input, stage })
    }

    /// Reads from the start; columns that the layout does not know are left out.
    ///
    /// # Errors
    /// `Reference`.
    pub(super) fn reader(&self) -> Result<ReferenceReader, ImportError> {
        let text = self.input.open().map_err(LogError::from)?;
        ReferenceReader::open(text, self.stage)
    }
}

/// A log of the reference, read sample by sample.
pub(super) struct ReferenceReader {
    table: Table<'static>,
    cells: Cells,
    /// What the three values are.
    pub(super) quantities: [Quantity; 3],
    clock: Clock,
    /// Rows that were read to tell the period, and their lines.
    ahead: VecDeque<(Sample, usize)>,
    period_us: f64,
    shift_us: f64,
    before: Option<Sample>,
    /// The line at which each movement was left.
    left: HashMap<i64, usize>,
    counts: ReferenceCounts,
}

impl ReferenceReader {
    fn open(text: TextReader<'static>, stage: &Stage) -> Result<Self, ImportError> {
        let table = Table::open(text, |name| stage.log.knows(name))?;
        let (quantities, cells) = Cells::find(&table, stage)?;
        let mut reader = Self {
            counts: ReferenceCounts {
                has_movements: cells.movement.is_some(),
                ..ReferenceCounts::default()
            },
            table,
            cells,
            quantities,
            clock: Clock::default(),
            ahead: VecDeque::new(),
            period_us: 0.0,
            shift_us: 0.0,
            before: None,
            left: HashMap::new(),
        };
        while reader.ahead.len() < PERIOD_ROWS
            && let Some(row) = reader.row()?
        {
            reader.ahead.push_back(row);
        }
        reader.period_us = period_us(reader.ahead.make_contiguous());
        Ok(reader)
    }

    /// The next sample, later than the one before; `None` at the end. Movements that start their
    /// time anew are put one period after the last, and repeated times are left out.
    ///
    /// # Errors
    /// `Reference` for cells, time that runs backwards and movements that return; `NoReference`;
    /// `TooManyMovements`.
    pub(super) fn next_sample(&mut self) -> Result<Option<Sample>, ImportError> {
        loop {
            let row = match self.ahead.pop_front() {
                Some(row) => Some(row),
                None => self.row()?,
            };
            let Some((mut sample, line)) = row else {
                return match self.counts.rows - self.counts.duplicates {
                    0 | 1 => Err(ImportError::NoReference {
                        path: self.table.head.path.clone(),
                    }),
                    _ => Ok(None),
                };
            };
            self.counts.rows += 1;
            sample.t_us += self.shift_us;
            if let Some(before) = self.before {
                let begins = sample.movement != before.movement;
                if begins {
                    self.begin(&before, &sample, line)?;
                }
                if begins && sample.t_us <= before.t_us {
                    let anew_us = before.t_us + self.period_us - sample.t_us;
                    self.shift_us += anew_us;
                    sample.t_us += anew_us;
                    self.counts.restarts += 1;
                    self.check_time(&sample, line)?;
                }
                if sample.t_us == before.t_us {
                    self.counts.duplicates += 1;
                    continue;
                }
                if sample.t_us < before.t_us {
                    return Err(self.backwards(&before, &sample, line).into());
                }
                if !begins && sample.t_us - before.t_us > 1.5 * self.period_us {
                    self.counts.gaps += 1;
                }
            }
            self.before = Some(sample);
            return Ok(Some(sample));
        }
    }

    /// What the log held as far as it was read.
    pub(super) const fn counts(&self) -> ReferenceCounts {
        self.counts
    }

    /// The next row as it stands, and its line.
    fn row(&mut self) -> Result<Option<(Sample, usize)>, LogError> {
        if !self.table.next_row()? {
            return Ok(None);
        }
        let sample = self.cells.sample(&self.table, &mut self.clock)?;
        Ok(Some((sample, self.table.row_line())))
    }

    /// Another movement begins in this line; it must be new.
    fn begin(&mut self, before: &Sample, sample: &Sample, line: usize) -> Result<(), ImportError> {
        let place = || {
            let cell = self.cells.movement.unwrap_or_default();
            self.table.head.place(line, cell, Some(sample.movement))
        };
        if let Some(left) = self.left.get(&sample.movement) {
            let left_line = *left;
            let place = place();
            return Err(LogError::MovementReturns { place, left_line }.into());
        }
        if self.left.len() == MOVEMENTS_MAX {
            return Err(ImportError::TooManyMovements {
                place: place(),
                most: MOVEMENTS_MAX,
            });
        }
        self.left.insert(before.movement, line);
        Ok(())
    }

    /// A time that grew by those of the movements before must still be one.
    fn check_time(&self, sample: &Sample, line: usize) -> Result<(), LogError> {
        if sample.t_us <= cell::WHOLE_MAX {
            return Ok(());
        }
        let cell = self.cells.time.cell;
        Err(LogError::Cell {
            place: self.table.head.place(line, cell, Some(sample.movement)),
            fault: CellFault::Absurd {
                value: sample.t_us,
                limit: cell::WHOLE_MAX,
                unit: "us",
            },
        })
    }

    fn backwards(&self, before: &Sample, sample: &Sample, line: usize) -> LogError {
        let cell = self.cells.time.cell;
        LogError::TimeBackwards {
            place: self.table.head.place(line, cell, Some(sample.movement)),
            before_us: before.t_us.round() as i64,
            t_us: sample.t_us.round() as i64,
        }
    }
}

/// Keeps the samples within these times, which ascend, `spacing_us` apart or more.
///
/// # Errors
/// Those of [`ReferenceReader::next_sample`].
pub(super) fn collect(
    reader: &mut ReferenceReader,
    windows: &[[f64; 2]],
    spacing_us: f64,
) -> Result<Vec<Sample>, ImportError> {
    let mut kept: Vec<Sample> = Vec::new();
    let mut windows = windows.iter().peekable();
    while let Some(sample) = reader.next_sample()? {
        while windows.next_if(|[_, end]| *end < sample.t_us).is_some() {}
        let Some([start, _]) = windows.peek() else {
            break;
        };
        let is_apart = |last: &Sample| sample.t_us - last.t_us >= spacing_us;
        if *start <= sample.t_us && kept.last().is_none_or(is_apart) {
            kept.push(sample);
        }
    }
    Ok(kept)
}

/// The usual time from row to row, us; 0 if no movement has two.
fn period_us(rows: &[(Sample, usize)]) -> f64 {
    let step = |pair: &[(Sample, usize)]| match pair {
        [(a, _), (b, _)] if a.movement == b.movement && b.t_us > a.t_us => Some(b.t_us - a.t_us),
        _ => None,
    };
    let mut steps: Vec<f64> = rows.windows(2).filter_map(step).collect();
    let middle = steps.len() / 2;
    match steps.is_empty() {
        true => 0.0,
        false => *steps.select_nth_unstable_by(middle, f64::total_cmp).1,
    }
}

impl Cells {
    /// The beams, or X, Y, Rz where the log has those.
    fn find(table: &Table<'_>, stage: &Stage) -> Result<([Quantity; 3], Self), LogError> {
        let header = Header::new(&table.head, &stage.log, UnknownColumns::LeaveOut)?;
        let [time] = header.all([Quantity::Time])?;
        let quantities = match header.one_set(Quantity::BEAMS, Quantity::PLANAR)? {
            Some(Quantity::X | Quantity::Y | Quantity::Rz) => Quantity::PLANAR,
            _ => Quantity::BEAMS,
        };
        let [a, b, c] = header.all(quantities)?;
        let value = |quantity: Quantity, source: Source| {
            let (limit, unit) = match quantity.kind() {
                Kind::Angle => (ROTATION_MAX_RAD, "rad"),
                _ => (displacement_max_m(stage), "m"),
            };
            Value {
                source,
                log_units: source.scale / stage.log.column(quantity).scale,
                limit,
                unit,
            }
        };
        let [p, q, r] = quantities;
        let cells = Self {
            time,
            movement: header.find(Quantity::Movement).map(|source| source.cell),
            values: [value(p, a), value(q, b), value(r, c)],
        };
        Ok((quantities, cells))
    }

    /// The sample in the row in hand.
    fn sample(&self, table: &Table<'_>, clock: &mut Clock) -> Result<Sample, LogError> {
        let bad = |cell, movement, fault: CellFault| LogError::Cell {
            place: table.head.place(table.row_line(), cell, movement),
            fault,
        };
        let movement = self.movement.map_or(Ok(0), |at| {
            cell::whole(table.cell(at), "movement numbers").map_err(|fault| bad(at, None, fault))
        })?;
        let number = |value: &Value| {
            let (at, scale) = (value.source.cell, value.source.scale);
            let text = table.cell(at);
            cell::scaled(text, scale, value.limit, value.unit)
                .and_then(|_| Ok(cell::number(text)? * value.log_units))
                .map_err(|fault| bad(at, Some(movement), fault))
        };
        let [a, b, c] = &self.values;
        Ok(Sample {
            t_us: clock
                .t_us(table.cell(self.time.cell), self.time.scale)
                .map_err(|fault| bad(self.time.cell, Some(movement), fault))?,
            movement,
            values: [number(a)?, number(b)?, number(c)?],
        })
    }
}
