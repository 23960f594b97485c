//! Rows of a log with their rates, by movement and in short blocks.
//!
//! Neighbouring rows see nearly the same pose: the mean of a few rows' residuals and derivatives
//! holds their information on the parameters, and is a tenth of the work for all that follows. The
//! estimate has no bias from it, since residuals and derivatives are evaluated at each row.

use super::derivatives::{SAMPLES, SIDE_US, second_derivatives};
use super::dynamics::{ARMS_M, Dynamics};
use crate::estimator::robust::HALF;
use hallstage_input::dataset::{Dataset, Row};
use hallstage_input::stage;
use rayon::prelude::*;
use runtime::CommandedMotion;
use std::ops::Range;

/// Most rows of a block.
const ROWS_MAX: usize = 10;
/// A block ends where an axis has moved by more than this part of its range over the log: what
/// differs within a block is lost, here below a thousandth of the information.
const MOTION_MAX: f64 = 0.06;
/// A block ends after this time, s: the reference drifts.
const TIME_MAX_S: f64 = 0.05;
/// Rows that thinned rows have of a movement at least, if it moves.
const MOVING_ROWS_MIN: usize = 8;
/// Rows that they have of a movement that stands still.
const IDLE_ROWS: usize = 2;
/// A movement of less than this share of the largest one stands still.
const IDLE_SHARE: f64 = 0.01;

/// One row.
#[derive(Clone, Copy, Debug)]
pub struct FieldRow {
    /// Time within the log, s.
    pub time_s: f64,
    /// See [`Row::signal_m`].
    pub signal_m: [f64; 3],
    /// See [`Row::vertical`].
    pub vertical: [f64; 3],
    /// See [`Row::reference`].
    pub reference: [f64; 3],
    /// Change of X, Y, Rz by the reference and of Z, Rx, Ry by time: m/s, rad/s.
    pub rate: [f64; 6],
    /// Acceleration along X, Y, of Rz at [`ARM_M`](super::dynamics::ARM_M), along Z, of Rx and Ry there, m/s2; 0 where rows are missing.
    pub acceleration_m_s2: [f64; 6],
    /// dM and dH over the gain of A, B, C that [`Self::signal_m`] is compensated for, K.
    pub temperature_k: [[f64; 2]; 3],
    /// How much it counts: 1 unless a robust loss says less.
    pub weight: f64,
}

/// The rows of a log that a fit uses, by movement and block.
#[derive(Clone, Debug)]
pub struct Rows {
    /// The rows, movement after movement.
    pub rows: Vec<FieldRow>,
    /// The blocks: rows of one movement that follow each other.
    pub blocks: Vec<Range<usize>>,
    /// The blocks of each movement that has rows.
    pub movements: Vec<Range<usize>>,
    /// The number of each of these movements in the log.
    pub numbers: Vec<usize>,
    /// Movements of the whole log, with or without rows here.
    pub movements_of_log: usize,
    /// Largest magnitudes of X, Y, Rz (m, m, rad), each movement's middle taken off.
    pub planar_range: [f64; 3],
    /// Largest magnitudes of Z, Rx, Ry: m, rad, rad.
    pub vertical_range: [f64; 3],
}

impl Rows {
    /// The rows `selected` (ascending) of a dataset.
    pub fn new(dataset: &Dataset, selected: &[usize]) -> Self {
        Self::weighted(dataset, selected, &vec![1.0; selected.len()])
    }

