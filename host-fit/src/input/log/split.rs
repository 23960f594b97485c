//! Movements of a log that has no column for them, told by its times.
//!
//! A movement ends where the time starts again, where rows are missing for more than
//! [`GAP_PERIODS`] of the log's own periods (its median step), or, where the user asks for it,
//! after a given time.

/// Longest gap within a movement, in periods of the log: longer than what a busy computer loses
/// now and then, shorter than it takes to reset an interferometer.
pub(super) const GAP_PERIODS: i64 = 10;

/// So many rows make a movement after which the time may start again; after fewer, rows are out
/// of order.
pub(super) const ROWS_MIN: usize = 10;

/// The times of a log, row by row.
#[derive(Debug, Default)]
pub(super) struct Steps {
    /// The longest step since the row kept before, with rows that were left out in between.
    longest_us: i64,
    /// Whether the time started again since then.
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

    /// The row in hand is kept: the longest step since the row kept before, us; `None` where the
    /// time started again.
    pub(super) fn keep(&mut self) -> Option<i64> {
        let step = (!self.restarts).then_some(self.longest_us);
        self.longest_us = 0;
        self.restarts = false;
        step
    }
}

/// Tells where movements begin.
#[derive(Debug)]
pub(super) struct Cuts {
    period_us: i64,
    /// Length of the movements, where the user asks for one.
    length_us: Option<i64>,
    /// The time of the first row of the movement, once there is one.
    start_us: Option<i64>,
}

impl Cuts {
    /// For a log whose first rows were kept with these steps.
    pub(super) fn new(steps_us: impl Iterator<Item = Option<i64>>, length_us: Option<i64>) -> Self {
        let mut known: Vec<i64> = steps_us.flatten().skip(1).collect();
        let middle = known.len() / 2;
        Self {
            period_us: match known.is_empty() {
                true => i64::MAX,
                false => *known.select_nth_unstable(middle).1,
            },
            length_us,
            start_us: None,
        }
    }

    /// Whether a movement begins with the next row.
    pub(super) fn begins(&mut self, t_us: i64, step_us: Option<i64>) -> bool {
        let gap_us = self.period_us.saturating_mul(GAP_PERIODS);
        let begins = match (self.start_us, step_us) {
            (None, _) | (_, None) => true,
            (Some(start_us), Some(step_us)) => {
                // Half a period early is on time: steps jitter.
                let ends = |length_us| t_us - start_us >= length_us - self.period_us / 2;
                step_us > gap_us || self.length_us.is_some_and(ends)
            }
        };
        if begins {
            self.start_us = Some(t_us);
        }
        begins
    }
}
