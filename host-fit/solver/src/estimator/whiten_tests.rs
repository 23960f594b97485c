//! The columns of motion, and the filter that whitens the rows.

use super::*;
use crate::estimator::sample_for_tests::{Run, parameters};
use nalgebra::{Cholesky, DMatrix};

const RESIDUAL: usize = COLUMNS - 1;

/// Central differences of the residuals, about a stage with lags and accelerations.
#[test]
fn the_columns_of_motion_are_the_derivatives_of_the_model() {
    let run = Run {
        seconds: 1.0,
        ..Run::EIGHT_SECONDS
    };
    let dataset = run.dataset(&parameters());
    let all: Vec<usize> = (0..dataset.rows.len()).collect();
    let rows = Rows::new(&dataset, &all);
    let at = |unknown: usize, change: f64| {
        let mut values = [0.0; UNKNOWNS];
        values[LAG..ACCELERATIONS].copy_from_slice(&[2e-3, -1e-3, 4e-4]);
        values[ACCELERATIONS..].fill(2e-3);
        values[unknown] += change;
        let dynamics = Dynamics::from_values(&values);
        rows.evaluate(&probes(&parameters()), &dynamics, &[[0.0; 3]])
    };
    for unknown in LAG..UNKNOWNS {
        let step = 1e-4;
        let (before, after) = (at(unknown, -step), at(unknown, step));
        let mut largest: f64 = 0.0;
        for (k, block) in at(unknown, 0.0).iter().enumerate() {
            let found: [[f64; COLUMNS]; 3] = columns(block);
            for (probe, row) in found.iter().enumerate() {
                let change = before[k].residual_m[probe] - after[k].residual_m[probe];
                let error = (row[unknown] - change / (2.0 * step)).abs();
                assert!(error < 1e-6, "{unknown}, {probe}: {error}");
                largest = largest.max(row[unknown].abs());
            }
        }
        assert!(largest > 1e-3, "{unknown}: {largest}");
    }
}

/// The same sums from the covariance of all residuals of each movement, written out whole:
/// white noise, walk and offset.
#[test]
fn the_filter_whitens_as_the_whole_covariance_does() {
    let run = Run {
        movements: 2,
        seconds: 0.3,
        ..Run::EIGHT_SECONDS
    };
    let dataset = run.dataset(&parameters());
    let all: Vec<usize> = (0..dataset.rows.len()).collect();
    let rows = Rows::new(&dataset, &all);
    let blocks = rows.evaluate(&probes(&parameters()), &Dynamics::default(), &[[0.0; 3]; 2]);
    let noise = Noise {
        white_m: [5e-7, 4e-7, 6e-7],
        drift: [1e-6, 2e-6, 5e-7],
    };
    for resets in [None, Some([2e-6, 3e-6, 1e-6])] {
        let reset = resets.unwrap_or([OFFSET_M; 3]);
        let equations = FieldEquations {
            rows: &rows,
            places: parameters().places,
            noise,
            resets,
            faults: &[],
        };
        let found = equations.sum_blocks(&blocks);

        let mut products = DMatrix::<f64>::zeros(COLUMNS, COLUMNS);
        for movement in &rows.movements {
            let blocks = &blocks[movement.clone()];
            assert!(blocks.len() > 10);
            let covariance = DMatrix::from_fn(3 * blocks.len(), 3 * blocks.len(), |i, j| {
                let (a, b) = (&blocks[i / 3], &blocks[j / 3]);
                let time_s = a.time_s.min(b.time_s) - blocks[0].time_s;
                let shared: f64 = (0..3)
                    .map(|axis| {
                        let walk = noise.drift[axis].powi(2) * time_s + reset[axis].powi(2);
                        a.by_pose[i % 3][axis] * walk * b.by_pose[j % 3][axis]
                    })
                    .sum();
                let white = noise.white_m[i % 3].powi(2) / a.rows;
                shared + if i == j { white } else { 0.0 }
            });
            let columns = DMatrix::from_fn(3 * blocks.len(), COLUMNS, |i, j| {
                columns::<COLUMNS>(&blocks[i / 3])[i % 3][j]
            });
            let factor = Cholesky::new(covariance).expect("positive");
            products += columns.transpose() * factor.solve(&columns);
        }
        for i in 0..=RESIDUAL {
            for j in i..=RESIDUAL {
                let size = (products[(i, i)] * products[(j, j)]).sqrt();
                let error = (found.curvature(i, j) - products[(i, j)]).abs();
                assert!(error <= 1e-6 * size, "{i} {j}: {error} {size}");
            }
        }
    }
}
