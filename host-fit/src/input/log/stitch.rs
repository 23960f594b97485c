//! The rows of a log in their order: movements, sequence numbers, rows that are left out, and what
//! is odd about the log as a whole.

use super::error::LogError;
use super::header::Columns;
use super::order::{MOVEMENTS_MAX, Order, OrderFault};
use super::parse::{BadRow, LogRow, Parsed};
use super::rows::{BadCell, BetweenCodes};
use super::sequence::Numbering;
use super::skipped::Skipped;
use super::split::{Cuts, Steps};
use super::table::Head;
use super::time::Clock;
use super::warning::LogWarning;
use super::{BadRows, ReadOptions};

/// Mean distance of voltages from whole codes that passes in silence: those that were computed from
/// codes and written with few digits stay below it, those of another instrument have 0.25.
const BETWEEN_CODES: f64 = 0.15;

/// So many rows at the start of a log tell its period.
const PERIOD_ROWS: usize = 1 << 16;

/// Puts the blocks of a log together, in their order.
pub(super) struct Stitcher<'a, T> {
    head: &'a Head,
    columns: &'a Columns,
    options: &'a ReadOptions,
    servo_period_s: f64,
    order: Order,
    steps: Steps,
    /// How often the time of a log without a column for the movement started again.
    restarts: i64,
    /// The movement of the last row that was kept.
    movement: Option<i64>,
    pub(super) skipped: Skipped,
    between_codes: BetweenCodes,
    pub(super) clock: Clock,
    open_line: Option<usize>,
    /// Rows that wait until the period is known.
    waiting: Vec<Waiting<T>>,
    waiting_rows: usize,
    periods: Option<Periods>,
    movements: Movements,
}

/// The rows of a block.
struct Waiting<T> {
    rows: Vec<LogRow<T>>,
    /// Their steps, if the times tell where movements begin: see [`Steps::keep`].
    steps: Vec<Option<i64>>,
}

/// What the first rows of a log tell of the others.
struct Periods {
    cuts: Option<Cuts>,
    numbering: Numbering,
}

/// The movements of rows that were given away.
#[derive(Default)]
struct Movements {
    count: usize,
    /// The last one, and how many rows it has.
    last: (i64, usize),
    /// The first one with a single row, and how many there are.
    single: Option<(i64, usize)>,
}

impl Movements {
    fn take(&mut self, movement: i64, begins: bool) {
        if begins {
            self.end();
            self.count += 1;
            self.last = (movement, 0);
        }
        self.last.1 += 1;
    }

    fn end(&mut self) {
        if let (movement, 1) = self.last {
            self.single.get_or_insert((movement, 0)).1 += 1;
        }
    }
}

impl<'a, T> Stitcher<'a, T> {
    pub(super) fn new(
        head: &'a Head,
        columns: &'a Columns,
        options: &'a ReadOptions,
        servo_period_s: f64,
    ) -> Self {
        Self {
            head,
            columns,
            options,
            servo_period_s,
            order: Order::default(),
            steps: Steps::default(),
            restarts: 0,
            movement: None,
            skipped: Skipped::default(),
            between_codes: BetweenCodes::default(),
            clock: Clock::default(),
            open_line: None,
            waiting: Vec::new(),
            waiting_rows: 0,
            periods: None,
            movements: Movements::default(),
        }
    }

    /// The period of the log, us, once its rows are given away.
    pub(super) fn period_us(&self) -> f64 {
        let numbering = self.periods.as_ref().map(|periods| &periods.numbering);
        numbering.map_or(self.servo_period_s * 1e6, |numbering| numbering.period_us)
    }

    /// Takes the next block; rows that are ready are added to `ready`.
    ///
    /// # Errors
    /// The first fault of the block.
    pub(super) fn take(
        &mut self,
        parsed: Parsed<T>,
        ready: &mut Vec<Vec<LogRow<T>>>,
    ) -> Result<(), LogError> {
        let Parsed {
            block,
            mut rows,
            bad,
            fault,
            open_line,
            between_codes,
            clock,
        } = parsed;
        self.clock = Clock {
            form: self.clock.form.or(clock.form),
        };
        self.between_codes = self.between_codes.and(between_codes);
        self.open_line = open_line;
        let named = self.columns.movement.is_some();
        let mut steps = Vec::with_capacity(if named { 0 } else { rows.len() });
        let mut bad = bad.into_iter().peekable();
        for (at, row) in rows.iter_mut().enumerate() {
            while let Some(bad) = bad.next_if(|bad| bad.at <= at) {
                self.take_bad(bad)?;
            }
            let movement = if named { Some(row.movement) } else { None };
            row.movement = self.place(movement, row.t_us, block.line + row.line as usize)?;
            row.begins = self.movement != Some(row.movement);
            if row.begins {
                self.movement = Some(row.movement);
                if named && self.options.bad_rows == BadRows::Skip {
                    self.skipped.keep(row.movement);
                }
            }
            if !named {
                steps.push(self.steps.keep());
            }
        }
        for bad in bad {
            self.take_bad(bad)?;
        }
        if let Some(fault) = fault {
            return Err(fault);
        }
        if self.periods.is_none() {
            // Long comments between few rows would hold much memory for nothing.
            rows.shrink_to_fit();
        }
        if !rows.is_empty() {
            self.waiting_rows += rows.len();
            self.waiting.push(Waiting { rows, steps });
        }
        if self.periods.is_some() || self.waiting_rows >= PERIOD_ROWS {
            self.give(ready);
        }
        Ok(())
    }

