//! The estimator: damped Gauss-Newton with a normal prior, for any model.
//!
//! A model gives its normal equations in its values v: sums of products of whitened derivatives and
//! residuals. The unknowns are x, with v = origin + basis x and a prior of mean zero on x. A mask is
//! a basis of some unit vectors; an old covariance L L' is the basis L with the prior 1. Where x has
//! ranges, it stays within them.

use hallstage_input::stage::Range;
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};
use rayon::prelude::*;

/// Movements with sums in memory at the same time: 56 kB each.
const TOGETHER: usize = 64;
/// A step is too small to count if it would lower the sum of squares by less than this part of it.
const RELATIVE_GAIN_MIN: f64 = 1e-10;
/// Near the minimum rounding decides: a rise of less than this is none.
const RISE_MAX: f64 = 1e-3;
/// A step with a gain below this part of its promise is followed by a step with more damping, a step with a gain above
/// the complement by one with less.
const PROMISE_KEPT: f64 = 0.25;
/// Damping of the first step after one that led uphill, or hardly down.
const DAMPING_UPHILL: f64 = 1e-4;
/// Damping of a singular matrix.
const DAMPING_SINGULAR: f64 = 1e-12;
/// A step with less damping is a full one.
const DAMPING_NONE: f64 = 1e-6;
const DAMPING_MAX: f64 = 1e8;

/// Sums over the rows of a log, of `W` columns: the derivatives by the values, then zeros, then the
/// residual in the last one.
#[derive(Clone, Debug)]
pub struct Normal<const W: usize> {
    /// Products of the whitened columns, upper triangle.
    products: Vec<[f64; W]>,
    /// The reference's error at the end of each movement (X, Y, Rz) and its change by each value,
    /// where the model eliminates one.
    pub ends: Vec<[[f64; W]; 3]>,
}

impl<const W: usize> Normal<W> {
    const RESIDUAL: usize = W - 1;

    /// The sums over no rows.
    pub fn none() -> Self {
        Self {
            products: vec![[0.0; W]; W],
            ends: Vec::new(),
        }
    }

    /// The sum over `count` movements, in their order for any number of threads; `None` if a movement cannot be
    /// evaluated.
    pub fn sum(count: usize, movement_sums: impl Fn(usize) -> Option<Self> + Sync) -> Option<Self> {
        let mut sum = Self::none();
        for start in (0..count).step_by(TOGETHER) {
            let some = start..(start + TOGETHER).min(count);
            let some: Vec<Option<Self>> = some.into_par_iter().map(&movement_sums).collect();
            for movement in some {
                sum.add(movement?);
            }
        }
        Some(sum)
    }

    /// Adds three whitened residuals with their derivatives, counted `weight` times.
    #[inline(always)]
    pub fn add_row(&mut self, [a, b, c]: &[[f64; W]; 3], weight: f64) {
        const LANES: usize = 4;
        for (i, row) in self.products.iter_mut().enumerate() {
            let (x, y, z) = (weight * a[i], weight * b[i], weight * c[i]);
            let from = i / LANES * LANES;
            let columns = a[from..].iter().zip(&b[from..]).zip(&c[from..]);
            for (sum, ((a, b), c)) in row[from..].iter_mut().zip(columns) {
                *sum += (x * a + y * b) + z * c;
            }
        }
    }

    /// Adds the sums of another movement.
    pub fn add(&mut self, other: Self) {
        for (sum, row) in self.products.iter_mut().zip(&other.products) {
            for (sum, x) in sum.iter_mut().zip(row) {
                *sum += x;
            }
        }
        self.ends.extend(other.ends);
    }

    /// The curvature between two values.
    pub fn curvature(&self, i: usize, j: usize) -> f64 {
        self.products[i.min(j)][i.max(j)]
    }

    /// How steeply the sum of squares falls along a value (half of it).
    pub fn descent(&self, i: usize) -> f64 {
        self.products[i][Self::RESIDUAL]
    }

    /// Sum of squares of the whitened residuals.
    pub fn chi_squared(&self) -> f64 {
        self.products[Self::RESIDUAL][Self::RESIDUAL]
    }

    /// The reference's error at the end of each movement after a change of the values.
    pub fn ends_after(&self, change: &DVector<f64>) -> impl Iterator<Item = [f64; 3]> {
        self.ends.iter().map(move |end| {
            [0, 1, 2].map(|axis| {
                let moved: f64 = change.iter().zip(&end[axis]).map(|(c, e)| c * e).sum();
                end[axis][Self::RESIDUAL] - moved
            })
        })
    }
}

/// Where a model is evaluated.
#[derive(Clone, Debug)]
pub struct Point {
    /// Its values.
    pub values: DVector<f64>,
    /// The reference's error of each movement; empty where the model eliminates it by itself.
    pub offsets: Vec<[f64; 3]>,
}

/// A model with a log.
pub trait Equations<const W: usize> {
    /// The normal equations at a point; `None` where the model has no value.
    fn normal(&self, at: &Point) -> Option<Normal<W>>;
}

