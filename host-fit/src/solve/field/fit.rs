//! Maximum a posteriori: damped Gauss-Newton on the Hall residuals, first under white noise, then
//! whitened by the noise that the residuals show.

use super::blocks::Rows;
use super::carry::Verdict;
use super::error::FieldFitError;
use super::noise::{USUAL_DRIFT_MM, drift_mm, white_mm, white_only};
use super::parameters::FieldParameters;
use super::posterior::Posterior;
use super::probe::probes;
use super::step::{descent, factor, prior, prior_squares};
use super::terms::{COUNT, PER_PROBE};
use super::whiten::{Noise, Normal};
use crate::input::dataset::Dataset;
use crate::input::stage::Stage;
use crate::problem::parameters::Parameters;
use crate::solve::robust::{HALF, Loss};
use nalgebra::{DMatrix, DVector};
use std::ops::Range;
use std::sync::Arc;

/// Steps of one phase.
const STEPS_MAX: u32 = 20;
/// Steps of the white phase. A log that can carry the model needs three; one that can't goes on
/// for long along a valley of E and the offsets, which is not worth the time.
const STEPS_MAX_WHITE: u32 = 8;
/// A phase ends when the next step would gain less than this part of a unit of chi-square: a
/// step of three hundredths of a standard error.
const GAIN_MIN: f64 = 1e-3;
/// The white phase is only a start.
const GAIN_MIN_WHITE: f64 = 1.0;
/// Rounds of weights and fit at most.
const ROUNDS_MAX: u32 = 40;
/// Weights that change by less have settled.
const WEIGHT_SETTLED: f64 = 0.01;
const DAMPING_MAX: f64 = 1e8;
/// Rounds of noise and parameters in turn.
const NOISE_ROUNDS: u32 = 2;

/// A calibration by the field model with everything that the log says about it.
#[derive(Clone, Debug)]
pub struct FieldFit {
    /// The parameters.
    pub parameters: FieldParameters,
    /// How well the log determines them.
    pub posterior: Posterior,
    /// The noise of the log.
    pub noise: Noise,
    /// Lag of the reference behind the probes, s: positive where it shows an earlier pose.
    pub lag_s: f64,
    /// Error of the reference at the end of each movement of the rows used, mm, mm, mrad.
    pub offsets_mm: Vec<[f64; 3]>,
    /// The terms of the log-posterior at its maximum.
    pub score: Score,
    /// Largest magnitudes of X, Y, Rz (m, m, rad) in the log, each movement's middle taken off.
    pub planar_range: [f64; 3],
    /// Largest magnitudes of Z, Rx, Ry in the log: m, rad, rad.
    pub vertical_range: [f64; 3],
    /// Whether it is better taken than Model (31).
    pub verdict: Verdict,
    /// The weights of the rows used.
    pub weights: Vec<f64>,
    /// Gauss-Newton steps.
    pub iterations: u32,
}

/// -2 times the log-posterior is the sum of these, but for a constant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Score {
    /// Sum of squares of the whitened residuals of the blocks: about three times their number.
    pub chi_squared: f64,
    /// The logarithm of the determinant of their covariance.
    pub log_determinant: f64,
    /// Sum of squares of the parameters in terms of their priors' standard deviations.
    pub prior: f64,
    /// Whitened residuals: three for each block, less three for each movement's offset.
    pub residuals: usize,
}

#[derive(Clone, Debug)]
struct State {
    parameters: FieldParameters,
    lag_s: f64,
    offsets_mm: Vec<[f64; 3]>,
}

/// Fits the field model to the rows `selected` (ascending) of a dataset, from a fit of Model (31).
///
/// # Errors
/// See [`FieldFitError`].
pub fn fit_field(
    dataset: &Dataset,
    selected: &[usize],
    stage: &Stage,
    start: &Parameters,
) -> Result<FieldFit, FieldFitError> {
    WhiteFit::new(dataset, selected, stage, start)?.finish(stage)
}

/// The first phase of a fit: under white noise, each row with its weight.
#[derive(Clone, Debug)]
pub struct WhiteFit {
    /// How much each of the rows used counts: from 0 to 1.
    pub weights: Vec<f64>,
    search: Search,
    state: State,
    noise: Noise,
    normal: Normal,
    /// Of Model (31).
    start: Parameters,
}

impl WhiteFit {
    /// The first phase of [`fit_field`]: all rows count alike.
    ///
    /// # Errors
    /// See [`FieldFitError`].
    pub fn new(
        dataset: &Dataset,
        selected: &[usize],
        stage: &Stage,
        start: &Parameters,
    ) -> Result<Self, FieldFitError> {
        let rows = Rows::new(dataset, selected);
        let mut search = Search {
            rows: rows.into(),
            iterations: 0,
        };
        let mut state = search.start(start, stage);
        let (noise, normal) = search.under_white_noise(&mut state, stage)?;
        Ok(Self {
            weights: vec![1.0; selected.len()],
            search,
            state,
            noise,
            normal,
            start: *start,
        })
    }

