//! What the model makes of rows: residuals, and means over blocks with their derivatives.

use super::dynamics::Dynamics;
use super::probe::{Probe, Reading};
use super::rows::{FieldRow, Rows};
use super::terms::PER_PROBE;
use rayon::prelude::*;
use std::ops::Range;

/// Mean residuals and derivatives of a block.
#[derive(Clone, Debug)]
pub struct Block {
    /// Mean time of its rows, s.
    pub time_s: f64,
    /// How many rows: the sum of their weights.
    pub rows: f64,
    /// Signal less model of A, B, C, m.
    pub residual_m: [f64; 3],
    /// Derivatives of the model by X, Y (m), Rz (rad).
    pub by_pose: [[f64; 3]; 3],
    /// Derivatives by each probe's own parameters.
    pub by_parameter: [[f64; PER_PROBE]; 3],
    /// Derivatives by the lag of the reference, m/s.
    pub by_lag: [f64; 3],
    /// Derivatives by each probe's own lag, m/s.
    pub by_probe_lag: [f64; 3],
    /// Mean of [`FieldRow::acceleration_m_s2`].
    pub acceleration_m_s2: [f64; 6],
    /// Derivatives by k and h of each probe, m K.
    pub by_temperature: [[f64; 2]; 3],
}

impl Rows {
    /// The blocks at given parameters and offsets of the reference (m, m, rad) by movement.
    pub fn evaluate(
        &self,
        probes: &[Probe; 3],
        dynamics: &Dynamics,
        offsets: &[[f64; 3]],
    ) -> Vec<Block> {
        let in_movement = |(movement, &offset): (usize, &[f64; 3])| {
            self.evaluate_movement(movement, probes, dynamics, offset)
        };
        offsets
            .par_iter()
            .enumerate()
            .flat_map(in_movement)
            .collect()
    }

    /// The blocks of a movement of [`movements`](Self::movements), as in [`Rows::evaluate`].
    pub fn evaluate_movement(
        &self,
        movement: usize,
        probes: &[Probe; 3],
        dynamics: &Dynamics,
        offset: [f64; 3],
    ) -> Vec<Block> {
        self.blocks[self.movements[movement].clone()]
            .par_iter()
            .with_min_len(64)
            .map(|block| mean(&self.rows[block.clone()], probes, dynamics, offset))
            .collect()
    }

    /// Signal less model of every row, m, as in [`Rows::evaluate`].
    pub fn residuals_m(
        &self,
        probes: &[Probe; 3],
        dynamics: &Dynamics,
        offsets: &[[f64; 3]],
    ) -> Vec<[f64; 3]> {
        let in_movement = |(range, &offset): (Range<usize>, &[f64; 3])| {
            let residual = move |row: &FieldRow| {
                [0, 1, 2].map(|k| {
                    let [planar, vertical] = row.pose(dynamics, k, offset);
                    let gain = probes[k].gain(row.temperature_k[k]);
                    let read_m = row.signal_m[k] - dynamics.added_m(k, row.acceleration_m_s2);
                    read_m - gain * probes[k].signal_m(planar, vertical)
                })
            };
            self.rows[range].par_iter().with_min_len(256).map(residual)
        };
        let movements: Vec<_> = self.movement_rows().zip(offsets).collect();
        movements.into_par_iter().flat_map(in_movement).collect()
    }
}

fn mean(rows: &[FieldRow], probes: &[Probe; 3], dynamics: &Dynamics, offset: [f64; 3]) -> Block {
    let mut sum = Block {
        time_s: 0.0,
        rows: 0.0,
        residual_m: [0.0; 3],
        by_pose: [[0.0; 3]; 3],
        by_parameter: [[0.0; PER_PROBE]; 3],
        by_lag: [0.0; 3],
        by_probe_lag: [0.0; 3],
        acceleration_m_s2: [0.0; 6],
        by_temperature: [[0.0; 2]; 3],
    };
    for row in rows {
        sum.rows += row.weight;
        sum.time_s += row.weight * row.time_s;
        for (sum, x) in sum.acceleration_m_s2.iter_mut().zip(row.acceleration_m_s2) {
            *sum += row.weight * x;
        }
        for (k, probe) in probes.iter().enumerate() {
            let [planar, vertical] = row.pose(dynamics, k, offset);
            let Reading {
                signal_m,
                by_pose,
                by_vertical,
                by_parameter,
            } = probe.read(planar, vertical);
            let gain = probe.gain(row.temperature_k[k]);
            let read_m = row.signal_m[k] - dynamics.added_m(k, row.acceleration_m_s2);
            sum.residual_m[k] += row.weight * (read_m - gain * signal_m);
            for (sum, temperature_k) in sum.by_temperature[k].iter_mut().zip(row.temperature_k[k]) {
                *sum += row.weight * signal_m * temperature_k;
            }
            for (axis, by) in by_pose.into_iter().enumerate() {
                let by = row.weight * gain * by;
                sum.by_pose[k][axis] += by;
                sum.by_lag[k] += by * row.rate[axis];
                let by_vertical = row.weight * gain * by_vertical[axis];
                sum.by_probe_lag[k] -= by * row.rate[axis] + by_vertical * row.rate[3 + axis];
            }
            for (sum, by) in sum.by_parameter[k].iter_mut().zip(by_parameter) {
                *sum += row.weight * gain * by;
            }
        }
    }
    let share = 1.0 / sum.rows;
    sum.time_s *= share;
    sum.acceleration_m_s2.iter_mut().for_each(|x| *x *= share);
    for k in 0..3 {
        sum.residual_m[k] *= share;
        sum.by_lag[k] *= share;
        sum.by_probe_lag[k] *= share;
        sum.by_pose[k].iter_mut().for_each(|x| *x *= share);
        sum.by_parameter[k].iter_mut().for_each(|x| *x *= share);
        sum.by_temperature[k].iter_mut().for_each(|x| *x *= share);
    }
    sum
}