    /// The rows `selected` with weights. A row of weight zero is left out; a row below half weight is not used for its
    /// neighbours' rates.
    pub fn weighted(dataset: &Dataset, selected: &[usize], weights: &[f64]) -> Self {
        let mut trusted = vec![true; dataset.rows.len()];
        for (&k, &weight) in selected.iter().zip(weights) {
            trusted[k] = weight >= HALF;
        }
        let used = selected.iter().copied().zip(weights.iter().copied());
        // Their number known before, for a vector that never grows.
        let used: Vec<(usize, f64)> = used.filter(|(_, weight)| *weight > 0.0).collect();
        let row = |&(k, weight): &(usize, f64)| field_row(dataset, k, &trusted, weight);
        let rows: Vec<FieldRow> = used.par_iter().map(row).collect();
        let (mut movements, mut numbers) = (Vec::new(), Vec::new());
        let mut start = 0;
        let movement = |(k, _): &(usize, f64)| dataset.rows[*k].movement;
        for chunk in used.chunk_by(|a, b| movement(a) == movement(b)) {
            numbers.extend(chunk.first().map(movement));
            movements.push(start..start + chunk.len());
            start += chunk.len();
        }
        Self {
            numbers,
            movements_of_log: dataset.movements.len(),
            ..Self::from_movements(rows, movements)
        }
    }

    /// Rows in time order, and where each movement stands among them.
    pub fn from_movements(rows: Vec<FieldRow>, movements: Vec<Range<usize>>) -> Self {
        let (planar_range, vertical_range) = ranges(&rows, &movements);
        let most = six(planar_range, vertical_range).map(|range| 2.0 * MOTION_MAX * range);
        let mut blocks: Vec<Range<usize>> = Vec::new();
        let mut by_movement = Vec::with_capacity(movements.len());
        for movement in movements {
            let first = blocks.len();
            let mut start = movement.start;
            for k in movement.clone() {
                let (a, b) = (&rows[start], &rows[k]);
                let [from, to] = [a, b].map(|row| six(row.reference, row.vertical));
                let moved = |axis: usize| (to[axis] - from[axis]).abs() > most[axis];
                if k - start >= ROWS_MAX || b.time_s - a.time_s > TIME_MAX_S || (0..6).any(moved) {
                    blocks.push(start..k);
                    start = k;
                }
            }
            blocks.push(start..movement.end);
            by_movement.push(first..blocks.len());
        }
        Self {
            rows,
            blocks,
            numbers: (0..by_movement.len()).collect(),
            movements_of_log: by_movement.len(),
            movements: by_movement,
            planar_range,
            vertical_range,
        }
    }

    /// Means over blocks that follow each other, as rows and blocks of their own, hardly more than `most`;
    /// and the first row of each. Rows without weight are left out.
    #[must_use]
    pub fn means(&self, most: usize) -> (Self, Vec<usize>) {
        let together = self.blocks.len().div_ceil(most).max(1);
        let (mut rows, mut movements, mut first) = (Vec::new(), Vec::new(), Vec::new());
        for movement in &self.movements {
            let start = rows.len();
            for some in self.blocks[movement.clone()].chunks(together) {
                let some = some[0].start..some[some.len() - 1].end;
                let mean = mean_row(&self.rows[some.clone()]);
                if mean.weight > 0.0 {
                    first.push(some.start);
                    rows.push(mean);
                }
            }
            if rows.len() > start {
                movements.push(start..rows.len());
            }
        }
        let means = Self {
            blocks: (0..rows.len()).map(|k| k..k + 1).collect(),
            rows,
            numbers: (0..movements.len()).collect(),
            movements,
            ..*self
        };
        (means, first)
    }

    /// About `most` of the rows: the same number from each movement that moves, evenly, and at least
    /// eight, since fewer rows would say little beside the zero deviation that they share; two from each that
    /// does not.
    #[must_use]
    pub fn thinned(&self, most: usize) -> Self {
        let movements: Vec<Range<usize>> = self.movement_rows().collect();
        let moved: Vec<f64> = (movements.par_iter())
            .map(|rows| ranges(&self.rows, std::slice::from_ref(rows)).0)
            .map(|ranges| ranges.into_iter().fold(0.0, f64::max))
            .collect();
        let idle = IDLE_SHARE * moved.iter().copied().fold(0.0, f64::max);
        let moving = moved.iter().filter(|moved| **moved > idle).count();
        let quota = (most / moving.max(1)).max(MOVING_ROWS_MIN);
        let (mut rows, mut thinned) = (Vec::with_capacity(most), Vec::new());
        for (movement, moved) in movements.into_iter().zip(moved) {
            let wanted = if moved > idle { quota } else { IDLE_ROWS };
            let stride = movement.len().div_ceil(wanted).max(1);
            let start = rows.len();
            rows.extend(self.rows[movement].iter().step_by(stride));
            thinned.push(start..rows.len());
        }
        Self {
            numbers: self.numbers.clone(),
            movements_of_log: self.movements_of_log,
            ..Self::from_movements(rows, thinned)
        }
    }

