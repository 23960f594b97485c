//! Numbers the servo periods of a log by time, so that a gap shows as frames missed.

use super::warning::LogWarning;
use crate::input::dataset::{LogSource, Movement, Row};

/// Largest relative difference of the log's period from the servo's that passes in silence.
const PERIOD_TOLERANCE: f64 = 0.1;

/// Sets the sequence number of every row of one log: 0 at the start of each movement, then
/// by the time since the row before, in periods, at least 1.
///
/// The period is the median time between rows: a log that keeps every tenth sample has no
/// missing frames, only another period, which gives a warning.
pub(super) fn number(
    rows: &mut [Row],
    movements: &[Movement],
    source: &LogSource,
    servo_period_s: f64,
    warnings: &mut Vec<LogWarning>,
) {
    let slices = |movement: &Movement| movement.rows.clone();
    let mut steps_us: Vec<i64> = Vec::with_capacity(rows.len());
    for movement in movements {
        let slice = rows.get(slices(movement)).unwrap_or_default();
        steps_us.extend(slice.windows(2).filter_map(|pair| match pair {
            [before, row] => Some(row.t_us - before.t_us),
            _ => None,
        }));
    }
    let servo_us = servo_period_s * 1e6;
    let middle = steps_us.len() / 2;
    let period_us = if steps_us.is_empty() {
        servo_us
    } else {
        let log_us = *steps_us.select_nth_unstable(middle).1;
        let period_us = log_us as f64;
        if (period_us - servo_us).abs() > PERIOD_TOLERANCE * servo_us {
            warnings.push(LogWarning::OtherPeriod {
                path: source.path.clone(),
                log_us,
                servo_us,
            });
        }
        period_us
    };
    for movement in movements {
        let slice = rows.get_mut(slices(movement)).unwrap_or_default();
        let mut before: Option<(u32, i64)> = None;
        for row in slice {
            let sequence = match before {
                None => 0,
                Some((sequence, t_us)) => {
                    let periods = ((row.t_us - t_us) as f64 / period_us).round();
                    // Within half the range of u32, which the servo counts as ahead.
                    let periods = periods.clamp(1.0, f64::from(i32::MAX)) as u32;
                    sequence.wrapping_add(periods)
                }
            };
            row.frame = row.frame.with_sequence(sequence);
            before = Some((sequence, row.t_us));
        }
    }
}
