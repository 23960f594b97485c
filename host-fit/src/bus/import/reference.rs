//! The log of the interferometers.

use super::ImportError;
use super::input::{Input, TextReader};
use crate::input::log::LogError;
use crate::input::log::cell::{self, CellFault};
use crate::input::log::header::{Header, Source, UnknownColumns};
use crate::input::log::layout::{Kind, Quantity};
use crate::input::log::rows::{ROTATION_MAX_RAD, displacement_max_m};
use crate::input::log::table::{BYTE_ORDER_MARK, Table};
use crate::input::log::time::Clock;
use crate::input::source;
use crate::input::stage::Stage;
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

/// Movements that a log may have: a day of them, half a second each.
const MOVEMENTS_MAX: usize = 200_000;

/// A log of the reference that is read as often as it is needed.
pub(super) struct ReferenceInput<'s> {
    path: &'s Path,
    input: Input,
    stage: &'s Stage,
}

impl<'s> ReferenceInput<'s> {
    /// `again` as for [`Input::new`].
    ///
    /// # Errors
    /// `Reference`.
    pub(super) fn new(path: &'s Path, again: bool, stage: &'s Stage) -> Result<Self, ImportError> {
        let input = Input::new(path, again).map_err(LogError::from)?;
        let path = source::shown_name(path);
        Ok(Self { path, input, stage })
    }

    /// Reads from the start, with a bar that says `what` is done; columns that the layout does not
    /// know are left out.
    ///
    /// # Errors
    /// `Reference`.
    pub(super) fn reader(&self, what: &'static str) -> Result<ReferenceReader<'_>, ImportError> {
        let text = self.input.open(what).map_err(LogError::from)?;
        ReferenceReader::open(text, self.path, self.stage)
    }
}

/// Bytes of a block of rows, about: a thousand rows and more; a few in tests.
const BLOCK_BYTES: usize = if cfg!(test) { 1 << 9 } else { 1 << 17 };

/// Bytes in which the header and the first rows are found.
const START_BYTES: usize = if cfg!(test) { 1 << 10 } else { 1 << 20 };

/// A log of the reference, read sample by sample, a block of rows at a time.
pub(super) struct ReferenceReader<'s> {
    path: &'s Path,
    stage: &'s Stage,
    text: TextReader,
    /// All above the first row, which stands above every block.
    header: Vec<u8>,
    decimal_commas: bool,
    /// Line breaks before the block in hand.
    lines: usize,
    cells: Cells,
    /// What the three values are.
    pub(super) quantities: [Quantity; 3],
    clock: Clock,
    period_us: f64,
    shift_us: f64,
    before: Option<Sample>,
    /// The line at which each movement was left.
    left: HashMap<i64, usize>,
    ready: VecDeque<Sample>,
    counts: ReferenceCounts,
}

/// A sample as it stands, and where its row starts in the block.
type Row = (Sample, u64);

impl<'s> ReferenceReader<'s> {
    fn open(mut text: TextReader, path: &'s Path, stage: &'s Stage) -> Result<Self, ImportError> {
        let mut start = Vec::new();
        text.block(&mut start, START_BYTES)?;
        if start.starts_with(BYTE_ORDER_MARK) {
            start.drain(..BYTE_ORDER_MARK.len());
        }
        let mut table = Table::open(path, &start, |name| stage.log.knows(name))?;
        let (quantities, cells) = Cells::find(&table, stage)?;
        let mut clock = Clock::default();
        let rows = cells.rows(&mut table, &mut clock)?;
        let header_bytes = rows.first().map_or(start.len(), |(_, byte)| *byte as usize);
        let mut header = start.get(..header_bytes).unwrap_or_default().to_vec();
        if !header.ends_with(b"\n") && !header.ends_with(b"\r") {
            header.push(b'\n');
        }
        let mut reader = Self {
            path,
            stage,
            text,
            header,
            decimal_commas: table.has_decimal_commas(),
            lines: 0,
            counts: ReferenceCounts {
                has_movements: cells.movement.is_some(),
                ..ReferenceCounts::default()
            },
            cells,
            quantities,
            clock,
            period_us: period_us(&rows),
            shift_us: 0.0,
            before: None,
            left: HashMap::new(),
            ready: VecDeque::new(),
        };
        reader.in_order(&table, &rows, 0)?;
        reader.lines = line_breaks(&start);
        Ok(reader)
    }

    /// The next sample, later than the one before; `None` at the end. Movements that start their
    /// time anew are put one period after the last, and repeated times are left out.
    ///
    /// # Errors
    /// `Reference` for cells, time that runs backwards and movements that return; `NoReference`;
    /// `TooManyMovements`.
    pub(super) fn next_sample(&mut self) -> Result<Option<Sample>, ImportError> {
        while self.ready.is_empty() {
            if !self.next_block()? {
                return match self.counts.rows - self.counts.duplicates {
                    0 | 1 => Err(ImportError::NoReference {
                        path: self.path.to_path_buf(),
                    }),
                    _ => Ok(None),
                };
            }
        }
        Ok(self.ready.pop_front())
    }