    /// Number in the log and rows of each movement.
    pub fn numbered_movements(&self) -> impl Iterator<Item = (usize, Range<usize>)> {
        self.numbers.iter().copied().zip(self.movement_rows())
    }

    /// Rows of each movement.
    pub fn movement_rows(&self) -> impl Iterator<Item = Range<usize>> {
        let rows = |blocks: &Range<usize>| {
            self.blocks[blocks.start].start..self.blocks[blocks.end - 1].end
        };
        self.movements.iter().map(rows)
    }
}

impl FieldRow {
    /// Where the stage was: the reference with its lag and its offset taken off.
    #[inline(always)]
    pub fn planar(&self, lag_s: f64, offset: [f64; 3]) -> [f64; 3] {
        let at = |k: usize| (self.reference[k] + self.rate[k] * lag_s) + offset[k];
        [at(0), at(1), at(2)]
    }

    /// X, Y, Rz (m, m, rad) and Z, Rx, Ry (m, rad, rad) when a probe was read.
    #[inline(always)]
    pub fn pose(&self, dynamics: &Dynamics, probe: usize, offset: [f64; 3]) -> [[f64; 3]; 2] {
        let late_s = dynamics.probe_lag_s[probe];
        let vertical = |k: usize| self.vertical[k] - self.rate[3 + k] * late_s;
        [
            self.planar(dynamics.lag_s - late_s, offset),
            [0, 1, 2].map(vertical),
        ]
    }
}

fn field_row(dataset: &Dataset, index: usize, trusted: &[bool], weight: f64) -> FieldRow {
    let row = &dataset.rows[index];
    let acceleration = acceleration(dataset, index, trusted);
    let temperature = &dataset.temperature;
    let temperature_mc = row.frame.temperature_mc();
    let changes_k = temperature.changes_k(temperature_mc);
    let gain = temperature.gain_at(temperature_mc);
    FieldRow {
        temperature_k: gain.map(|gain| changes_k.map(|change| change / gain)),
        time_s: row.t_us as f64 * 1e-6,
        signal_m: row.signal_m,
        vertical: row.vertical,
        reference: row.reference,
        rate: speed(dataset, index, trusted),
        acceleration_m_s2: std::array::from_fn(|axis| ARMS_M[axis] * acceleration[axis]),
        weight,
    }
}

/// Numbers of X, Y, Rz and of Z, Rx, Ry.
const fn six([x, y, rz]: [f64; 3], [z, rx, ry]: [f64; 3]) -> [f64; 6] {
    [x, y, rz, z, rx, ry]
}

fn pose(row: &Row) -> [f64; 6] {
    six(row.reference, row.vertical)
}

/// Speed of X, Y, Rz, Z, Rx, Ry at a row, SI: the difference of its neighbours.
fn speed(dataset: &Dataset, index: usize, trusted: &[bool]) -> [f64; 6] {
    let row = &dataset.rows[index];
    let neighbour = |k: Option<usize>| {
        let found = k.filter(|&k| trusted.get(k) == Some(&true));
        let found = found.map(|k| &dataset.rows[k]);
        found
            .filter(|other| other.movement == row.movement)
            .unwrap_or(row)
    };
    let before = neighbour(index.checked_sub(1));
    let after = neighbour(index.checked_add(1));
    let time_s = (after.t_us - before.t_us) as f64 * 1e-6;
    let (from, to) = (pose(before), pose(after));
    let change = |k: usize| {
        if time_s > 0.0 {
            (to[k] - from[k]) / time_s
        } else {
            0.0
        }
    };
    std::array::from_fn(change)
}

