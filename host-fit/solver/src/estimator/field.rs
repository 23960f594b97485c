//! Maximum a posteriori: Gauss-Newton on the Hall residuals, first under white noise, then whitened
//! by the noise that the residuals show.

use super::dynamics::{Dynamics, MotionFit, PER_ACCELERATION};
use super::error::FieldFitError;
use super::noise::{USUAL_DRIFT, drift, white_m, white_only};
use super::parameters::{FieldParameters, HELD, place_m, unknowns};
use super::posterior::{Posterior, temperature_errors};
use super::probe::probes;
use super::rows::Rows;
use super::sandwich::ReferenceLag;
use super::service::Comparison;
use super::temperature::{Coefficient, Sensors, TemperatureFit};
use super::terms::COUNT;
use super::whiten::{COLUMNS, FieldEquations, LAG, Noise, UNKNOWNS};
use crate::estimator::gauss_newton::{self, Limits, Normal, Point, Solved, Unknowns};
use crate::estimator::paper::Parameters;
use crate::estimator::robust::{HALF, Loss};
use hallstage_input::dataset::Dataset;
use hallstage_input::stage::Stage;
use nalgebra::{DMatrix, DVector};
use runtime::Temperature;
use std::ops::Range;
use std::sync::Arc;

/// The white phase is only a start. A log that can carry the model needs three steps; one that can't
/// goes on for long along a valley of E and the offsets, which is not worth the time.
const WHITE: Limits = Limits {
    steps: 8,
    gain: 1.0,
};
/// One step after each change of the weights: both settle together.
const REWEIGHTED: Limits = Limits { steps: 1, ..WHITE };
/// Rounds of weights and fit at most: two seconds of 57,000 rows.
const ROUNDS_MAX: u32 = 15;
/// Weights that change by less have settled.
const WEIGHT_SETTLED: f64 = 0.01;
/// Rounds of noise and parameters in turn.
const NOISE_ROUNDS: u32 = 2;

/// A calibration by the field model with everything that the log says about it.
#[derive(Clone, Debug)]
pub struct FieldFit {
    /// The parameters.
    pub parameters: FieldParameters,
    /// How well the log determines them.
    pub posterior: Posterior,
    /// Lag of the reference behind the probes; `None` where the log shows nothing of it.
    pub lag: Option<ReferenceLag>,
    /// Lags of the probes, and what acceleration adds to their readings.
    pub motion: MotionFit,
    /// The weights of the rows used.
    pub weights: Vec<f64>,
    /// Gauss-Newton steps.
    pub iterations: u32,
    /// What the log says besides.
    pub figures: FieldFigures,
}

/// What a log says beside the parameters of the field model.
#[derive(Clone, Debug)]
pub struct FieldFigures {
    /// The noise of the log.
    pub noise: Noise,
    /// How well the model describes the log.
    pub score: Score,
    /// Largest magnitudes of X, Y, Rz (m, m, rad) in the log, each movement's middle taken off.
    pub planar_range: [f64; 3],
    /// Largest magnitudes of Z, Rx, Ry in the log: m, rad, rad.
    pub vertical_range: [f64; 3],
    /// Whether the field model is better taken than Model (31).
    pub comparison: Comparison,
    /// k and h with their standard errors.
    pub temperature: TemperatureFit,
}

/// How well a model describes a log.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Score {
    /// Sum of squares of the whitened residuals of the blocks: about three times their number.
    pub chi_squared: f64,
    /// Whitened residuals: three for each block, less three for each movement's offset.
    pub residuals: usize,
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
    let rows = Rows::new(dataset, selected).into();
    let fit = WhiteFit::new(dataset, rows, stage, start)?;
    let floor_m = fit.noise.white_m;
    fit.finish(stage, floor_m)
}

/// The first phase of a fit: under white noise, each row with its weight.
#[derive(Clone, Debug)]
pub struct WhiteFit {
    /// How much each of the rows used counts: from 0 to 1.
    pub weights: Vec<f64>,
    rows: Arc<Rows>,
    unknowns: Unknowns,
    places: [[f64; 2]; 3],
    temperature: Temperature<f64>,
    sensors: Sensors,
    at: Point,
    noise: Noise,
    resets: Option<[f64; 3]>,
    iterations: u32,
    /// Whether the log determines what acceleration adds to the readings; otherwise that is held at zero.
    shows_acceleration: bool,
    /// The parameters of Model (31).
    start: Parameters,
}

impl WhiteFit {
    /// The first phase of [`fit_field`]: all rows count alike.
    ///
    /// # Errors
    /// See [`FieldFitError`].
    pub fn new(
        dataset: &Dataset,
        rows: Arc<Rows>,
        stage: &Stage,
        start: &Parameters,
    ) -> Result<Self, FieldFitError> {
        let mut fit = Self::start(dataset, rows, stage, start);
        fit.under_white_noise(stage, WHITE)?;
        Ok(fit)
    }

