//! Ticks and reference go together by time: the reference at the time of a tick lies on the
//! straight line between the samples before and after it.

use super::bus_log::BusTick;
use super::reference::Sample;

/// A tick with its reference.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JoinedRow {
    /// Time on the clock of the reference, us.
    pub t_us: i64,
    /// Number of the movement.
    pub movement: i64,
    /// Reference, in the units of its columns.
    pub values: [f64; 3],
    /// Hall codes.
    pub hall: [i32; 3],
    /// Capacitive codes.
    pub capacitive: [i32; 3],
}

/// How ticks and reference went together.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct JoinCounts {
    /// Rows.
    pub rows: usize,
    /// Ticks before the first or after the last sample.
    pub outside: usize,
    /// Ticks whose samples before and after belong to different movements.
    pub between_movements: usize,
    /// Ticks with a sample before or after further away than the tolerance.
    pub too_far: usize,
    /// Largest time from a joined tick to the nearer of its samples, us.
    pub nearest_max_us: f64,
}

/// The reference at a time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum At {
    Found {
        movement: i64,
        values: [f64; 3],
        nearest_us: f64,
    },
    Outside,
    BetweenMovements,
    TooFar,
}

/// Goes along samples with rising times.
#[derive(Clone, Debug)]
pub(super) struct Cursor<'s> {
    samples: &'s [Sample],
    next: usize,
}

impl<'s> Cursor<'s> {
    pub(super) const fn new(samples: &'s [Sample]) -> Self {
        Self { samples, next: 0 }
    }

    /// The reference at `t_us`, which must not be before that of the last call.
    pub(super) fn at(&mut self, t_us: f64, tolerance_us: f64) -> At {
        while self.samples.get(self.next).is_some_and(|s| s.t_us < t_us) {
            self.next += 1;
        }
        let Some(after) = self.samples.get(self.next) else {
            return At::Outside;
        };
        if after.t_us == t_us {
            return At::Found {
                movement: after.movement,
                values: after.values,
                nearest_us: 0.0,
            };
        }
        let Some(before) = self.next.checked_sub(1).and_then(|k| self.samples.get(k)) else {
            return At::Outside;
        };
        if before.movement != after.movement {
            return At::BetweenMovements;
        }
        let (since, until) = (t_us - before.t_us, after.t_us - t_us);
        if since < 0.0 {
            // A sender that started again may overlap its own past by the jitter of the bus.
            return At::Outside;
        }
        if since > tolerance_us || until > tolerance_us {
            return At::TooFar;
        }
        let part = since / (since + until);
        let [a, b, c] = before.values;
        let [d, e, f] = after.values;
        let between = |from: f64, to: f64| from + part * (to - from);
        At::Found {
            movement: before.movement,
            values: [between(a, d), between(b, e), between(c, f)],
            nearest_us: since.min(until),
        }
    }
}

/// Joins ticks, at these times on the clock of the reference, with samples.
pub fn join(
    ticks: &[BusTick],
    times_us: impl Iterator<Item = f64>,
    samples: &[Sample],
    tolerance_us: f64,
) -> (Vec<JoinedRow>, JoinCounts) {
    let mut cursor = Cursor::new(samples);
    let mut rows = Vec::with_capacity(ticks.len());
    let mut counts = JoinCounts::default();
    for (tick, t_us) in ticks.iter().zip(times_us) {
        // The log holds whole microseconds; the reference is taken at what it holds.
        let t_us = t_us.round();
        match cursor.at(t_us, tolerance_us) {
            At::Found {
                movement,
                values,
                nearest_us,
            } => {
                counts.nearest_max_us = counts.nearest_max_us.max(nearest_us);
                rows.push(JoinedRow {
                    t_us: t_us as i64,
                    movement,
                    values,
                    hall: tick.hall,
                    capacitive: tick.capacitive,
                });
            }
            At::Outside => counts.outside += 1,
            At::BetweenMovements => counts.between_movements += 1,
            At::TooFar => counts.too_far += 1,
        }
    }
    counts.rows = rows.len();
    (rows, counts)
}
