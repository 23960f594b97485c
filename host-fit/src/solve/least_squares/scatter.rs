//! Sums over rows from which every step of the least-squares fit follows.
//!
//! With the ratios r = slope / eta of each probe given, the pose is linear in the corrected signals
//! s' = s / (1 + r v), where v are the factors of the slopes (Z, Rx, Ry for Model (31)):
//! q = G s' - o, with G = PM^-1 diag(1/eta) and one offset o for each movement. The derivative of
//! s'_i with respect to r_ik is u_ik = -s'_i v_k / (1 + r_i v). So the products of the numbers
//! (s', q, u), each less its mean over the movement where the offset is free, hold all that cost,
//! gradient and curvature need: one pass over the rows for each set of ratios, whatever the number
//! of movements.

use crate::problem::model::SLOPES_MAX;
use crate::problem::{Group, Problem, TrainRow};
use nalgebra::SMatrix;
use pulp::{Simd, WithSimd};
use rayon::prelude::*;

/// Where the reference starts, behind the corrected signals.
pub const Q: usize = 3;
/// Where the derivatives start: [`SLOPES_MAX`] for each probe, zero beyond the model's.
pub const U: usize = 6;
/// Corrected signals, reference and derivatives.
pub const WIDTH: usize = U + 3 * SLOPES_MAX;

/// Slopes over eta of the probes A, B, C: (a, b, c) / eta in 1/m, 1/rad, 1/rad for Model (31).
pub type Ratios = [[f64; SLOPES_MAX]; 3];

/// Rows whose 1 + r v is smaller than this are next to a pole, and so is the candidate.
pub(super) const DENOMINATOR_MIN: f64 = 0.05;

/// The offset of one movement.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Offset {
    /// Chosen for the least cost: the movement's means are taken off.
    Free,
    /// Given, um, um, urad.
    Fixed([f64; 3]),
}

/// Products of the numbers of a row, summed over all rows by their weights: symmetric.
pub type Scatter = SMatrix<f64, WIDTH, WIDTH>;

/// Room for the numbers of a row of any model: a multiple of four, so that loops over it fill
/// SIMD registers.
const ROOM: usize = WIDTH.next_multiple_of(4);

/// The numbers of one row, or `None` next to a pole of 1 / (1 + r v).
pub fn regressors(row: &TrainRow, ratios: &Ratios) -> Option<[f64; ROOM]> {
    regressors_of::<SLOPES_MAX, ROOM>(row, ratios)
}

/// The mean of the numbers over some rows by their weights, or `None` next to a pole.
pub fn mean(rows: &[TrainRow], ratios: &Ratios) -> Option<[f64; ROOM]> {
    mean_of::<SLOPES_MAX, ROOM>(rows, ratios)
}

/// The origin from which the numbers of a movement count: its means where the offset is free, else
/// minus the offset for the reference and zero for the rest. `None` next to a pole.
pub fn origin(rows: &[TrainRow], ratios: &Ratios, offset: Offset) -> Option<[f64; ROOM]> {
    origin_of::<SLOPES_MAX, ROOM>(rows, ratios, offset)
}

// The same for a constant number of slopes `K`, whose derivatives lie side by side, and room for
// `W` numbers: loops of constant length take half the time.

#[expect(
    clippy::needless_range_loop,
    reason = "a constant number of steps, written as sums are"
)]
#[inline(always)]
fn regressors_of<const K: usize, const W: usize>(
    row: &TrainRow,
    ratios: &Ratios,
) -> Option<[f64; W]> {
    let mut z = [0.0; W];
    let mut smallest = f64::INFINITY;
    for probe in 0..3 {
        let r = &ratios[probe];
        let mut share = r[0] * row.slopes[0];
        for k in 1..K {
            share += r[k] * row.slopes[k];
        }
        let denominator = 1.0 + share;
        smallest = smallest.min(denominator);
        let corrected = row.signal_um[probe] / denominator;
        let slope = -corrected / denominator;
        z[probe] = corrected;
        z[Q + probe] = row.reference_um[probe];
        for k in 0..K {
            z[U + K * probe + k] = slope * row.slopes[k];
        }
    }
    (smallest > DENOMINATOR_MIN).then_some(z)
}

