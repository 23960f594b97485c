//! Sums over rows from which every step of the least-squares fit follows.
//!
//! With the ratios r = (a, b, c) / eta of each probe given, the pose is linear in the corrected
//! signals s' = s / (1 + r v): q = G s' - o, with G = PM^-1 diag(1/eta) and one offset o for each
//! movement. The derivative of s'_i with respect to r_ik is u_ik = -s'_i v_k / (1 + r_i v). So
//! the products of the 15 numbers (s', u, q), each less its mean over the movement where the
//! offset is free, hold all that cost, gradient and curvature need: one pass over the rows for
//! each set of ratios, whatever the number of movements.

use crate::problem::{Problem, TrainRow};
use nalgebra::SMatrix;
use rayon::prelude::*;

/// Corrected signals, their derivatives and the reference: 3 + 9 + 3.
pub const WIDTH: usize = 15;
/// Where the derivatives start.
pub const U: usize = 3;
/// Where the reference starts.
pub const Q: usize = 12;

/// (a, b, c) / eta of the probes A, B, C: 1/m, 1/rad, 1/rad.
pub type Ratios = [[f64; 3]; 3];

/// Rows whose 1 + r v is smaller than this are next to a pole, and so is the candidate.
const DENOMINATOR_MIN: f64 = 0.05;

/// The offset of one movement.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Offset {
    /// Chosen for the least cost: the movement's means are taken off.
    Free,
    /// Given, um, um, urad.
    Fixed([f64; 3]),
}

/// Products of the 15 numbers, summed over all rows. Symmetric; only the upper triangle is
/// summed, then mirrored.
pub type Scatter = SMatrix<f64, WIDTH, WIDTH>;

/// The 15 numbers of one row, or `None` next to a pole of 1 / (1 + r v).
#[inline(always)]
pub fn regressors(row: &TrainRow, ratios: &Ratios) -> Option<[f64; WIDTH + 1]> {
    let v = row.vertical;
    let mut z = [0.0; WIDTH + 1];
    let mut smallest = f64::INFINITY;
    for probe in 0..3 {
        let r = ratios[probe];
        let denominator = 1.0 + (r[0] * v[0] + r[1] * v[1] + r[2] * v[2]);
        smallest = smallest.min(denominator);
        let corrected = row.signal_um[probe] / denominator;
        let slope = -corrected / denominator;
        z[probe] = corrected;
        for axis in 0..3 {
            z[U + 3 * probe + axis] = slope * v[axis];
        }
        z[Q + probe] = row.reference_um[probe];
    }
    (smallest > DENOMINATOR_MIN).then_some(z)
}

/// The mean of the 15 numbers over some rows, or `None` next to a pole.
pub fn mean(rows: &[TrainRow], ratios: &Ratios) -> Option<[f64; WIDTH + 1]> {
    let mut sum = [0.0; WIDTH + 1];
    for row in rows {
        let z = regressors(row, ratios)?;
        for (sum, z) in sum.iter_mut().zip(z) {
            *sum += z;
        }
    }
    let n = rows.len() as f64;
    Some(sum.map(|s| s / n))
}

/// The origin from which the 15 numbers of a movement count: its means where the offset is
/// free, else minus the offset for the reference and zero for the rest.
pub fn origin(rows: &[TrainRow], ratios: &Ratios, offset: Offset) -> Option<[f64; WIDTH + 1]> {
    match offset {
        Offset::Free => mean(rows, ratios),
        Offset::Fixed(o) => {
            let mut origin = [0.0; WIDTH + 1];
            for axis in 0..3 {
                origin[Q + axis] = -o[axis];
            }
            Some(origin)
        }
    }
}

fn group_scatter(
    rows: &[TrainRow],
    ratios: &Ratios,
    offset: Offset,
) -> Option<[[f64; WIDTH + 1]; WIDTH]> {
    let origin = origin(rows, ratios, offset)?;
    let mut sums = [[0.0; WIDTH + 1]; WIDTH];
    for row in rows {
        let mut z = regressors(row, ratios)?;
        for (z, origin) in z.iter_mut().zip(origin) {
            *z -= origin;
        }
        for (i, sums) in sums.iter_mut().enumerate() {
            let from = i & !3;
            let factor = z[i];
            for (sum, z) in sums[from..].iter_mut().zip(&z[from..]) {
                *sum += factor * z;
            }
        }
    }
    Some(sums)
}

/// The scatter of a problem's rows at the given ratios, or `None` when a row is next to a
/// pole. Movements are summed in their order, so the bytes do not depend on the threads.
pub fn scatter(problem: &Problem, ratios: &Ratios, offsets: &[Offset]) -> Option<Scatter> {
    let one = |(group, offset): (&crate::problem::Group, &Offset)| {
        group_scatter(&problem.rows[group.rows.clone()], ratios, *offset)
    };
    // Small problems are done before another thread would wake up.
    let groups: Vec<_> = if problem.rows.len() < 4000 {
        problem.groups.iter().zip(offsets).map(one).collect()
    } else {
        problem.groups.par_iter().zip(offsets).map(one).collect()
    };
    let mut total = Scatter::zeros();
    for group in groups {
        let group = group?;
        for i in 0..WIDTH {
            for j in i..WIDTH {
                total[(i, j)] += group[i][j];
            }
        }
    }
    for i in 0..WIDTH {
        for j in 0..i {
            total[(i, j)] = total[(j, i)];
        }
    }
    Some(total)
}