/// The unknowns and their prior.
#[derive(Clone, Debug)]
pub struct Unknowns {
    /// The values at x = 0.
    pub origin: DVector<f64>,
    /// Their change by x.
    pub basis: DMatrix<f64>,
    /// The inverse of the covariance of x before the log is seen.
    pub prior: DMatrix<f64>,
    /// Where x stays; empty where it is free.
    pub ranges: Vec<Range>,
}

impl Unknowns {
    /// Some of the values, with a flat prior.
    pub fn some(origin: DVector<f64>, free: &[usize]) -> Self {
        let unit = |row: usize, column: usize| f64::from(u8::from(free[column] == row));
        Self {
            basis: DMatrix::from_fn(origin.len(), free.len(), unit),
            prior: DMatrix::zeros(free.len(), free.len()),
            ranges: Vec::new(),
            origin,
        }
    }

    /// The values at x.
    pub fn values(&self, x: &DVector<f64>) -> DVector<f64> {
        &self.origin + &self.basis * x
    }

    /// The prior's share of the sum of squares.
    pub fn prior_squares(&self, x: &DVector<f64>) -> f64 {
        x.dot(&(&self.prior * x))
    }

    /// Half the fall of the sum of squares along x.
    pub fn descent<const W: usize>(&self, normal: &Normal<W>, x: &DVector<f64>) -> DVector<f64> {
        let by_values = DVector::from_fn(self.origin.len(), |k, _| normal.descent(k));
        self.basis.tr_mul(&by_values) - &self.prior * x
    }

    /// The curvature along x.
    pub fn curvature<const W: usize>(&self, normal: &Normal<W>) -> DMatrix<f64> {
        let n = self.origin.len();
        let by_values = DMatrix::from_fn(n, n, |i, j| normal.curvature(i, j));
        self.basis.tr_mul(&(by_values * &self.basis)) + &self.prior
    }

    /// The factored curvature; `None` where it is singular.
    pub fn factor<const W: usize>(&self, normal: &Normal<W>) -> Option<Factor> {
        Factor::new(&self.curvature(normal), 0.0)
    }

    /// The step from x to the least sum of squares that the curvature promises within the ranges:
    /// an unknown that meets an end of its range is held there, and released if more than `enough` is gained
    /// inwards (bounded-variable least squares, Stark and Parker 1995). `None` where the curvature
    /// is singular.
    fn step(
        &self,
        x: &DVector<f64>,
        curvature: &DMatrix<f64>,
        damping: f64,
        descent: &DVector<f64>,
        enough: f64,
    ) -> Option<DVector<f64>> {
        let room = |k: usize| match self.ranges.get(k) {
            Some(range) => [range.low - x[k], range.high - x[k]],
            None => [f64::NEG_INFINITY, f64::INFINITY],
        };
        let mut damped = curvature.clone();
        damped.set_diagonal(&(curvature.diagonal() * (1.0 + damping)));
        let mut step = DVector::zeros(x.len());
        let at_end = |k: usize| room(k)[0] >= 0.0 || room(k)[1] <= 0.0;
        let mut held: Vec<bool> = (0..x.len()).map(at_end).collect();
        // Each round holds or releases one unknown. This number of rounds is enough but for rounding.
        for _ in 0..=3 * x.len() {
            let free: Vec<usize> = (0..x.len()).filter(|&k| !held[k]).collect();
            let held_step =
                DVector::from_fn(x.len(), |k, _| f64::from(u8::from(held[k])) * step[k]);
            let pull = (descent - &damped * held_step).select_rows(&free);
            let part = curvature.select_rows(&free).select_columns(&free);
            let target = Factor::new(&part, damping)?.solve(&pull);
            let way = |(&k, target): (&usize, &f64)| (k, target - step[k]);
            let ways: Vec<(usize, f64)> = free.iter().zip(&target).map(way).collect();
            let share = |(k, way): &(usize, f64)| -> (f64, usize, f64) {
                let end = room(*k)[usize::from(*way > 0.0)];
                ((end - step[*k]) / way, *k, end)
            };
            let shares = ways
                .iter()
                .filter(|way| way.1 != 0.0)
                .map(share)
                .filter(|(share, ..)| *share < 1.0);
            if let Some((share, k, end)) = shares.min_by(|a, b| a.0.total_cmp(&b.0)) {
                ways.iter().for_each(|(k, way)| step[*k] += share * way);
                (step[k], held[k]) = (end, true);
                continue;
            }
            free.iter().zip(&target).for_each(|(&k, x)| step[k] = *x);
            let pull = descent - &damped * &step;
            let gain = |&k: &usize| pull[k] * pull[k] / damped[(k, k)];
            let inwards = |&k: &usize| {
                let end = room(k)[usize::from(pull[k] > 0.0)];
                held[k] && step[k] != end && gain(&k) > enough
            };
            let best = (0..x.len()).filter(inwards);
            match best.max_by(|a, b| gain(a).total_cmp(&gain(b))) {
                Some(k) => held[k] = false,
                None => break,
            }
        }
        Some(step)
    }