    /// The rows used, with their weights.
    pub fn rows(&self) -> &Arc<Rows> {
        &self.search.rows
    }

    /// Whether a loss would make rows count less.
    pub fn has_outliers(&self, loss: Loss) -> bool {
        let weights = self.search.weights_by(&self.state, loss);
        weights.iter().any(|weight| *weight < 1.0)
    }

    /// The same as [`WhiteFit::new`] with weights by a loss, from a start that bad rows don't bend.
    ///
    /// # Errors
    /// See [`FieldFitError`].
    pub fn robust(
        dataset: &Dataset,
        selected: &[usize],
        stage: &Stage,
        start: &Parameters,
        loss: Loss,
    ) -> Result<Self, FieldFitError> {
        let rows = Rows::new(dataset, selected);
        let mut search = Search {
            rows: rows.into(),
            iterations: 0,
        };
        let mut state = search.start(start, stage);
        for _ in 0..ROUNDS_MAX {
            let weights = search.weights_by(&state, loss);
            let mut pairs = search.weights().into_iter().zip(&weights);
            if pairs.all(|(a, b)| (a - b).abs() < WEIGHT_SETTLED) {
                break;
            }
            search.rows = Rows::weighted(dataset, selected, &weights).into();
            search.under_white_noise(&mut state, stage)?;
        }
        let weights = loss.last(search.weights());
        // A movement may lose all its rows.
        let movements = search.rows.movement_rows().zip(&state.offsets_mm);
        let kept = movements.filter(|(rows, _)| weights[rows.clone()].iter().any(|w| *w > 0.0));
        state.offsets_mm = kept.map(|(_, offset)| *offset).collect();
        search.rows = Rows::weighted(dataset, selected, &weights).into();
        let (noise, normal) = search.under_white_noise(&mut state, stage)?;
        Ok(Self {
            weights,
            search,
            state,
            noise,
            normal,
            start: *start,
        })
    }

    /// The rest of [`fit_field`]: under the noise that the residuals show.
    ///
    /// # Errors
    /// See [`FieldFitError`].
    pub fn finish(self, stage: &Stage) -> Result<FieldFit, FieldFitError> {
        let Self {
            mut search,
            mut state,
            mut noise,
            mut normal,
            start,
            weights,
        } = self;
        let verdict = |rows: &Rows, state: &State, posterior: &Posterior| {
            let ranges = (rows.planar_range_mm.map(|x| x * 1e-3), rows.vertical_range);
            Verdict::new(&state.parameters, posterior, &start, stage, ranges)
        };
        let mut posterior = Posterior::new(covariance(&normal)?, &state.parameters, &noise);
        // White noise alone makes the errors too small, never too large: what fails here, fails.
        let early = verdict(&search.rows, &state, &posterior);
        if early.loses() {
            return Err(FieldFitError::NotCarried(Box::new(early)));
        }
        // What the parameters took of the drift depends on how much there is of it.
        let usual = Noise {
            drift_mm: USUAL_DRIFT_MM,
            ..noise
        };
        normal = search.normal(&state, &usual);
        for _ in 0..NOISE_ROUNDS {
            let white_mm = search.white_mm(&state, stage);
            let (rows, probes) = (&search.rows, probes(&state.parameters));
            let blocks = rows.evaluate(&probes, state.lag_s, &state.offsets_mm);
            noise = Noise {
                white_mm,
                drift_mm: drift_mm(rows, &blocks, white_mm, &covariance(&normal)?),
            };
            drop(blocks);
            let end = search.descend(&mut state, &noise, GAIN_MIN, STEPS_MAX)?;
            let End::Reached(reached) = end else {
                let iterations = search.iterations;
                return Err(FieldFitError::Stuck { iterations });
            };
            normal = reached;
        }
        posterior = Posterior::new(covariance(&normal)?, &state.parameters, &noise);
        let rows = &search.rows;
        // A block of outliers alone holds no residual.
        let weight =
            |block: &Range<usize>| rows.rows[block.clone()].iter().map(|row| row.weight).sum();
        let counted = rows
            .blocks
            .iter()
            .map(weight)
            .filter(|sum: &f64| *sum >= HALF);
        Ok(FieldFit {
            verdict: verdict(rows, &state, &posterior),
            posterior,
            score: Score {
                chi_squared: normal.chi_squared(),
                log_determinant: normal.log_determinant,
                prior: prior_squares(&state.parameters),
                residuals: 3 * counted.count().saturating_sub(rows.movements.len()),
            },
            parameters: state.parameters,
            noise,
            lag_s: state.lag_s,
            offsets_mm: state.offsets_mm,
            planar_range: rows.planar_range_mm.map(|x| x * 1e-3),
            vertical_range: rows.vertical_range,
            weights,
            iterations: search.iterations,
        })
    }
}

