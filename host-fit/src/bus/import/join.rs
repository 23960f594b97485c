//! Ticks and reference go together by time: the reference at the time of a tick lies on the
//! straight line between the samples before and after it.

use super::ImportError;
use super::bus_log::BusTick;
use super::reference::{ReferenceCounts, ReferenceReader, Sample};

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
    /// Ticks.
    pub ticks: usize,
    /// First and last tick, us on the clock of the reference.
    pub bus_us: [f64; 2],
    /// First and last sample of the reference, us.
    pub reference_us: [f64; 2],
    /// How long the movements of the reference are together, s.
    pub reference_s: f64,
    /// For how much of that there are rows, s.
    pub covered_s: f64,
    /// Rows.
    pub rows: usize,
    /// Ticks before the first or after the last sample, and those at or before the tick before.
    pub outside: usize,
    /// Ticks whose samples before and after belong to different movements.
    pub between_movements: usize,
    /// Ticks with a sample before or after further away than the tolerance.
    pub too_far: usize,
    /// Largest time from a joined tick to the nearer of its samples, us.
    pub nearest_max_us: f64,
}

impl JoinCounts {
    /// Refuses records of which most found no partner in the other.
    ///
    /// # Errors
    /// `Sparse`, `NoOverlap`, `Unpaired`.
    pub(super) fn check(&self) -> Result<(), ImportError> {
        if 2 * self.too_far > self.ticks {
            return Err(ImportError::Sparse {
                too_far: self.too_far,
                ticks: self.ticks,
            });
        }
        if self.rows == 0 {
            return Err(ImportError::NoOverlap {
                bus_us: self.bus_us,
                reference_us: self.reference_us.map(f64::round),
            });
        }
        if 2 * self.rows >= self.ticks && 2.0 * self.covered_s >= self.reference_s {
            return Ok(());
        }
        Err(ImportError::Unpaired {
            rows: self.rows,
            ticks: self.ticks,
            covered_s: self.covered_s,
            reference_s: self.reference_s,
            outside: self.outside,
            between_movements: self.between_movements,
            too_far: self.too_far,
        })
    }
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

    /// For times that begin with this one.
    pub(super) fn from(samples: &'s [Sample], t_us: f64) -> Self {
        let next = samples.partition_point(|sample| sample.t_us < t_us);
        Self { samples, next }
    }

    /// The reference at `t_us`, which must not be before that of the last call.
    pub(super) fn at(&mut self, t_us: f64, tolerance_us: f64) -> At {
        while self.samples.get(self.next).is_some_and(|s| s.t_us < t_us) {
            self.next += 1;
        }
        let before = self.next.checked_sub(1).and_then(|k| self.samples.get(k));
        between(before, self.samples.get(self.next), t_us, tolerance_us)
    }
}

/// The reference at `t_us`, between the last sample before it and the first one at or after it.
fn between(before: Option<&Sample>, after: Option<&Sample>, t_us: f64, tolerance_us: f64) -> At {
    let Some(after) = after else {
        return At::Outside;
    };
    if after.t_us == t_us {
        return At::Found {
            movement: after.movement,
            values: after.values,
            nearest_us: 0.0,
        };
    }
    let Some(before) = before else {
        return At::Outside;
    };
    if before.movement != after.movement {
        return At::BetweenMovements;
    }
    let (since, until) = (t_us - before.t_us, after.t_us - t_us);
    if since < 0.0 {
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

/// Longest time from row to row of a log without a gap, in ticks.
const GAP_TICKS: f64 = 10.0;

/// Joins ticks with a reference as both are read.
pub(super) struct Join {
    reference: ReferenceReader,
    tolerance_us: f64,
    before: Option<Sample>,
    after: Option<Sample>,
    /// Movement and time of the row before.
    row: Option<(i64, f64)>,
    counts: JoinCounts,
}

impl Join {
    /// Reads the reference from where it is.
    ///
    /// # Errors
    /// Those of [`ReferenceReader::next_sample`].
    pub(super) fn new(
        mut reference: ReferenceReader,
        tolerance_us: f64,
    ) -> Result<Self, ImportError> {
        let after = reference.next_sample()?;
        Ok(Self {
            reference,
            tolerance_us,
            before: None,
            after,
            row: None,
            counts: JoinCounts {
                reference_us: [after.map_or(f64::NAN, |sample| sample.t_us); 2],
                bus_us: [f64::NAN; 2],
                ..JoinCounts::default()
            },
        })
    }

    /// The row of a tick at this time on the clock of the reference, if it has one; `period_us` is
    /// the time from tick to tick.
    ///
    /// # Errors
    /// Those of [`ReferenceReader::next_sample`].
    pub(super) fn take(
        &mut self,
        tick: &BusTick,
        t_us: f64,
        period_us: f64,
    ) -> Result<Option<JoinedRow>, ImportError> {
        // The log holds whole microseconds; the reference is taken at what it holds.
        let t_us = t_us.round();
        let counts = &mut self.counts;
        counts.bus_us = [
            if counts.ticks == 0 {
                t_us
            } else {
                counts.bus_us[0]
            },
            t_us,
        ];
        counts.ticks += 1;
        while self.after.is_some_and(|after| after.t_us < t_us) {
            self.advance()?;
        }
        let at = match self.row {
            // A sender that started again may overlap its own past by the jitter of the bus.
            Some((_, before_us)) if t_us <= before_us => At::Outside,
            _ => between(
                self.before.as_ref(),
                self.after.as_ref(),
                t_us,
                self.tolerance_us,
            ),
        };
        let counts = &mut self.counts;
        match at {
            At::Outside => counts.outside += 1,
            At::BetweenMovements => counts.between_movements += 1,
            At::TooFar => counts.too_far += 1,
            At::Found {
                movement,
                values,
                nearest_us,
            } => {
                counts.rows += 1;
                counts.nearest_max_us = counts.nearest_max_us.max(nearest_us);
                if let Some((last, before_us)) = self.row.replace((movement, t_us))
                    && last == movement
                    && t_us - before_us <= (GAP_TICKS * period_us).max(2.0 * self.tolerance_us)
                {
                    counts.covered_s += (t_us - before_us) * 1e-6;
                }
                return Ok(Some(JoinedRow {
                    t_us: t_us as i64,
                    movement,
                    values,
                    hall: tick.hall,
                    capacitive: tick.capacitive,
                }));
            }
        }
        Ok(None)
    }

    /// Reads the rest of the reference.
    ///
    /// # Errors
    /// Those of [`ReferenceReader::next_sample`].
    pub(super) fn finish(mut self) -> Result<(JoinCounts, ReferenceCounts), ImportError> {
        while self.after.is_some() {
            self.advance()?;
        }
        Ok((self.counts, self.reference.counts()))
    }

    fn advance(&mut self) -> Result<(), ImportError> {
        self.before = std::mem::replace(&mut self.after, self.reference.next_sample()?);
        if let (Some(before), Some(after)) = (&self.before, &self.after) {
            self.counts.reference_us[1] = after.t_us;
            if before.movement == after.movement {
                self.counts.reference_s += (after.t_us - before.t_us) * 1e-6;
            }
        }
        Ok(())
    }
}
