//! Movements of a log that has no column for them, told by its times.
//!
//! A movement ends where the time starts again, where rows are missing for more than
//! [`GAP_PERIODS`] of the log's own periods (its median step), or, where the user asks for it,
//! after a given time.

use super::gathered::Gathered;
use crate::input::dataset::Movement;

/// Longest gap within a movement, in periods of the log: longer than what a busy computer loses
/// now and then, shorter than it takes to reset an interferometer.
pub(super) const GAP_PERIODS: i64 = 10;

/// So many rows make a movement after which the time may start again; after fewer, rows are out
/// of order.
pub(super) const ROWS_MIN: usize = 10;

/// Where the movements of a log may begin, row by row.
#[derive(Debug, Default)]
pub(super) struct Steps {
    /// Times before the rows of the log that were kept: the longest step since the row kept before,
    /// with rows that were left out in between, us; `None` where the time starts again.
    steps_us: Vec<Option<i64>>,
    longest_us: i64,
    restarts: bool,
    /// Times of the first and the last row, kept or not, since the time last started.
    span_us: Option<(i64, i64)>,
    rows: usize,
}

impl Steps {
    /// Takes the time of the next row; tells whether the time starts again with it: at or before
    /// its first, after a whole movement.
    pub(super) fn take(&mut self, t_us: i64) -> bool {
        let restarts = match self.span_us {
            Some((first_us, last_us)) => {
                let restarts = t_us <= first_us && self.rows >= ROWS_MIN;
                self.longest_us = self.longest_us.max(t_us - last_us);
                restarts
            }
            None => false,
        };
        let first_us = match self.span_us {
            Some((first_us, _)) if !restarts => first_us,
            _ => t_us,
        };
        self.span_us = Some((first_us, t_us));
        self.rows = if restarts { 1 } else { self.rows + 1 };
        self.restarts |= restarts;
        restarts
    }

    /// The row in hand is kept.
    pub(super) fn keep(&mut self) {
        let step = (!self.restarts).then_some(self.longest_us);
        self.steps_us.push(step);
        self.longest_us = 0;
        self.restarts = false;
    }

    /// Puts the rows of a log, which so far are movements from `first_movement` on, into the
    /// movements that the times tell, of at most `length_us` each.
    pub(super) fn split(
        self,
        gathered: &mut Gathered,
        first_movement: usize,
        length_us: Option<i64>,
    ) {
        let Some(first) = gathered.movements.get(first_movement) else {
            return;
        };
        let (log, first_row) = (first.log, first.rows.start);
        let mut known: Vec<i64> = self.steps_us.iter().flatten().copied().skip(1).collect();
        let middle = known.len() / 2;
        let period_us = match known.is_empty() {
            true => i64::MAX,
            false => *known.select_nth_unstable(middle).1,
        };
        let gap_us = period_us.saturating_mul(GAP_PERIODS);
        let mut movements: Vec<Movement> = Vec::new();
        let mut start_us = 0;
        let samples = gathered.samples_of(first_row..gathered.len());
        for ((at, sample), step) in (first_row..).zip(samples).zip(self.steps_us) {
            // Half a period early is on time: steps jitter.
            let ends = |length_us| sample.t_us - start_us >= length_us - period_us / 2;
            let begins = step.is_none_or(|step| step > gap_us) || length_us.is_some_and(ends);
            match movements.last_mut() {
                Some(last) if !begins => last.rows.end = at + 1,
                _ => {
                    start_us = sample.t_us;
                    movements.push(Movement {
                        log,
                        index: movements.len() as i64,
                        rows: at..at + 1,
                    });
                }
            }
        }
        gathered.movements.truncate(first_movement);
        gathered.movements.extend(movements);
        gathered.name_movements(first_movement..gathered.movements.len());
    }
}
