//! What the residuals still show after all faults: errors that follow the motion, and slow errors that nothing explains.

use super::estimate::{Estimate, RESIDUAL, Row};
use super::means::Means;
use super::motion::{Follows, Moving};
use super::score::{Step, steps};
use super::slow::{groups, slow_m2};
use hallstage_solver::estimator::dynamics::{PER_ACCELERATION, PROBE_LAG_S};
use hallstage_solver::estimator::terms::COUNT;
use hallstage_solver::estimator::whiten::{ACCELERATIONS, PROBE_LAGS, UNKNOWNS};
use nalgebra::{DMatrix, DVector, Vector3};
use std::ops::Range;

/// Rows are taken together for this time, s: motion of service is slower, and misfit counts at its frequencies.
const TOGETHER_S: f64 = 0.1;
/// Groups of rows that are taken together for the misfit at the frequencies of service.
const SLOWER: usize = 3;
/// Errors of channels that are taken into account at most.
const ERRORS_MAX: usize = 8;
/// An error is left out where the parameters can follow all but this part of it: the log hardly shows it.
const SEEN_MIN: f64 = 0.003;
/// An error explains more than chance where chi-square falls by this much: one of 130 in 10,000 sound logs.
const GAIN_MIN: f64 = 28.0;
/// An error of a sensor is taken where the error of a beam explains the log better by less than this: in service there are
/// no beams.
const BEAM_GAIN: f64 = 20.0;
/// Information below this part of an unknown's own is rounding.
const ROUNDING: f64 = 1e-10;

/// What the residuals show.
pub(super) struct Evidence {
    /// Errors of channels with their size.
    pub(super) errors: Vec<(usize, Follows, f64)>,
    /// Change of the parameters where they are fitted, too.
    pub(super) shift: DVector<f64>,
    /// How much less certain they make the parameters.
    pub(super) added: DMatrix<f64>,
    /// Change of the sizes of the faults beside these errors.
    pub(super) sizes: Vec<f64>,
    /// Lags of A, B, C behind their mean beside these errors, s.
    pub(super) probe_lags_s: [f64; 3],
    /// Variances of slow residuals of A, B, C that nothing explains, m2.
    pub(super) slow_m2: [f64; 3],
}

impl Evidence {
    pub(super) fn new(means: &Means, estimate: &Estimate, moving: &Moving) -> Option<Self> {
        let candidates: Vec<(usize, Follows)> = (0..9)
            .flat_map(|channel| {
                let follows = Follows::of_channel(channel).into_iter();
                follows.map(move |follows| (channel, follows))
            })
            .collect();
        let known = UNKNOWNS + estimate.sizes().len();
        let residual = known + candidates.len();
        let groups = groups(means, TOGETHER_S);
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
        let mut products = with_prior(table.tr_mul(&table), estimate);
        let own: Vec<f64> = (0..residual).map(|j| products[(j, j)]).collect();
        for (k, own) in own.iter().enumerate().take(known) {
            let least = if k < UNKNOWNS { ROUNDING } else { SEEN_MIN };
            sweep(&mut products, k, least * own);
        }
        let before = estimate.curvature.inverse();
        let mut chosen: Vec<usize> = Vec::new();
        while chosen.len() < ERRORS_MAX {
            let misfit = misfit(&table, &products, known, &chosen);
            let gain = |&j: &usize| products[(j, residual)].powi(2) / (products[(j, j)] * misfit);
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
            sweep(&mut products, best, 0.0);
            chosen.push(best);
        }
        let left = |row: &Row| {
            Vector3::from_fn(|k, _| {
                let known = (0..known).map(|j| row[k][j] * products[(j, residual)]);
                row[k][RESIDUAL] - known.sum::<f64>()
            })
        };
        let mut left: Vec<Vector3<f64>> = estimate.rows.iter().map(left).collect();
        for &j in &chosen {
            let (channel, follows) = candidates[j - known];
            let white = whitened(means, &steps, |at| moving.signals(at, channel, follows));
            let pairs = left.iter_mut().zip(white);
            pairs.for_each(|(left, white)| *left -= white * products[(j, residual)]);
        }
        let [a, b] = [0, 1].map(|k| products[(PROBE_LAGS + k, residual)]);
        let size = |&j: &usize| {
            let (channel, follows) = candidates[j - known];
            (channel, follows, products[(j, residual)])
        };
        Some(Self {
            errors: chosen.iter().map(size).collect(),
            shift: DVector::from_fn(COUNT, |k, _| products[(k, residual)]),
            added: (products.view((0, 0), (COUNT, COUNT)) - before.view((0, 0), (COUNT, COUNT)))
                * misfit(&table, &products, known, &chosen),
            sizes: (UNKNOWNS..known).map(|k| products[(k, residual)]).collect(),
            probe_lags_s: [a, b, -a - b],
            slow_m2: slow_m2(means, &left),
        })
    }
}

/// Normal equations of the unknowns, of further errors and, last, of the residual, with the prior of the fit. Lags and
/// accelerations have a prior of their own: an error may look like them.
fn with_prior(mut products: DMatrix<f64>, estimate: &Estimate) -> DMatrix<f64> {
    let residual = products.nrows() - 1;
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
    products
}

/// The power of the residual over the power of noise, after the `known` unknowns and the chosen errors: of all rows or at
/// the frequencies of motion, where noise that is not white is largest.
fn misfit(table: &DMatrix<f64>, products: &DMatrix<f64>, known: usize, chosen: &[usize]) -> f64 {
    let residual = products.nrows() - 1;
    let mut left = table.column(residual).into_owned();
    for j in (0..known).chain(chosen.iter().copied()) {
        left.axpy(-products[(j, residual)], &table.column(j), 1.0);
    }
    let slow = left.as_slice().chunks(3 * SLOWER).map(|few| {
        let share = 3.0 / few.len() as f64;
        let sum = |k: usize| few.iter().skip(k).step_by(3).sum::<f64>();
        share * [0, 1, 2].map(|k| sum(k).powi(2)).iter().sum::<f64>()
    });
    // The parameters follow up to half of the slow residual.
    let slow = slow.sum::<f64>() / (0.5 * (table.nrows() / SLOWER) as f64);
    let freedom = table.nrows().saturating_sub(known).max(table.nrows() / 2) as f64;
    (products[(residual, residual)] / freedom)
        .max(slow)
        .max(1.0)
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
/// covariance, and the other rows lose what it explains. An unknown that others replace is left out.
fn sweep(products: &mut DMatrix<f64>, k: usize, least: f64) {
    let pivot = products[(k, k)];
    if pivot <= least {
        products.row_mut(k).fill(0.0);
        products.column_mut(k).fill(0.0);
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
