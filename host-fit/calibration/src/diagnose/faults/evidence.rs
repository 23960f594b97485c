//! What the residuals still show after all faults: errors that follow the motion, and slow errors that nothing explains.

use super::estimate::{Estimate, RESIDUAL};
use super::means::Means;
use super::motion::{Follows, Moving};
use super::score::{Step, steps};
use hallstage_solver::estimator::dynamics::{PER_ACCELERATION, PROBE_LAG_S};
use hallstage_solver::estimator::terms::COUNT;
use hallstage_solver::estimator::whiten::{ACCELERATIONS, PROBE_LAGS, UNKNOWNS};
use nalgebra::{DMatrix, DVector, Vector3};
use std::ops::Range;

/// Rows are taken together for this time, s, or longer in logs with more groups than [`GROUPS_MAX`].
const TOGETHER_S: f64 = 0.04;
const GROUPS_MAX: f64 = 2000.0;
/// Errors of channels that are taken into account at most.
const ERRORS_MAX: usize = 8;
/// An error is left out where the parameters can follow all but this part of it: the log hardly shows it.
const SEEN_MIN: f64 = 0.003;
/// An error explains more than chance where chi-square falls by this much: one of 130 in 10,000 sound logs.
const GAIN_MIN: f64 = 28.0;
/// An error of a sensor is taken where the error of a beam explains the log better by less than this: in service there are
/// no beams.
const BEAM_GAIN: f64 = 20.0;
/// Residuals up to 10 Hz and up to 0.5 Hz: means over this time, s, and their power over the expected power, sound logs have
/// at most 1.08 and 1.46.
const BANDS: [(f64, f64); 2] = [(TOGETHER_S, 1.32), (1.0, 1.69)];
/// The same, in standard deviations of the power.
const BAND_CLEAR: f64 = 4.5;

/// What the residuals show.
pub(super) struct Evidence {
    /// Errors of channels with their size.
    pub(super) errors: Vec<(usize, Follows, f64)>,
    /// Change of the parameters where they are fitted, too.
    pub(super) shift: DVector<f64>,
    /// How much less certain they make the parameters.
    pub(super) added: DMatrix<f64>,
    /// Variances of slow residuals of A, B, C that nothing explains, mm2.
    pub(super) slow_mm2: [f64; 3],
}

impl Evidence {
    pub(super) fn new(means: &Means, estimate: &Estimate, moving: &Moving) -> Option<Self> {
        let candidates: Vec<(usize, Follows)> = (0..9)
            .flat_map(|channel| Follows::of_channel(channel).map(move |follows| (channel, follows)))
            .collect();
        let known = UNKNOWNS + estimate.sizes().len();
        let residual = known + candidates.len();
        let groups = groups(means);
        let mut table = DMatrix::zeros(3 * groups.len(), residual + 1);
        let steps = steps(estimate)?;
        for (j, &(channel, follows)) in candidates.iter().enumerate() {
            let white = whitened(means, &steps, |at| moving.signals(at, channel, follows));
            fill(&mut table, known + j, &groups, |at, k| white[at][k]);
        }
        for j in (0..known).chain([residual]) {
            let from = if j == residual { RESIDUAL } else { j };
            fill(&mut table, j, &groups, |at, k| estimate.rows[at][k][from]);
        }
        let mut products = DMatrix::zeros(residual + 1, residual + 1);
        for j in 0..=residual {
            for i in 0..=j {
                let product = table.column(i).dot(&table.column(j));
                (products[(i, j)], products[(j, i)]) = (product, product);
            }
        }
        let mut prior = estimate.prior.clone();
        for k in PROBE_LAGS..UNKNOWNS {
            let deviation = if k < ACCELERATIONS {
                PROBE_LAG_S
            } else {
                PER_ACCELERATION
            };
            prior[(k, k)] = 1.0 / (deviation * deviation);
        }
        let pull = &prior * estimate.values();
        for i in 0..UNKNOWNS {
            products[(i, residual)] -= pull[i];
            products[(residual, i)] -= pull[i];
            for j in 0..UNKNOWNS {
                products[(i, j)] += prior[(i, j)];
            }
        }
        let own: Vec<f64> = (0..residual).map(|j| products[(j, j)]).collect();
        (0..known).for_each(|k| sweep(&mut products, k));
        let before = estimate.curvature.inverse();
        let freedom = table.nrows().saturating_sub(known).max(1) as f64;
        let misfit = |products: &DMatrix<f64>| (products[(residual, residual)] / freedom).max(1.0);
        let mut chosen: Vec<usize> = Vec::new();
        while chosen.len() < ERRORS_MAX {
            let misfit = misfit(&products);
            let gain = |&j: &usize| {
                let score = products[(j, residual)];
                score * score / (products[(j, j)] * misfit)
            };
            let is_seen =
                |j: &usize| !chosen.contains(j) && products[(*j, *j)] > SEEN_MIN * own[*j];
            let value = |j: &usize| {
                let is_beam = (3..6).contains(&candidates[j - known].0);
                gain(j) - if is_beam { BEAM_GAIN } else { 0.0 }
            };
            let likely = (known..residual).filter(|j| is_seen(j) && gain(j) > GAIN_MIN);
            let Some(best) = likely.max_by(|a, b| value(a).total_cmp(&value(b))) else {
                break;
            };
            sweep(&mut products, best);
            chosen.push(best);
        }
        let mut left = table.column(residual).into_owned();
        for &j in (0..known).collect::<Vec<_>>().iter().chain(&chosen) {
            left.axpy(-products[(j, residual)], &table.column(j), 1.0);
        }
        let size = |&j: &usize| {
            let (channel, follows) = candidates[j - known];
            (channel, follows, products[(j, residual)])
        };
        Some(Self {
            errors: chosen.iter().map(size).collect(),
            shift: DVector::from_fn(COUNT, |k, _| products[(k, residual)]),
            added: (products.view((0, 0), (COUNT, COUNT)) - before.view((0, 0), (COUNT, COUNT)))
                * misfit(&products),
            slow_mm2: slow_mm2(means, &groups, left.as_slice()),
        })
    }
}

