//! Joins ticks and reference by time: the reference at the time of a tick lies on the cubic through the two samples
//! before and the two after it; on a straight line at a gap.

use super::JoinError;
use super::node_clock::Tick;
use super::reference::Sample;
use hallstage_input::dataset::LoggedFrame;

/// A tick with its reference.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JoinedRow {
    /// Time on the clock of the reference, us.
    pub t_us: i64,
    /// Number of the movement.
    pub movement: i64,
    /// Reference, in the units of its columns.
    pub values: [f64; 3],
    /// What the sensors read.
    pub frame: LoggedFrame,
}

/// The counts of a join.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct JoinCounts {
    /// Ticks.
    pub ticks: usize,
    /// First and last row of the sensors, us on the clock of the reference.
    pub sensors_us: [f64; 2],
    /// First and last sample of the reference, us.
    pub reference_us: [f64; 2],
    /// Duration of all movements of the reference, s.
    pub reference_s: f64,
    /// Duration of the part with rows, s.
    pub covered_s: f64,
    /// Rows.
    pub rows: usize,
    /// Ticks before the first or after the last sample.
    pub outside: usize,
    /// Ticks between samples of different movements.
    pub between_movements: usize,
    /// Ticks in a gap of the reference that is longer than the tolerance.
    pub too_far: usize,
    /// Largest time from a joined tick to the nearer of its samples, us.
    pub nearest_max_us: f64,
}

impl JoinCounts {
    /// Refuses records if less than half of each has a partner in the other.
    ///
    /// # Errors
    /// `Unpaired`.
    pub(super) fn check(self) -> Result<(), JoinError> {
        if 2 * self.rows >= self.ticks || 2.0 * self.covered_s >= self.reference_s {
            return Ok(());
        }
        Err(JoinError::Unpaired(self))
    }
}

/// The reference at a time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum ReferenceAt {
    Found {
        movement: i64,
        values: [f64; 3],
        nearest_us: f64,
    },
    Outside,
    BetweenMovements,
    TooFar,
}

/// The reference at a time between two samples that are at most the tolerance apart.
pub(super) fn at(samples: &[Sample], t_us: f64, tolerance_us: f64) -> ReferenceAt {
    let next = samples.partition_point(|sample| sample.t_us < t_us);
    let Some(after) = samples.get(next) else {
        return ReferenceAt::Outside;
    };
    let before = match next.checked_sub(1).and_then(|k| samples.get(k)) {
        _ if after.t_us == t_us => after,
        Some(before) => before,
        None => return ReferenceAt::Outside,
    };
    if before.movement != after.movement {
        return ReferenceAt::BetweenMovements;
    }
    let (since, until) = (t_us - before.t_us, after.t_us - t_us);
    if since + until > tolerance_us {
        return ReferenceAt::TooFar;
    }
    let values = match next
        .checked_sub(2)
        .and_then(|first| samples.get(first..next + 2))
    {
        Some(four) if follow(four, tolerance_us) => on_polynomial(four, t_us),
        _ if until > 0.0 => on_polynomial(&[*before, *after], t_us),
        _ => after.values,
    };
    ReferenceAt::Found {
        movement: before.movement,
        values,
        nearest_us: since.min(until),
    }
}

/// Whether samples of one movement follow each other within the tolerance.
fn follow(samples: &[Sample], tolerance_us: f64) -> bool {
    samples.windows(2).all(|pair| {
        pair[0].movement == pair[1].movement && pair[1].t_us - pair[0].t_us <= tolerance_us
    })
}

/// The values at a time on the polynomial through samples (Lagrange).
fn on_polynomial(samples: &[Sample], t_us: f64) -> [f64; 3] {
    let mut values = [0.0; 3];
    for one in samples {
        let others = samples.iter().filter(|other| other.t_us != one.t_us);
        let weight: f64 = others
            .map(|other| (t_us - other.t_us) / (one.t_us - other.t_us))
            .product();
        for (value, own) in values.iter_mut().zip(one.values) {
            *value += weight * own;
        }
    }
    values
}

/// Longest time from row to row of a log without a gap, in ticks.
const GAP_TICKS: f64 = 10.0;

/// Joins ticks with a reference; `reference_us` puts a time of the node on the reference's clock.
///
/// # Errors
/// The errors of `take`.
pub(super) fn join(
    ticks: &[Tick],
    samples: &[Sample],
    reference_us: impl Fn(f64) -> f64,
    (tolerance_us, period_us): (f64, f64),
    take: &mut dyn FnMut(&JoinedRow) -> Result<(), JoinError>,
) -> Result<JoinCounts, JoinError> {
    // The log holds whole microseconds, so the reference is taken there.
    let t_us = |tick: &Tick| reference_us(tick.t_us).round();
    let ends = |first: Option<f64>, last: Option<f64>| [first, last].map(|t| t.unwrap_or(f64::NAN));
    let span_s = |movement: &[Sample]| match movement {
        [first, .., last] => (last.t_us - first.t_us) * 1e-6,
        _ => 0.0,
    };
    let mut counts = JoinCounts {
        ticks: ticks.len(),
        sensors_us: ends(ticks.first().map(t_us), ticks.last().map(t_us)),
        reference_us: ends(
            samples.first().map(|sample| sample.t_us),
            samples.last().map(|sample| sample.t_us),
        ),
        reference_s: samples
            .chunk_by(|a, b| a.movement == b.movement)
            .map(span_s)
            .sum(),
        ..JoinCounts::default()
    };
    // Movement and time of the row before.
    let mut row: Option<(i64, f64)> = None;
    for tick in ticks {
        let t_us = t_us(tick);
        let (movement, values, nearest_us) = match at(samples, t_us, tolerance_us) {
            ReferenceAt::Outside => {
                counts.outside += 1;
                continue;
            }
            ReferenceAt::BetweenMovements => {
                counts.between_movements += 1;
                continue;
            }
            ReferenceAt::TooFar => {
                counts.too_far += 1;
                continue;
            }
            ReferenceAt::Found {
                movement,
                values,
                nearest_us,
            } => (movement, values, nearest_us),
        };
        counts.rows += 1;
        counts.nearest_max_us = counts.nearest_max_us.max(nearest_us);
        if let Some((last, before_us)) = row.replace((movement, t_us))
            && last == movement
            && t_us - before_us <= (GAP_TICKS * period_us).max(tolerance_us)
        {
            counts.covered_s += (t_us - before_us) * 1e-6;
        }
        take(&JoinedRow {
            t_us: t_us as i64,
            movement,
            values,
            frame: tick.frame,
        })?;
    }
    Ok(counts)
}
