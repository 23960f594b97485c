//! The sums of `scatter` for any ratios, after one pass over the rows: where the vertical pose
//! stands still within each movement.
//!
//! Let v0 be a vertical pose (or other factors of the slopes), v = v0 + d that of a row and
//! D = 1 + r v0. To first order in d,
//!
//! ```text
//! s' = s / D - sum over l of r_l (s d_l) / D^2
//! u_k = -v0_k s / D^2 + 2 v0_k sum over l of r_l (s d_l) / D^3 - (s d_k) / D^2
//! ```
//!
//! are linear in the numbers b = (s, q, s d) of a row, which no ratio is part of. So their products,
//! each less its mean over the movement, are summed once, in one matrix for all movements at
//! the same vertical pose; for given ratios a product with a small matrix on either side gives
//! the scatter. What is left out is of second order in d: 1e-8 of the sums at 12 nm of
//! capacitive noise, below the rounding of a parameter to f32.

use super::scatter::{DENOMINATOR_MIN, Offset, Q, Ratios, Scatter, U};
use crate::problem::model::SLOPES_MAX;
use crate::problem::{Group, Problem, TrainRow};
use pulp::{Simd, WithSimd};
use rayon::prelude::*;

/// Slopes of a model that this is for.
const K: usize = 3;
/// The numbers of a row, s of the three probes, q, then s d by probe, with room for whole SIMD registers.
const W: usize = (U + 3 * K).next_multiple_of(8);
/// Rows of which the products are added up in registers.
const BLOCK: usize = 8;
/// The vertical pose stands still if no row of a movement is farther from its mean than this, m or
/// rad: sensors' noise, and not the servo's steps.
const STILL: f64 = 2e-6;
/// Where (r d)^2 of the worst row is below this, what is left out is in the mean of all rows below
/// the rounding of a parameter to f32.
const LEFT_OUT_MAX: f64 = 1e-7;

/// Vertical poses at most: each takes 3 kB, and is compared with those of all movements.
const POSES_MAX: usize = 1_000;

type Numbers = [f64; W];
type Products = [Numbers; W];

/// Movements at one vertical pose.
#[derive(Clone, Debug)]
struct Pose {
    /// v0.
    at: [f64; K],
    /// Largest magnitudes of d.
    deviation: [f64; K],
    /// Of the numbers less their means over the movement, by the weights of the rows: only the
    /// upper triangle is right.
    products: Products,
}

/// One movement.
#[derive(Clone, Debug)]
struct Means {
    pose: usize,
    /// Sum of the weights.
    weight: f64,
    numbers: Numbers,
}

/// Sums over the rows of a problem.
#[derive(Clone, Debug)]
pub struct Moments {
    poses: Vec<Pose>,
    /// By group of the problem.
    means: Vec<Means>,
}

impl Moments {
    /// `None` where a movement does not stand still in Z, Rx and Ry, the movements do so at too many
    /// places, or the model has other slopes too.
    pub fn new(problem: &Problem<'_>) -> Option<Self> {
        if problem.model.fitted_slopes() > K {
            return None;
        }
        let middle = |group: &Group| middle(&problem.rows[group.rows.clone()]);
        let middles: Vec<[f64; K]> = (problem.groups.par_iter())
            .map(middle)
            .collect::<Option<_>>()?;
        let mut poses: Vec<Pose> = Vec::new();
        let mut pose_of = Vec::with_capacity(middles.len());
        for middle in middles {
            let near = |pose: &Pose| (0..K).all(|k| (pose.at[k] - middle[k]).abs() <= 0.5 * STILL);
            pose_of.push(poses.iter().position(near).unwrap_or(poses.len()));
            if pose_of.last() == Some(&poses.len()) {
                if poses.len() == POSES_MAX {
                    return None;
                }
                poses.push(Pose {
                    at: middle,
                    deviation: [0.0; K],
                    products: [[0.0; W]; W],
                });
            }
        }
        let sums = |(group, &pose): (&Group, &usize)| {
            let at = poses[pose].at;
            pulp::Arch::new().dispatch(OfMovement {
                rows: &problem.rows[group.rows.clone()],
                at,
            })
        };
        let each: Vec<MovementSums> = (problem.groups.par_iter())
            .zip(&pose_of)
            .map(sums)
            .collect();
        let mut means = Vec::with_capacity(each.len());
        for (sums, number) in each.into_iter().zip(pose_of) {
            let pose = &mut poses[number];
            for (into, from) in pose.products.iter_mut().zip(&sums.products) {
                for (into, from) in into.iter_mut().zip(from) {
                    *into += from;
                }
            }
            for (most, deviation) in pose.deviation.iter_mut().zip(sums.deviation) {
                *most = most.max(deviation);
            }
            means.push(Means {
                pose: number,
                weight: sums.weight,
                numbers: sums.mean,
            });
        }
        Some(Self { poses, means })
    }