    /// What the log held as far as it was read.
    pub(super) const fn counts(&self) -> ReferenceCounts {
        self.counts
    }

    /// Reads a block of rows; `false` at the end.
    fn next_block(&mut self) -> Result<bool, ImportError> {
        let mut block = self.header.clone();
        if !self
            .text
            .block(&mut block, self.header.len() + BLOCK_BYTES)?
        {
            return Ok(false);
        }
        let above = self.lines - line_breaks(&self.header);
        self.lines = above + line_breaks(&block);
        self.take_block(&block, above)
            .map_err(|error| match error {
                ImportError::Reference(error) => error.below(above).into(),
                ImportError::TooManyMovements { mut place, most } => {
                    place.line += above;
                    ImportError::TooManyMovements { place, most }
                }
                error => error,
            })?;
        Ok(true)
    }

    fn take_block(&mut self, block: &[u8], above: usize) -> Result<(), ImportError> {
        let mut table = Table::open(self.path, block, |name| self.stage.log.knows(name))?;
        table.set_decimal_commas(self.decimal_commas);
        let rows = self.cells.rows(&mut table, &mut self.clock)?;
        self.in_order(&table, &rows, above)
    }

    /// Takes rows of a block that stands so many lines below its place in `table`.
    fn in_order(
        &mut self,
        table: &Table<'_>,
        rows: &[Row],
        above: usize,
    ) -> Result<(), ImportError> {
        for (sample, byte) in rows {
            let mut sample = *sample;
            self.counts.rows += 1;
            sample.t_us += self.shift_us;
            let place = |cell| table.place(*byte, cell, Some(sample.movement));
            if let Some(before) = self.before {
                let begins = sample.movement != before.movement;
                if begins {
                    let cell = self.cells.movement.unwrap_or_default();
                    if let Some(&left_line) = self.left.get(&sample.movement) {
                        let place = place(cell);
                        return Err(LogError::MovementReturns { place, left_line }.into());
                    }
                    if self.left.len() == MOVEMENTS_MAX {
                        return Err(ImportError::TooManyMovements {
                            place: place(cell),
                            most: MOVEMENTS_MAX,
                        });
                    }
                    self.left.insert(before.movement, above + table.line(*byte));
                }
                if begins && sample.t_us <= before.t_us {
                    let anew_us = before.t_us + self.period_us - sample.t_us;
                    self.shift_us += anew_us;
                    sample.t_us += anew_us;
                    self.counts.restarts += 1;
                }
                if sample.t_us == before.t_us {
                    self.counts.duplicates += 1;
                    continue;
                }
                let cell = self.cells.time.cell;
                if sample.t_us < before.t_us {
                    return Err(LogError::TimeBackwards {
                        place: place(cell),
                        before_us: before.t_us.round() as i64,
                        t_us: sample.t_us.round() as i64,
                    }
                    .into());
                }
                // A time that grew by those of the movements before must still be one.
                if sample.t_us > cell::WHOLE_MAX {
                    let fault = CellFault::Absurd {
                        value: sample.t_us,
                        limit: cell::WHOLE_MAX,
                        unit: "us",
                    };
                    let place = place(cell);
                    return Err(LogError::Cell { place, fault }.into());
                }
                if !begins && sample.t_us - before.t_us > 1.5 * self.period_us {
                    self.counts.gaps += 1;
                }
            }
            self.before = Some(sample);
            self.ready.push_back(sample);
        }
        Ok(())
    }
}

/// Line breaks in a text; a lone carriage return is one too.
fn line_breaks(text: &[u8]) -> usize {
    let is_break = |(k, byte): (usize, &u8)| match *byte {
        b'\n' => true,
        b'\r' => text.get(k + 1) != Some(&b'\n'),
        _ => false,
    };
    text.iter().enumerate().filter(|at| is_break(*at)).count()
}

/// Keeps the samples within these times, which ascend, `spacing_us` apart or more.
///
/// # Errors
/// Those of [`ReferenceReader::next_sample`].
pub(super) fn collect(
    reader: &mut ReferenceReader<'_>,
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
fn period_us(rows: &[Row]) -> f64 {
    let step = |pair: &[Row]| match pair {
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
        let header = Header::new(table, &stage.log, UnknownColumns::LeaveOut)?;
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

    /// The samples of all rows of a table, and where each row starts.
    fn rows(&self, table: &mut Table<'_>, clock: &mut Clock) -> Result<Vec<Row>, LogError> {
        let mut rows = Vec::new();
        while table.next_row()? {
            rows.push((self.sample(table, clock)?, table.row_byte()));
        }
        Ok(rows)
    }

    /// The sample in the row in hand.
    fn sample(&self, table: &Table<'_>, clock: &mut Clock) -> Result<Sample, LogError> {
        let bad = |cell, movement, fault: CellFault| LogError::Cell {
            place: table.place(table.row_byte(), cell, movement),
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