    fn start(dataset: &Dataset, rows: Arc<Rows>, stage: &Stage, start: &Parameters) -> Self {
        let places = stage.places_m();
        let sensors = Sensors::new(dataset, stage);
        let mut values = DVector::zeros(UNKNOWNS);
        let parameters = FieldParameters::from_model_31(start, stage);
        values.as_mut_slice()[..COUNT].copy_from_slice(parameters.probes.as_flattened());
        Self {
            weights: vec![1.0; rows.rows.len()],
            at: Point {
                values,
                offsets: vec![[0.0; 3]; rows.movements.len()],
            },
            rows,
            unknowns: unknowns((&places, place_m(stage)), sensors.deviations(), HELD),
            temperature: dataset.temperature,
            sensors,
            places,
            noise: white_only([1.0; 3]),
            resets: stage.reset_sd,
            iterations: 0,
            shows_acceleration: false,
            start: *start,
        }
    }

    /// The rows used, with their weights.
    pub fn rows(&self) -> &Arc<Rows> {
        &self.rows
    }

    /// Whether a loss would make rows count less.
    pub fn has_outliers(&self, loss: Loss) -> bool {
        self.weights_by(loss).iter().any(|weight| *weight < 1.0)
    }

    /// The first phase with weights by a loss, from a start that bad rows do not bend.
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
        let rows = Rows::new(dataset, selected).into();
        let mut fit = Self::start(dataset, rows, stage, start);
        for _ in 0..ROUNDS_MAX {
            let weights = fit.weights_by(loss);
            let mut pairs = fit.weights.iter().zip(&weights);
            if pairs.all(|(a, b)| (a - b).abs() < WEIGHT_SETTLED) {
                break;
            }
            fit.rows = Rows::weighted(dataset, selected, &weights).into();
            fit.weights = weights;
            fit.under_white_noise(stage, REWEIGHTED)?;
        }
        let weights = loss.last(fit.weights);
        // A movement may lose all its rows.
        let movements = fit.rows.movement_rows().zip(&fit.at.offsets);
        let kept = movements.filter(|(rows, _)| weights[rows.clone()].iter().any(|w| *w > 0.0));
        fit.at.offsets = kept.map(|(_, offset)| *offset).collect();
        fit.rows = Rows::weighted(dataset, selected, &weights).into();
        fit.weights = weights;
        fit.under_white_noise(stage, WHITE)?;
        Ok(fit)
    }

    /// The rest of [`fit_field`]: under the noise that the residuals show; `floor_m` is the noise of the probes in service.
    ///
    /// # Errors
    /// See [`FieldFitError`].
    pub fn finish(mut self, stage: &Stage, floor_m: [f64; 3]) -> Result<FieldFit, FieldFitError> {
        let mut covariance = self.covariance(&self.normal()?)?;
        // White noise alone makes the errors too small, never too large: what fails here, fails.
        let early = self.comparison(stage, &self.posterior(&covariance, self.noise));
        if early.loses() {
            return Err(FieldFitError::NotCarried(Box::new(early)));
        }
        // What the parameters took of the drift depends on how much there is of it.
        self.noise.drift = USUAL_DRIFT;
        let mut normal = self.normal()?;
        for _ in 0..NOISE_ROUNDS {
            covariance = self.covariance(&normal)?;
            let white_m = self.white_m(stage);
            let blocks = self.rows.evaluate(
                &probes(&self.parameters()),
                &self.dynamics(),
                &self.at.offsets,
            );
            self.noise = Noise {
                white_m,
                drift: drift(&self.rows, &blocks, white_m, &covariance),
            };
            drop(blocks);
            // On a faulty log it ends where no step gains more: the diagnosis goes on from there.
            normal = self.descend(Limits::CLOSE)?.normal;
        }
        let covariance = self.covariance(&normal)?;
        let lag = ReferenceLag {
            value_s: self.at.values[LAG],
            standard_error_s: covariance[(LAG, LAG)].sqrt(),
        };
        let shows_acceleration = self.shows_acceleration && MotionFit::is_shown_by(&covariance);
        let motion = MotionFit::new(self.at.values.as_slice(), &covariance, shows_acceleration);
        // Residuals show it better where the reference adds nothing.
        let floor = Noise {
            white_m: [0, 1, 2].map(|k| floor_m[k].min(self.noise.white_m[k])),
            ..self.noise
        };
        let (posterior, temperature) = self.with_temperature(covariance, floor);
        let rows = &self.rows;
        // A block of outliers alone holds no residual.
        let weight =
            |block: &Range<usize>| rows.rows[block.clone()].iter().map(|row| row.weight).sum();
        let weights = rows.blocks.iter().map(weight);
        let counted = weights.filter(|sum: &f64| *sum >= HALF).count();
        let figures = FieldFigures {
            comparison: self.comparison(stage, &posterior),
            temperature,
            score: Score {
                chi_squared: normal.chi_squared(),
                residuals: 3 * counted.saturating_sub(rows.movements.len()),
            },
            noise: self.noise,
            planar_range: rows.planar_range,
            vertical_range: rows.vertical_range,
        };
        Ok(FieldFit {
            figures,
            posterior,
            parameters: FieldParameters {
                gain_per_k: [[0.0; 2]; 3],
                ..self.parameters()
            },
            lag: (lag.standard_error_s > 0.0).then_some(lag),
            motion,
            weights: self.weights,
            iterations: self.iterations,
        })
    }

    /// The posterior with k and h, and k and h: the values that the rows were compensated with plus the estimated
    /// changes.
    fn with_temperature(
        &self,
        mut covariance: DMatrix<f64>,
        floor: Noise,
    ) -> (Posterior, TemperatureFit) {
        let mut temperature = self.temperature;
        for of in Coefficient::ALL {
            if self.sensors.spans_k[of.sensor] > 0.0 {
                let change = self.at.values[of.row()];
                temperature.per_mk[of.probe][of.sensor] += 1e-3 * change;
            }
        }
        let (rows, white_m) = (&self.rows.rows, self.noise.white_m[0]);
        let squares = rows.iter().map(|row| row.signal_m[0] * row.signal_m[0]);
        let mean_square = squares.sum::<f64>() / rows.len().max(1) as f64;
        let signal_to_noise = mean_square / (white_m * white_m);
        self.sensors.complete(&mut covariance, signal_to_noise);
        let parameters_only = self.posterior(&covariance, floor);
        let posterior = match temperature.is_used() {
            true => parameters_only.with_temperature(&covariance),
            false => parameters_only,
        };
        let temperature = TemperatureFit {
            temperature,
            error_per_k: temperature_errors(&posterior.covariance).unwrap_or_default(),
            spans_k: self.sensors.spans_k,
        };
        (posterior, temperature)
    }

    fn parameters(&self) -> FieldParameters {
        self.equations().parameters(&self.at)
    }

    fn dynamics(&self) -> Dynamics {
        Dynamics::from_values(self.at.values.as_slice())
    }

    fn equations(&self) -> FieldEquations<'_> {
        FieldEquations {
            rows: &self.rows,
            places: self.places,
            noise: self.noise,
            resets: self.resets,
            faults: &[],
        }
    }

    fn normal(&self) -> Result<Normal<COLUMNS>, FieldFitError> {
        let normal = gauss_newton::Equations::normal(&self.equations(), &self.at);
        normal.ok_or(FieldFitError::Singular)
    }

    fn covariance(&self, normal: &Normal<COLUMNS>) -> Result<DMatrix<f64>, FieldFitError> {
        self.unknowns
            .covariance(normal)
            .ok_or(FieldFitError::Singular)
    }

    fn posterior(&self, covariance: &DMatrix<f64>, noise: Noise) -> Posterior {
        Posterior::new(covariance, &self.parameters(), &noise)
    }

    fn comparison(&self, stage: &Stage, posterior: &Posterior) -> Comparison {
        let rows = &self.rows;
        let ranges = (rows.planar_range, rows.vertical_range);
        Comparison::new(&self.parameters(), posterior, &self.start, stage, ranges)
    }

    fn white_m(&self, stage: &Stage) -> [f64; 3] {
        let probes = probes(&self.parameters());
        white_m(
            &self.rows,
            &probes,
            &self.dynamics(),
            &self.at.offsets,
            stage,
        )
    }

    fn weights_by(&self, loss: Loss) -> Vec<f64> {
        let probes = probes(&self.parameters());
        let residuals_m = self
            .rows
            .residuals_m(&probes, &self.dynamics(), &self.at.offsets);
        loss.weights(residuals_m, self.rows.movement_rows())
    }

    fn under_white_noise(&mut self, stage: &Stage, limits: Limits) -> Result<(), FieldFitError> {
        self.noise = white_only(self.white_m(stage));
        if !self.shows_acceleration {
            let places = (&self.places, place_m(stage));
            let open = unknowns(places, self.sensors.deviations(), PER_ACCELERATION);
            let covariance = open.covariance(&self.normal()?);
            if covariance.is_some_and(|all| MotionFit::is_shown_by(&all)) {
                self.unknowns = open;
                self.shows_acceleration = true;
            }
        }
        self.descend(limits)?;
        Ok(())
    }

    fn descend(&mut self, limits: Limits) -> Result<Solved<COLUMNS>, FieldFitError> {
        // The basis is the identity.
        let x = self.at.values.clone();
        let offsets = self.at.offsets.clone();
        let solved = gauss_newton::solve(&self.equations(), &self.unknowns, x, offsets, limits);
        let solved = solved.ok_or(FieldFitError::Singular)?;
        self.at = solved.point.clone();
        self.iterations += solved.steps;
        Ok(solved)
    }
}