#[inline(always)]
fn mean_of<const K: usize, const W: usize>(rows: &[TrainRow], ratios: &Ratios) -> Option<[f64; W]> {
    let mut sum = [0.0; W];
    let mut n = 0.0;
    for row in rows {
        let z = regressors_of::<K, W>(row, ratios)?;
        for (sum, z) in sum.iter_mut().zip(z) {
            *sum += row.weight * z;
        }
        n += row.weight;
    }
    Some(sum.map(|s| s / n))
}

#[inline(always)]
fn origin_of<const K: usize, const W: usize>(
    rows: &[TrainRow],
    ratios: &Ratios,
    offset: Offset,
) -> Option<[f64; W]> {
    match offset {
        Offset::Free => mean_of::<K, W>(rows, ratios),
        Offset::Fixed(o) => {
            let mut origin = [0.0; W];
            for axis in 0..3 {
                origin[Q + axis] = -o[axis];
            }
            Some(origin)
        }
    }
}

/// The sums over the rows of one movement, with the machine's widest registers; only the upper
/// triangle is right. A type and not a closure, since closures are not always inlined into the
/// function that is compiled for the instruction set.
struct GroupSums<'a, const K: usize, const W: usize> {
    rows: &'a [TrainRow],
    ratios: &'a Ratios,
    offset: Offset,
}

impl<const K: usize, const W: usize> WithSimd for GroupSums<'_, K, W> {
    type Output = Option<[[f64; W]; W]>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> Self::Output {
        let origin = origin_of::<K, W>(self.rows, self.ratios, self.offset)?;
        let mut sums = [[0.0; W]; W];
        for row in self.rows {
            let mut z = regressors_of::<K, W>(row, self.ratios)?;
            for (z, origin) in z.iter_mut().zip(origin) {
                *z -= origin;
            }
            for (i, sums) in sums.iter_mut().enumerate().take(U + 3 * K) {
                let from = i & !3;
                let factor = row.weight * z[i];
                for (sum, z) in sums[from..].iter_mut().zip(&z[from..]) {
                    *sum += factor * z;
                }
            }
        }
        Some(sums)
    }
}

/// The scatter of a problem's rows at the given ratios, or `None` when a row is next to a
/// pole. Movements are summed in their order, so the bytes do not depend on the threads.
pub fn scatter(problem: &Problem, ratios: &Ratios, offsets: &[Offset]) -> Option<Scatter> {
    if problem.model.fitted_slopes() <= 3 {
        scatter_of::<3, { U + 10 }>(problem, ratios, offsets)
    } else {
        scatter_of::<SLOPES_MAX, ROOM>(problem, ratios, offsets)
    }
}

fn scatter_of<const K: usize, const W: usize>(
    problem: &Problem,
    ratios: &Ratios,
    offsets: &[Offset],
) -> Option<Scatter> {
    let one = |(group, offset): (&Group, &Offset)| {
        pulp::Arch::new().dispatch(GroupSums::<K, W> {
            rows: &problem.rows[group.rows.clone()],
            ratios,
            offset: *offset,
        })
    };
    let mut sums = [[0.0; W]; W];
    let mut add = |group: &[[f64; W]; W]| {
        for (sums, group) in sums.iter_mut().zip(group) {
            for (sum, group) in sums.iter_mut().zip(group) {
                *sum += group;
            }
        }
    };
    // Small problems are done before another thread would wake up.
    if problem.rows.len() < 4000 {
        for group in problem.groups.iter().zip(offsets) {
            add(&one(group)?);
        }
    } else {
        let each: Vec<_> = problem.groups.par_iter().zip(offsets).map(one).collect();
        for group in each {
            add(&group?);
        }
    }
    let place = |i: usize| match i.checked_sub(U) {
        Some(u) => U + u / K * SLOPES_MAX + u % K,
        None => i,
    };
    let mut total = Scatter::zeros();
    for i in 0..U + 3 * K {
        for j in i..U + 3 * K {
            total[(place(i), place(j))] = sums[i][j];
        }
    }
    for i in 0..WIDTH {
        for j in 0..i {
            total[(i, j)] = total[(j, i)];
        }
    }
    Some(total)
}