    /// The covariance of the values; `None` where log and prior do not determine a combination.
    pub fn covariance<const W: usize>(&self, normal: &Normal<W>) -> Option<DMatrix<f64>> {
        Some(&self.basis * self.factor(normal)?.inverse() * self.basis.transpose())
    }
}

/// The curvature along x, scaled to a diagonal of ones and factored.
#[derive(Clone, Debug)]
pub struct Factor {
    scale: DVector<f64>,
    factor: Cholesky<f64, Dyn>,
}

impl Factor {
    /// Factors a curvature plus `damping` times its diagonal; `None` where it is singular.
    pub fn new(curvature: &DMatrix<f64>, damping: f64) -> Option<Self> {
        let scale = curvature.diagonal().map(|d| {
            let d = d.sqrt();
            // An unknown without information is not changed.
            if d.is_normal() { 1.0 / d } else { 0.0 }
        });
        let scaled = DMatrix::from_fn(scale.len(), scale.len(), |i, j| {
            if i == j {
                1.0 + damping
            } else {
                curvature[(i, j)] * scale[i] * scale[j]
            }
        });
        let factor = Cholesky::new(scaled)?;
        Some(Self { scale, factor })
    }

    /// The step of x along a descent.
    pub fn solve(&self, descent: &DVector<f64>) -> DVector<f64> {
        let scaled = descent.component_mul(&self.scale);
        self.factor.solve(&scaled).component_mul(&self.scale)
    }

    /// The covariance of x.
    pub fn inverse(&self) -> DMatrix<f64> {
        let mut inverse = self.factor.inverse();
        for (j, mut column) in inverse.column_iter_mut().enumerate() {
            column.component_mul_assign(&self.scale);
            column *= self.scale[j];
        }
        inverse
    }
}

/// When to stop.
#[derive(Clone, Copy, Debug)]
pub struct Limits {
    /// Steps at most.
    pub steps: u32,
    /// A step that would lower the sum of squares by less is not made.
    pub gain: f64,
}

impl Limits {
    /// From a start that is nearly there, where three steps do: the last would be three hundredths of a standard
    /// error.
    pub const CLOSE: Self = Self {
        steps: 20,
        gain: 1e-3,
    };
}

/// Where the steps ended.
#[derive(Clone, Debug)]
pub struct Solved<const W: usize> {
    /// x.
    pub x: DVector<f64>,
    /// The values, and the reference's errors.
    pub point: Point,
    /// The sums there.
    pub normal: Normal<W>,
    /// Steps tried.
    pub steps: u32,
    /// Whether no further step would gain anything.
    pub reached: bool,
}

/// Steps down from x, which lies within the ranges. `None` if the model has no value at the start.
pub fn solve<const W: usize>(
    equations: &impl Equations<W>,
    unknowns: &Unknowns,
    x: DVector<f64>,
    offsets: Vec<[f64; 3]>,
    limits: Limits,
) -> Option<Solved<W>> {
    let point = Point {
        values: unknowns.values(&x),
        offsets,
    };
    let mut at = Solved {
        normal: equations.normal(&point)?,
        point,
        x,
        steps: 0,
        reached: false,
    };
    let mut damping = 0.0;
    while damping < DAMPING_MAX {
        let descent = unknowns.descent(&at.normal, &at.x);
        let curvature = unknowns.curvature(&at.normal);
        let enough = f64::max(limits.gain, RELATIVE_GAIN_MIN * at.normal.chi_squared());
        let Some(step) = unknowns.step(&at.x, &curvature, damping, &descent, enough) else {
            damping = f64::max(10.0 * damping, DAMPING_SINGULAR);
            continue;
        };
        let promise = descent.dot(&step);
        if promise <= enough && damping <= DAMPING_NONE {
            at.reached = true;
            break;
        }
        if at.steps == limits.steps {
            break;
        }
        at.steps += 1;
        let change = &unknowns.basis * &step;
        let moved = at.point.offsets.iter().zip(at.normal.ends_after(&change));
        let point = Point {
            offsets: moved
                .map(|(offset, change)| [0, 1, 2].map(|k| offset[k] + change[k]))
                .collect(),
            values: &at.point.values + change,
        };
        let x = &at.x + step;
        let cost = |normal: &Normal<W>, x| normal.chi_squared() + unknowns.prior_squares(x);
        let before = cost(&at.normal, &at.x);
        let next = equations.normal(&point);
        let gain = next.as_ref().map(|next| before - cost(next, &x));
        let kept = gain.map_or(f64::NEG_INFINITY, |gain| gain / promise);
        if let Some(normal) = next
            && gain >= Some(-RISE_MAX.min(enough))
        {
            (at.x, at.point, at.normal) = (x, point, normal);
        }
        if kept < PROMISE_KEPT {
            damping = f64::max(10.0 * damping, DAMPING_UPHILL);
        } else if damping <= DAMPING_NONE {
            damping = 0.0;
        } else if kept > 1.0 - PROMISE_KEPT {
            damping *= 0.1;
        }
    }
    Some(at)
}

#[cfg(test)]
#[path = "gauss_newton_tests.rs"]
mod tests;