    /// The scatter at the given ratios, as of the rows; `None` where a row is next to a pole.
    pub fn scatter(&self, ratios: &Ratios, offsets: &[Offset]) -> Option<Scatter> {
        let mut total = Scatter::zeros();
        let bases: Vec<Basis> = (self.poses.iter())
            .map(|pose| Basis::new(pose, ratios))
            .collect::<Option<_>>()?;
        for (pose, basis) in self.poses.iter().zip(&bases) {
            basis.add_products(&pose.products, &mut total);
        }
        for (means, offset) in self.means.iter().zip(offsets) {
            let Offset::Fixed(offset) = offset else {
                continue;
            };
            let mut mean = bases[means.pose].numbers(&means.numbers);
            for axis in 0..3 {
                mean[Q + axis] += offset[axis];
            }
            total.ger(means.weight, &mean, &mean, 1.0);
        }
        total.fill_lower_triangle_with_upper_triangle();
        Some(total)
    }

    /// The means of s' and q over the movement of a group; `None` next to a pole.
    pub fn mean(&self, group: usize, ratios: &Ratios) -> Option<[f64; U]> {
        let means = &self.means[group];
        let basis = Basis::new(&self.poses[means.pose], ratios)?;
        let mean = basis.numbers(&means.numbers);
        Some(std::array::from_fn(|k| mean[k]))
    }

    /// Whether what is left out does not matter at these ratios.
    pub fn hold(&self, ratios: &Ratios) -> bool {
        let left_out = |pose: &Pose| {
            let each = ratios.iter().map(|r| {
                let change: f64 = (0..K).map(|k| (r[k] * pose.deviation[k]).abs()).sum();
                change * change
            });
            each.fold(0.0, f64::max)
        };
        self.poses.iter().all(|pose| left_out(pose) <= LEFT_OUT_MAX)
    }
}

/// The mean of the factors of the slopes; `None` if a row is far from it.
fn middle(rows: &[TrainRow]) -> Option<[f64; K]> {
    let (mut low, mut high) = ([f64::INFINITY; K], [f64::NEG_INFINITY; K]);
    let mut sum = [0.0; K];
    for row in rows {
        for k in 0..K {
            low[k] = low[k].min(row.slopes[k]);
            high[k] = high[k].max(row.slopes[k]);
            sum[k] += row.slopes[k];
        }
    }
    let still = (0..K).all(|k| high[k] - low[k] <= STILL);
    still.then(|| sum.map(|sum| sum / rows.len() as f64))
}

/// The sums over one movement.
struct MovementSums {
    weight: f64,
    mean: Numbers,
    products: Products,
    deviation: [f64; K],
}

/// The pass over the rows of a movement: a type and not a closure, since closures are not always
/// inlined into the function that is compiled for the instruction set.
struct OfMovement<'r> {
    rows: &'r [TrainRow],
    at: [f64; K],
}

impl OfMovement<'_> {
    #[inline(always)]
    fn numbers(&self, row: &TrainRow) -> Numbers {
        let mut b = [0.0; W];
        for probe in 0..3 {
            b[probe] = row.signal_um[probe];
            b[Q + probe] = row.reference_um[probe];
            for k in 0..K {
                b[U + K * probe + k] = row.signal_um[probe] * (row.slopes[k] - self.at[k]);
            }
        }
        b
    }
}

/// Numbers of some rows and their products, aligned to the widest SIMD registers.
#[repr(C, align(64))]
struct Work {
    products: Products,
    numbers: [Numbers; BLOCK],
    /// The numbers times the weight of the row; 0 beyond the last row.
    weighted: [Numbers; BLOCK],
}

impl WithSimd for OfMovement<'_> {
    type Output = MovementSums;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> MovementSums {
        // About the first row, near which the means are, and then about the means.
        let origin = self.rows.first().map_or([0.0; W], |row| self.numbers(row));
        let mut weight = 0.0;
        let mut sum = [0.0; W];
        let mut deviation = [0.0f64; K];
        let mut work = Work {
            products: [[0.0; W]; W],
            numbers: [[0.0; W]; BLOCK],
            weighted: [[0.0; W]; BLOCK],
        };
        for rows in self.rows.chunks(BLOCK) {
            work.weighted = [[0.0; W]; BLOCK];
            for (at, row) in rows.iter().enumerate() {
                let mut b = self.numbers(row);
                for (b, origin) in b.iter_mut().zip(origin) {
                    *b -= origin;
                }
                work.numbers[at] = b;
                work.weighted[at] = b.map(|b| row.weight * b);
                for (sum, b) in sum.iter_mut().zip(work.weighted[at]) {
                    *sum += b;
                }
                weight += row.weight;
                for ((most, slope), at) in deviation.iter_mut().zip(row.slopes).zip(self.at) {
                    *most = most.max((slope - at).abs());
                }
            }
            // In whole registers, from the one with the diagonal on.
            for (i, products) in work.products.iter_mut().enumerate() {
                let (sums, _) = S::as_mut_simd_f64s(products);
                for (j, sum) in sums.iter_mut().enumerate().skip(i / S::F64_LANES) {
                    for (b, weighted) in work.numbers.iter().zip(&work.weighted) {
                        let (b, _) = S::as_simd_f64s(b);
                        let product = simd.mul_f64s(simd.splat_f64s(weighted[i]), b[j]);
                        *sum = simd.add_f64s(*sum, product);
                    }
                }
            }
        }
        let mean = sum.map(|sum| sum / weight);
        for (products, mean_i) in work.products.iter_mut().zip(mean) {
            for (product, mean_j) in products.iter_mut().zip(mean) {
                *product -= weight * mean_i * mean_j;
            }
        }
        MovementSums {
            weight,
            mean: std::array::from_fn(|k| origin[k] + mean[k]),
            products: work.products,
            deviation,
        }
    }
}

