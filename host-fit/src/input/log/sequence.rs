//! Numbers the servo periods of a log by time, so that a gap shows as frames missed.

use super::warning::LogWarning;
use crate::input::dataset::{Dataset, Movement, Row};
use std::path::Path;

/// Largest relative difference of the log's period from the servo's that passes in silence.
const PERIOD_TOLERANCE: f64 = 0.1;

/// Gives every row of one log its sequence number: 0 at the start of each movement, then by the
/// time since the row before, in periods, at least 1.
///
/// The period is the median time between the first rows: a log that keeps every tenth sample has no
/// missing frames, only another period, which gives a warning.
#[derive(Debug)]
pub(super) struct Numbering {
    pub(super) period_us: f64,
    servo_us: f64,
    /// Sequence number and time of the row before.
    before: (u32, i64),
}

impl Numbering {
    /// For a log whose first rows have these times between rows of one movement.
    pub(super) fn new(mut steps_us: Vec<i64>, servo_period_s: f64) -> Self {
        let servo_us = servo_period_s * 1e6;
        let middle = steps_us.len() / 2;
        Self {
            period_us: match steps_us.is_empty() {
                true => servo_us,
                false => *steps_us.select_nth_unstable(middle).1 as f64,
            },
            servo_us,
            before: (0, 0),
        }
    }

    /// The number of the next row.
    pub(super) fn number(&mut self, t_us: i64, begins: bool) -> u32 {
        let (before, before_us) = self.before;
        let number = match begins {
            true => 0,
            false => {
                let periods = ((t_us - before_us) as f64 / self.period_us).round();
                // Within half the range of u32, which the servo counts as ahead.
                let periods = periods.clamp(1.0, f64::from(i32::MAX)) as u32;
                before.wrapping_add(periods)
            }
        };
        self.before = (number, t_us);
        number
    }

    /// That the log was sampled at another period than the servo's.
    pub(super) fn warning(&self, path: &Path) -> Option<LogWarning> {
        let off_us = (self.period_us - self.servo_us).abs();
        (off_us > PERIOD_TOLERANCE * self.servo_us).then(|| LogWarning::OtherPeriod {
            path: path.to_path_buf(),
            log_us: self.period_us as i64,
            servo_us: self.servo_us,
        })
    }
}

/// Numbers the rows of each log of a dataset.
pub(in crate::input) fn number_logs(dataset: &mut Dataset, servo_period_s: f64) {
    for log in 0..dataset.logs.len() {
        let of_log = dataset.movements.iter().filter(|m| m.log == log);
        number(&mut dataset.rows, of_log, servo_period_s);
    }
}

/// Numbers the rows of these movements of one log.
fn number<'m>(
    rows: &mut [Row],
    movements: impl Iterator<Item = &'m Movement> + Clone,
    servo_period_s: f64,
) {
    let mut steps_us: Vec<i64> = Vec::with_capacity(rows.len());
    for movement in movements.clone() {
        let rows = rows.get(movement.rows.clone()).unwrap_or_default();
        steps_us.extend(rows.windows(2).filter_map(|pair| match pair {
            [before, row] => Some(row.t_us - before.t_us),
            _ => None,
        }));
    }
    let period_us = Numbering::new(steps_us, servo_period_s).period_us;
    number_by(rows, movements, period_us);
}

/// The same by a known period, us.
pub(in crate::input) fn number_by<'m>(
    rows: &mut [Row],
    movements: impl Iterator<Item = &'m Movement>,
    period_us: f64,
) {
    let mut numbering = Numbering {
        period_us,
        servo_us: period_us,
        before: (0, 0),
    };
    for movement in movements {
        let rows = rows.get_mut(movement.rows.clone()).unwrap_or_default();
        for (at, row) in rows.iter_mut().enumerate() {
            let sequence = numbering.number(row.t_us, at == 0);
            row.frame = row.frame.with_sequence(sequence);
        }
    }
}
