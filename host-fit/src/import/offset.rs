//! The offset between the clocks, by the motion that both saw: at the right one the Hall
//! signals are a linear function of the reference pose, but for what height and tilt change.
//!
//! For a trial offset the signals of all ticks are fitted by the reference, linearly, with a
//! constant for each movement; what the fit leaves over, as a share of the signals' motion, is
//! smallest at the true offset. A grid of one servo period finds the valley, golden section
//! its floor.

use super::ImportError;
use super::bus_log::BusTick;
use super::join::{At, Cursor};
use super::reference::Sample;
use nalgebra::{Matrix3, Vector3};

/// The offset between the clocks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Offset {
    /// Time of the bus less time of the reference, us.
    pub us: f64,
    /// Share of the Hall signals' motion that the reference explains, if it was estimated.
    pub explained: Option<f64>,
}

/// Ticks of the coarse search, at most.
const COARSE_TICKS: usize = 4_000;

/// Share that must be explained: signals of another run reach a third by chance.
const EXPLAINED_MIN: f64 = 0.6;

/// Width at which golden section stops, us.
const WIDTH_US: f64 = 0.5;

/// Finds the offset within `search_us` of where both records start together.
///
/// # Errors
/// [`ImportError::NoOffset`].
pub fn estimate(
    ticks: &[BusTick],
    times_us: &[f64],
    samples: &[Sample],
    step_us: f64,
    search_us: f64,
) -> Result<Offset, ImportError> {
    let starts = times_us.first().zip(samples.first());
    let centre_us = starts.map_or(0.0, |(bus, reference)| bus - reference.t_us);
    let points: Vec<Point> = ticks
        .iter()
        .zip(times_us)
        .map(|(tick, t_us)| Point {
            t_us: *t_us,
            signal: Vector3::from(tick.hall.map(f64::from)),
        })
        .collect();
    let every = points.len().div_ceil(COARSE_TICKS).max(1);
    let coarse: Vec<Point> = points.iter().step_by(every).copied().collect();
    let trial = |points: &[Point], us: f64| left_over(points, samples, us, 2.0 * step_us);
    let steps = (search_us / step_us).ceil().clamp(1.0, 1e6) as i64;
    let mut best = (f64::INFINITY, centre_us);
    for k in -steps..=steps {
        let us = centre_us + k as f64 * step_us;
        let left = trial(&coarse, us);
        if left < best.0 {
            best = (left, us);
        }
    }
    let us = golden(best.1 - step_us, best.1 + step_us, |us| trial(&points, us));
    let explained = 1.0 - trial(&points, us);
    if explained.is_nan() || explained < EXPLAINED_MIN {
        return Err(ImportError::NoOffset {
            percent: 100.0 * explained.max(0.0),
            least_percent: 100.0 * EXPLAINED_MIN,
        });
    }
    Ok(Offset {
        us,
        explained: Some(explained),
    })
}

#[derive(Clone, Copy, Debug)]
struct Point {
    t_us: f64,
    signal: Vector3<f64>,
}

/// Sums of one movement.
#[derive(Clone, Copy, Debug, Default)]
struct Sums {
    n: f64,
    s: Vector3<f64>,
    q: Vector3<f64>,
    sq: Matrix3<f64>,
    qq: Matrix3<f64>,
    ss: f64,
}

impl Sums {
    fn add(&mut self, s: Vector3<f64>, q: Vector3<f64>) {
        self.n += 1.0;
        self.s += s;
        self.q += q;
        self.sq += s * q.transpose();
        self.qq += q * q.transpose();
        self.ss += s.norm_squared();
    }

    /// Adds the movement to the whole, its means taken out.
    fn centre_into(&self, whole: &mut Self) {
        if self.n > 0.0 {
            whole.n += self.n;
            whole.sq += self.sq - self.s * self.q.transpose() / self.n;
            whole.qq += self.qq - self.q * self.q.transpose() / self.n;
            whole.ss += self.ss - self.s.norm_squared() / self.n;
        }
    }
}

/// Share of the signals' motion that the reference leaves over at an offset; 1 where fewer
/// than half of the points have a reference.
fn left_over(points: &[Point], samples: &[Sample], offset_us: f64, tolerance_us: f64) -> f64 {
    let mut cursor = Cursor::new(samples);
    let (mut whole, mut sums) = (Sums::default(), Sums::default());
    let mut current = None;
    for point in points {
        let at = cursor.at(point.t_us - offset_us, tolerance_us);
        let At::Found {
            movement, values, ..
        } = at
        else {
            continue;
        };
        if current != Some(movement) {
            sums.centre_into(&mut whole);
            sums = Sums::default();
            current = Some(movement);
        }
        sums.add(point.signal, Vector3::from(values));
    }
    sums.centre_into(&mut whole);
    if whole.n * 2.0 < points.len() as f64 || whole.ss <= 0.0 {
        return 1.0;
    }
    // Axes that do not move have no inverse: the pseudo-inverse leaves them out.
    let scale = whole.qq.norm() * 1e-12;
    let Ok(inverse) = whole.qq.pseudo_inverse(scale) else {
        return 1.0;
    };
    let explained = (whole.sq * inverse * whole.sq.transpose()).trace();
    1.0 - explained / whole.ss
}

/// The place of the smallest value between two ends of a valley.
fn golden(mut low: f64, mut high: f64, value: impl Fn(f64) -> f64) -> f64 {
    const RATIO: f64 = 0.618_033_988_749_894_9;
    let mut a = high - RATIO * (high - low);
    let mut b = low + RATIO * (high - low);
    let (mut at_a, mut at_b) = (value(a), value(b));
    while high - low > WIDTH_US {
        if at_a < at_b {
            (high, b, at_b) = (b, a, at_a);
            a = high - RATIO * (high - low);
            at_a = value(a);
        } else {
            (low, a, at_a) = (a, b, at_b);
            b = low + RATIO * (high - low);
            at_b = value(b);
        }
    }
    (low + high) / 2.0
}