/// What makes (s', u) of each probe of its (s, s d) at given ratios.
struct Basis([[[f64; 1 + K]; 1 + K]; 3]);

/// Where s and s d of a probe stand among the numbers of a row.
const fn places(probe: usize) -> [usize; 1 + K] {
    let d = U + K * probe;
    [probe, d, d + 1, d + 2]
}

/// Where s' and u of a probe stand in the scatter.
const fn scatter_places(probe: usize) -> [usize; 1 + K] {
    let u = U + SLOPES_MAX * probe;
    [probe, u, u + 1, u + 2]
}

impl Basis {
    /// `None` next to a pole.
    fn new(pose: &Pose, ratios: &Ratios) -> Option<Self> {
        let mut basis = [[[0.0; 1 + K]; 1 + K]; 3];
        for (basis, r) in basis.iter_mut().zip(ratios) {
            let mut denominator = 1.0;
            let mut nearer = 0.0;
            for ((r, at), deviation) in r.iter().zip(pose.at).zip(pose.deviation) {
                denominator += r * at;
                nearer += (r * deviation).abs();
            }
            if denominator - nearer <= DENOMINATOR_MIN {
                return None;
            }
            let one = 1.0 / denominator;
            let (two, three) = (one * one, one * one * one);
            basis[0][0] = one;
            for l in 0..K {
                basis[0][1 + l] = -r[l] * two;
            }
            for k in 0..K {
                basis[1 + k][0] = -pose.at[k] * two;
                for l in 0..K {
                    basis[1 + k][1 + l] = 2.0 * pose.at[k] * r[l] * three;
                }
                basis[1 + k][1 + k] -= two;
            }
        }
        Some(Self(basis))
    }

    /// The numbers of the scatter from those of a row, or from their means.
    fn numbers(&self, b: &Numbers) -> nalgebra::SVector<f64, { super::scatter::WIDTH }> {
        let mut z = nalgebra::SVector::zeros();
        for axis in 0..3 {
            z[Q + axis] = b[Q + axis];
        }
        for (probe, basis) in self.0.iter().enumerate() {
            let from = places(probe);
            for (place, basis) in scatter_places(probe).into_iter().zip(basis) {
                for (factor, from) in basis.iter().zip(from) {
                    z[place] += factor * b[from];
                }
            }
        }
        z
    }

    /// Adds the products of the numbers of the scatter, its upper triangle, from those of the rows.
    fn add_products(&self, products: &Products, total: &mut Scatter) {
        let product = |i: usize, j: usize| products[i.min(j)][i.max(j)];
        for i in 0..3 {
            for j in i..3 {
                total[(Q + i, Q + j)] += product(Q + i, Q + j);
            }
        }
        for (probe, basis) in self.0.iter().enumerate() {
            let (from, into) = (places(probe), scatter_places(probe));
            for axis in 0..3 {
                let with_q = from.map(|place| product(place, Q + axis));
                for (place, basis) in into.into_iter().zip(basis) {
                    let sum = dot(basis, &with_q);
                    total[(place.min(Q + axis), place.max(Q + axis))] += sum;
                }
            }
            for (other, by_other) in self.0.iter().enumerate().skip(probe) {
                let (other_from, other_into) = (places(other), scatter_places(other));
                // One row for each number of this probe, one column for each of the other's.
                let half = from.map(|row| {
                    let row = other_from.map(|column| product(row, column));
                    by_other.map(|by_other| dot(&by_other, &row))
                });
                for (row, basis) in into.into_iter().zip(basis) {
                    for (k, column) in other_into.into_iter().enumerate() {
                        let column_of_half = [half[0][k], half[1][k], half[2][k], half[3][k]];
                        if row <= column {
                            total[(row, column)] += dot(basis, &column_of_half);
                        } else if probe != other {
                            total[(column, row)] += dot(basis, &column_of_half);
                        }
                    }
                }
            }
        }
    }
}

fn dot(a: &[f64; 1 + K], b: &[f64; 1 + K]) -> f64 {
    ((a[0] * b[0] + a[1] * b[1]) + a[2] * b[2]) + a[3] * b[3]
}

#[cfg(test)]
mod tests;