/// Acceleration of X, Y, Rz, Z, Rx, Ry at a row, SI; near an end of a movement that of the nearest row with a whole
/// window, and zero where many rows are missing.
fn acceleration(dataset: &Dataset, index: usize, trusted: &[bool]) -> [f64; 6] {
    let movement = dataset.movements[dataset.rows[index].movement].rows.clone();
    let rows = &dataset.rows[movement.clone()];
    let [Some(first), Some(last)] = [rows.first(), rows.last()] else {
        return [0.0; 6];
    };
    let from_us = first.t_us + SIDE_US;
    let middle_us = (dataset.rows[index].t_us).clamp(from_us, from_us.max(last.t_us - SIDE_US));
    let start = rows.partition_point(|row| row.t_us < middle_us - SIDE_US);
    let count = rows[start..].partition_point(|row| row.t_us <= middle_us + SIDE_US);
    let used = (start..start + count)
        .step_by(count.div_ceil(SAMPLES[0]).max(1))
        .filter(|k| trusted[movement.start + k]);
    let sample = |k: usize| ((rows[k].t_us - middle_us) as f64 * 1e-6, pose(&rows[k]));
    second_derivatives(used.map(sample)).unwrap_or([0.0; 6])
}

/// The motion by the reference and the gaps at each row of a dataset. Only the `trusted` rows count.
pub fn measured_motion(dataset: &Dataset, trusted: &[bool]) -> Vec<CommandedMotion> {
    let at = |index: usize| {
        let [x, y, rz, ..] = speed(dataset, index, trusted);
        CommandedMotion {
            velocity: [x, y, rz].map(|x| x as f32),
            acceleration: acceleration(dataset, index, trusted).map(|x| x as f32),
        }
    };
    (0..dataset.rows.len()).into_par_iter().map(at).collect()
}

fn mean_row(rows: &[FieldRow]) -> FieldRow {
    let weight: f64 = rows.iter().map(|row| row.weight).sum();
    let mean = |of: &dyn Fn(&FieldRow) -> f64| {
        rows.iter().map(|row| row.weight * of(row)).sum::<f64>() / weight
    };
    let three = |of: &dyn Fn(&FieldRow) -> [f64; 3]| [0, 1, 2].map(|k| mean(&|row| of(row)[k]));
    FieldRow {
        time_s: mean(&|row| row.time_s),
        signal_m: three(&|row| row.signal_m),
        vertical: three(&|row| row.vertical),
        reference: three(&|row| row.reference),
        rate: std::array::from_fn(|axis| mean(&|row| row.rate[axis])),
        acceleration_m_s2: std::array::from_fn(|axis| mean(&|row| row.acceleration_m_s2[axis])),
        temperature_k: [0, 1, 2]
            .map(|k| [0, 1].map(|sensor| mean(&|row| row.temperature_k[k][sensor]))),
        weight,
    }
}

fn ranges(rows: &[FieldRow], movements: &[Range<usize>]) -> ([f64; 3], [f64; 3]) {
    let (mut planar, mut vertical) = ([0.0f64; 3], [0.0f64; 3]);
    for rows in movements.iter().map(|movement| &rows[movement.clone()]) {
        for axis in 0..3 {
            let range = stage::Range::around(rows.iter().map(|row| row.reference[axis]));
            planar[axis] = planar[axis].max(0.5 * range.width());
            let magnitudes = rows.iter().map(|row| row.vertical[axis].abs());
            vertical[axis] = magnitudes.fold(vertical[axis], f64::max);
        }
    }
    (planar, vertical)
}