    /// The end of the log: the last rows, and what is odd about it.
    ///
    /// # Errors
    /// `HeaderOnly`, `NoGoodRows`.
    pub(super) fn finish(
        &mut self,
        ready: &mut Vec<Vec<LogRow<T>>>,
        warnings: &mut Vec<LogWarning>,
    ) -> Result<(), LogError> {
        self.give(ready);
        self.movements.end();
        let path = self.head.path.as_path();
        let skipped = std::mem::take(&mut self.skipped);
        if self.movements.count == 0 {
            return Err(skipped.nothing_left(path, self.head.line));
        }
        if let Some(line) = self.open_line {
            warnings.push(LogWarning::NoFinalLineBreak {
                path: path.to_path_buf(),
                line,
            });
        }
        if self.columns.movement.is_none() {
            warnings.push(LogWarning::MovementsByTime {
                path: path.to_path_buf(),
                others: 0,
                movements: self.movements.count,
                split_s: self.options.split_s,
            });
        }
        let mean = self.between_codes.mean();
        if mean > BETWEEN_CODES {
            warnings.push(LogWarning::BetweenCodes {
                path: path.to_path_buf(),
                mean,
            });
        }
        warnings.extend(skipped.warnings(path));
        if let Some((first, count)) = self.movements.single {
            warnings.push(LogWarning::SingleRow {
                path: path.to_path_buf(),
                first,
                others: count - 1,
            });
        }
        let periods = self.periods.as_ref();
        warnings.extend(periods.and_then(|periods| periods.numbering.warning(path)));
        Ok(())
    }

    /// The movement of a row in its place; that of a log without a column for it is known later.
    fn place(&mut self, named: Option<i64>, t_us: i64, line: usize) -> Result<i64, LogError> {
        let movement = named.unwrap_or_else(|| {
            self.restarts += i64::from(self.steps.take(t_us));
            self.restarts
        });
        match self.order.take(movement, t_us, line) {
            Ok(_) => Ok(movement),
            Err(fault) => Err(self.out_of_order(fault, named, t_us, line)),
        }
    }

    fn take_bad(&mut self, row: BadRow) -> Result<(), LogError> {
        if let Some(t_us) = row.t_us {
            self.place(row.movement, t_us, row.line)?;
        }
        let BadCell { cell, fault } = row.bad;
        let place = || self.head.place(row.line, cell, row.movement);
        match self.options.bad_rows {
            BadRows::Refuse => Err(LogError::Cell {
                place: place(),
                fault,
            }),
            BadRows::Skip => {
                self.skipped.add(fault, row.movement, place);
                Ok(())
            }
        }
    }

    /// Gives away the rows that wait.
    fn give(&mut self, ready: &mut Vec<Vec<LogRow<T>>>) {
        let waiting = std::mem::take(&mut self.waiting);
        if self.periods.is_none() {
            self.periods = Some(self.first_periods(&waiting));
        }
        let Some(periods) = &mut self.periods else {
            return;
        };
        for Waiting { mut rows, steps } in waiting {
            let mut steps = steps.into_iter();
            for row in &mut rows {
                if let Some(cuts) = &mut periods.cuts {
                    row.begins = cuts.begins(row.t_us, steps.next().flatten());
                    let index = self.movements.count - usize::from(!row.begins);
                    row.movement = index as i64;
                }
                row.sequence = periods.numbering.number(row.t_us, row.begins);
                self.movements.take(row.movement, row.begins);
            }
            ready.push(rows);
        }
    }

    /// What the rows that wait, the first of the log, tell of the others.
    fn first_periods(&self, waiting: &[Waiting<T>]) -> Periods {
        let by_time = self.columns.movement.is_none();
        let length_us = (self.options.split_s).map(|seconds| (seconds * 1e6).round() as i64);
        let cuts = || {
            let steps = waiting.iter().flat_map(|block| block.steps.iter().copied());
            Cuts::new(steps, length_us)
        };
        let mut trial = by_time.then(cuts);
        let mut steps_us: Vec<i64> = Vec::with_capacity(self.waiting_rows);
        let mut before_us = 0;
        for block in waiting {
            let mut steps = block.steps.iter().copied();
            for row in &block.rows {
                let begins = match &mut trial {
                    Some(cuts) => cuts.begins(row.t_us, steps.next().flatten()),
                    None => row.begins,
                };
                if !begins {
                    steps_us.push(row.t_us - before_us);
                }
                before_us = row.t_us;
            }
        }
        Periods {
            cuts: by_time.then(cuts),
            numbering: Numbering::new(steps_us, self.servo_period_s),
        }
    }

    fn out_of_order(
        &self,
        fault: OrderFault,
        movement: Option<i64>,
        t_us: i64,
        line: usize,
    ) -> LogError {
        let at = |cell| self.head.place(line, cell, movement);
        let time = self.columns.time.cell;
        let index = self.columns.movement.map_or(time, |source| source.cell);
        match fault {
            OrderFault::Backwards { before_us } => LogError::TimeBackwards {
                place: at(time),
                before_us,
                t_us,
            },
            OrderFault::Repeated => LogError::DuplicatedRow {
                place: at(time),
                t_us,
            },
            OrderFault::Returns { left_line } => LogError::MovementReturns {
                place: at(index),
                left_line,
            },
            OrderFault::TooMany => LogError::TooManyMovements {
                path: self.head.path.clone(),
                line,
                limit: MOVEMENTS_MAX,
            },
        }
    }
}