/// Changes of the signals, white.
fn whitened(
    means: &Means,
    steps: &[Step],
    signals: impl Fn(usize) -> Vector3<f64>,
) -> Vec<Vector3<f64>> {
    let mut white = Vec::with_capacity(steps.len());
    for movement in &means.rows.movements {
        let mut error = Vector3::zeros();
        for at in movement.clone() {
            let [by_error, kalman, to_white] = &steps[at];
            let innovation = signals(at) - by_error * error;
            error += kalman * innovation;
            white.push(to_white * innovation);
        }
    }
    white
}

/// Means that are taken together.
fn groups(means: &Means) -> Vec<Range<usize>> {
    let time_s = |at: usize| means.rows.rows[at].time_s;
    let movements = means.rows.movements.iter();
    let lasts_s: f64 = movements.map(|m| time_s(m.end - 1) - time_s(m.start)).sum();
    let together_s = TOGETHER_S.max(lasts_s / GROUPS_MAX);
    let mut groups = Vec::new();
    for movement in &means.rows.movements {
        let mut start = movement.start;
        for at in movement.clone() {
            if time_s(at) - time_s(start) >= together_s {
                groups.push(start..at);
                start = at;
            }
        }
        groups.push(start..movement.end);
    }
    groups
}

/// Sums of white numbers over groups, with the variance of one.
fn fill(
    table: &mut DMatrix<f64>,
    column: usize,
    groups: &[Range<usize>],
    white: impl Fn(usize, usize) -> f64,
) {
    for (row, group) in groups.iter().enumerate() {
        let share = 1.0 / (group.len() as f64).sqrt();
        for k in 0..3 {
            table[(3 * row + k, column)] =
                share * group.clone().map(|at| white(at, k)).sum::<f64>();
        }
    }
}

/// Solves for an unknown of normal equations in place: its row of the last column becomes its value, its block the
/// covariance, and the other rows lose what it explains.
fn sweep(products: &mut DMatrix<f64>, k: usize) {
    let pivot = products[(k, k)];
    if pivot <= 0.0 {
        return;
    }
    let by = products.column(k) / pivot;
    for j in (0..products.ncols()).filter(|j| *j != k) {
        let own = products[(k, j)];
        products.column_mut(j).axpy(-own, &by, 1.0);
        products[(k, j)] = own / pivot;
    }
    products.set_column(k, &(-by));
    products[(k, k)] = 1.0 / pivot;
}

/// Variances of A, B, C by residuals up to 10 Hz beyond noise and drift, mm2.
fn slow_mm2(means: &Means, groups: &[Range<usize>], white: &[f64]) -> [f64; 3] {
    let rows = |at: usize| means.rows.rows[at].weight;
    [0, 1, 2].map(|k| {
        let (mut slower, mut variance) = ((0.0, 0.0), 0.0);
        for (time_s, limit) in BANDS.into_iter().rev() {
            let (mut squares, mut count, mut all_rows) = (0.0, 0.0, 0.0);
            let mut sum = (0.0, 0.0);
            let mut start = 0;
            let mut end = |sum: &mut (f64, f64)| {
                if sum.1 > 0.0 {
                    squares += sum.0 * sum.0 / sum.1;
                    count += 1.0;
                }
                *sum = (0.0, 0.0);
            };
            for (at, group) in groups.iter().enumerate() {
                let (first, here) = (
                    &means.rows.rows[groups[start].start],
                    &means.rows.rows[group.start],
                );
                let is_later = !(0.0..time_s).contains(&(here.time_s - first.time_s + 1e-6));
                if is_later {
                    end(&mut sum);
                    start = at;
                }
                let len = group.len() as f64;
                sum = (sum.0 + white[3 * at + k] * len.sqrt(), sum.1 + len);
                all_rows += group.clone().map(rows).sum::<f64>();
            }
            end(&mut sum);
            let own = count - slower.1;
            if own < 1.0 {
                continue;
            }
            let power = (squares - slower.0) / own;
            if power > limit.max(1.0 + BAND_CLEAR * (2.0 / own).sqrt()) {
                let per_mean = means.white_mm[k] * means.white_mm[k] * count / all_rows;
                variance += (power - 1.0) * per_mean * own / count;
            }
            slower = (squares, count);
        }
        variance
    })
}
