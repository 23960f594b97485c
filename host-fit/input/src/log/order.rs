//! The order of the rows of a log: movement after movement, time forwards; and their sequence numbers
//! by time, so that a gap shows as frames missed.
//!
//! In a log that has no column for them, a movement ends where the time starts again, and where rows are
//! missing for more than ten of the log's own periods (its median step).

use super::error::{LogError, LogProblem, Place};
use super::header::Source;
use super::table::Head;
use std::collections::HashMap;

/// Most movements of a log: more than a week of the shortest movements, in little memory.
pub(super) const MOVEMENTS_MAX: usize = 1 << 19;

/// Longest gap within a movement, in periods of the log: a busy computer loses fewer rows, and the reset of an
/// interferometer takes longer.
pub(super) const GAP_PERIODS: f64 = 10.0;

/// Fewest rows before the time may start again; after fewer rows the log is out of order.
const ROWS_MIN: usize = 10;

/// Bits of the counters of clocks.
const COUNTER_BITS: [i32; 3] = [16, 24, 32];

/// The cells with the time and the movement.
#[derive(Clone, Copy, Debug)]
pub struct OrderCells {
    /// The time.
    pub time: Source,
    /// The movement, if there is a column for it.
    pub movement: Option<usize>,
}

/// The place of a kept row in its movement.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct KeptRow {
    /// Number of its movement.
    pub movement: i64,
    /// Whether a movement begins with it.
    pub begins: bool,
    /// 0 at the start of each movement, then by the time since the row kept before, in periods, at
    /// least 1 more.
    pub sequence: u32,
}

/// Follows the rows of one log.
#[derive(Debug)]
pub struct Order {
    cells: OrderCells,
    /// The median time between rows, us.
    pub period_us: f64,
    /// Movement, if there is a column for it, and time of the row in hand.
    current: Option<(Option<i64>, f64)>,
    /// The line after the end of each movement.
    left: HashMap<i64, usize>,
    /// Time of the first row, kept or not, since the time last started, and the number of rows since then.
    started: (f64, usize),
    /// Whether a movement begins with the next row that is kept.
    begins: bool,
    kept: Kept,
    /// Movements so far.
    pub(super) movements: usize,
    /// The first movement with a single row, and the number of such movements.
    single: Option<(i64, usize)>,
}

/// The rows of a movement that were kept.
#[derive(Debug, Default)]
struct Kept {
    movement: i64,
    rows: usize,
    last_us: f64,
    /// Of the last row.
    sequence: u32,
}

impl Order {
    /// For a log with this period, us.
    pub fn new(cells: OrderCells, period_us: f64) -> Self {
        Self {
            cells,
            period_us,
            current: None,
            left: HashMap::new(),
            started: (0.0, 0),
            begins: true,
            kept: Kept::default(),
            movements: 0,
            single: None,
        }
    }

    /// Takes the next row, in this line, in hand: its movement, if the log has a column for it, and its
    /// time, us.
    ///
    /// # Errors
    /// `TimeBackwards`, `ClockWraps`, `ClockRestarts`, `DuplicatedRow`, `MovementReturns`, `TooManyMovements`.
    pub fn take(
        &mut self,
        head: &Head,
        line: usize,
        named: Option<i64>,
        t_us: f64,
    ) -> Result<(), LogError> {
        let refuse = |cell, problem| Err(head.place(line, cell, named).refuse(problem));
        let (first_us, rows) = self.started;
        let restarts = named.is_none() && rows >= ROWS_MIN && t_us <= first_us;
        match self.current {
            Some((current, before_us)) if current == named && !restarts => {
                let time = self.cells.time.cell;
                if t_us < before_us {
                    let bits = self.counter_bits(before_us - t_us);
                    let is_start = rows >= ROWS_MIN && (0.0..=first_us).contains(&t_us);
                    let (before_us, t_us) = (before_us.round() as i64, t_us.round() as i64);
                    return refuse(
                        time,
                        match bits {
                            Some(bits) => LogProblem::ClockWraps { bits },
                            None if is_start => LogProblem::ClockRestarts { before_us, t_us },
                            None => LogProblem::TimeBackwards { before_us, t_us },
                        },
                    );
                }
                if t_us == before_us {
                    let t_us = t_us.round() as i64;
                    return refuse(time, LogProblem::DuplicatedRow { t_us });
                }
                let is_gap = t_us - before_us > GAP_PERIODS * self.period_us;
                self.begins |= named.is_none() && is_gap;
                self.started.1 += 1;
            }
            current => {
                let left = current.and_then(|(movement, _)| movement);
                self.left.extend(left.map(|movement| (movement, line)));
                if let Some(&left_line) = named.and_then(|named| self.left.get(&named)) {
                    let cell = self.cells.movement.unwrap_or_default();
                    return refuse(cell, LogProblem::MovementReturns { left_line });
                }
                if self.left.len() >= MOVEMENTS_MAX {
                    let limit = MOVEMENTS_MAX;
                    let problem = LogProblem::TooManyMovements { limit };
                    return Err(Place::new(&head.path, line).refuse(problem));
                }
                self.started = (t_us, 1);
                self.begins = true;
            }
        }
        self.current = Some((named, t_us));
        Ok(())
    }

    /// The header stands again above the next row: its time may start again, too.
    pub fn begin_anew(&mut self) {
        if let Some((_, before_us)) = self.current {
            self.started = (before_us, ROWS_MIN);
        }
    }

    /// The bits of a counter that is full at this step back in time.
    fn counter_bits(&self, fall_us: f64) -> Option<i32> {
        let off = |bits: &i32| (fall_us - 2f64.powi(*bits) * self.cells.time.scale).abs();
        let mut bits = COUNTER_BITS.into_iter();
        bits.find(|bits| off(bits) <= 2.0 * self.period_us)
    }

    /// Keeps the row in hand.
    pub fn keep(&mut self) -> KeptRow {
        let (named, t_us) = self.current.unwrap_or_default();
        let begins = std::mem::take(&mut self.begins);
        if begins {
            self.end_movement();
            self.kept = Kept {
                movement: named.unwrap_or(self.movements as i64),
                ..Kept::default()
            };
            self.movements += 1;
        } else {
            let periods = ((t_us - self.kept.last_us) / self.period_us).round();
            // Within half the range of u32, which the servo counts as ahead.
            let periods = periods.clamp(1.0, f64::from(i32::MAX)) as u32;
            self.kept.sequence = self.kept.sequence.wrapping_add(periods);
        }
        self.kept.last_us = t_us;
        self.kept.rows += 1;
        KeptRow {
            movement: self.kept.movement,
            begins,
            sequence: self.kept.sequence,
        }
    }

    /// Ends the last movement. Returns the first movement with a single row, and the number of such movements.
    pub(super) fn end_movement(&mut self) -> Option<(i64, usize)> {
        if self.kept.rows == 1 {
            self.single.get_or_insert((self.kept.movement, 0)).1 += 1;
        }
        self.single
    }
}