/// How a phase ended, with the sums at its end.
enum End {
    Reached(Normal),
    StepLimit(Normal),
}

#[derive(Clone, Debug)]
struct Search {
    rows: Arc<Rows>,
    iterations: u32,
}

impl Search {
    fn weights(&self) -> Vec<f64> {
        self.rows.rows.iter().map(|row| row.weight).collect()
    }

    fn white_mm(&self, state: &State, stage: &Stage) -> [f64; 3] {
        let least_mm = stage.hall.m_per_count * 1e3 / 12f64.sqrt();
        let probes = probes(&state.parameters);
        white_mm(
            &self.rows,
            &probes,
            state.lag_s,
            &state.offsets_mm,
            least_mm,
        )
    }

    fn weights_by(&self, state: &State, loss: Loss) -> Vec<f64> {
        let (rows, probes) = (&self.rows, probes(&state.parameters));
        let residuals_mm = rows.residuals_mm(&probes, state.lag_s, &state.offsets_mm);
        loss.weights(residuals_mm, rows.movement_rows())
    }

    fn start(&self, model_31: &Parameters, stage: &Stage) -> State {
        State {
            parameters: FieldParameters::of_model_31(model_31, stage),
            lag_s: 0.0,
            offsets_mm: vec![[0.0; 3]; self.rows.movements.len()],
        }
    }

    fn under_white_noise(
        &mut self,
        state: &mut State,
        stage: &Stage,
    ) -> Result<(Noise, Normal), FieldFitError> {
        let noise = white_only(self.white_mm(state, stage));
        match self.descend(state, &noise, GAIN_MIN_WHITE, STEPS_MAX_WHITE)? {
            End::Reached(normal) | End::StepLimit(normal) => Ok((noise, normal)),
        }
    }

    fn normal(&self, state: &State, noise: &Noise) -> Normal {
        let probes = probes(&state.parameters);
        Normal::at(&self.rows, &probes, state.lag_s, &state.offsets_mm, noise)
    }

    /// Steps down until the next step would gain less than `gain_min`, at most `steps_max` times.
    fn descend(
        &mut self,
        state: &mut State,
        noise: &Noise,
        gain_min: f64,
        steps_max: u32,
    ) -> Result<End, FieldFitError> {
        let mut normal = self.normal(state, noise);
        let mut damping = 0.0;
        for _ in 0..steps_max {
            let unseen: Vec<String> = (0..COUNT)
                .filter(|&k| prior(k).is_none() && normal.curvature(k, k) <= 0.0)
                .map(super::terms::name)
                .collect();
            if !unseen.is_empty() {
                return Err(FieldFitError::Unseen { parameters: unseen });
            }
            let descent = descent(&normal, &state.parameters);
            let step = factor(&normal, damping)
                .ok_or(FieldFitError::Singular)?
                .solve(&descent);
            let gain = descent.dot(&step);
            if gain < gain_min && damping == 0.0 {
                return Ok(End::Reached(normal));
            }
            self.iterations += 1;
            let next = after(state, &normal, &step);
            let next_normal = self.normal(&next, noise);
            let cost = |normal: &Normal, state: &State| {
                normal.chi_squared() + prior_squares(&state.parameters)
            };
            // At the end rounding decides: a small rise is none.
            let rise = cost(&next_normal, &next) - cost(&normal, state);
            if rise <= GAIN_MIN {
                (*state, normal) = (next, next_normal);
                damping = if damping > 1e-6 { damping * 0.1 } else { 0.0 };
            } else {
                damping = if damping == 0.0 { 1e-4 } else { damping * 10.0 };
                if damping > DAMPING_MAX {
                    break;
                }
            }
        }
        Ok(End::StepLimit(normal))
    }
}

fn after(state: &State, normal: &Normal, step: &DVector<f64>) -> State {
    let mut parameters = state.parameters;
    for (k, change) in step.iter().take(COUNT).enumerate() {
        parameters.probes[k / PER_PROBE][k % PER_PROBE] += change;
    }
    let offsets_mm = normal
        .offsets_mm(step.as_slice())
        .zip(&state.offsets_mm)
        .map(|(change, offset)| [0, 1, 2].map(|k| offset[k] + change[k]))
        .collect();
    State {
        parameters,
        lag_s: state.lag_s + step[COUNT],
        offsets_mm,
    }
}

fn covariance(normal: &Normal) -> Result<DMatrix<f64>, FieldFitError> {
    Ok(factor(normal, 0.0)
        .ok_or(FieldFitError::Singular)?
        .covariance())
}
