//! The posterior of a log that is not recorded yet: it does not depend on the residuals.

use super::dynamics::{Dynamics, MotionFit, PER_ACCELERATION};
use super::parameters::{FieldParameters, HELD, place_m, unknowns};
use super::posterior::{Posterior, covariance_at, temperature_errors};
use super::probe::probes;
use super::rows::Rows;
use super::service::{Service, ServiceVariance, service_poses};
use super::temperature::Sensors;
use super::whiten::{FieldEquations, Noise};
use hallstage_input::stage::Stage;
use nalgebra::DMatrix;

/// The errors to expect of a fit to rows with signals that are not known yet.
#[derive(Clone, Debug)]
pub struct Forecast {
    /// The posterior of the parameters.
    pub posterior: Posterior,
    /// Errors in service; Model (31) differs from a field model without E and p by nothing.
    pub service: ServiceVariance,
}

/// What is to be expected of logs at several temperatures.
#[derive(Clone, Debug)]
pub struct TemperatureForecast {
    /// Standard errors of (k, h) of A, B, C, 1/K.
    pub error_per_k: [[f64; 2]; 3],
    /// Errors in service over the noise floor at each distance, X, Y, Rz.
    pub ratios: Vec<[f64; 3]>,
}

/// A stage about to be calibrated, with the poses of its service.
#[derive(Clone, Debug)]
pub struct Forecaster {
    parameters: FieldParameters,
    place_m: f64,
    noise: Noise,
    service: Service,
}

impl Forecaster {
    /// For a stage as designed, with E = p = 0, under this noise, in service within the
    /// largest magnitudes of X, Y, Rz and Z, Rx, Ry given (m, rad); `None` where its probes don't
    /// determine a pose there.
    pub fn new(stage: &Stage, noise: &Noise, service: ([f64; 3], [f64; 3])) -> Option<Self> {
        let parameters = FieldParameters::designed(stage);
        Some(Self {
            parameters,
            place_m: place_m(stage),
            noise: *noise,
            service: Service::new(&parameters, noise.white_m, service_poses(service))?,
        })
    }

    /// The forecast for rows that each stand for `weight` rows of the log; `None` where they don't
    /// determine the parameters.
    pub fn forecast(&self, rows: &Rows, weight: f64) -> Option<Forecast> {
        let covariance = self.covariance(rows, weight, [HELD; 2])?;
        let posterior = Posterior::new(&covariance, &self.parameters, &self.noise);
        let service = self.service.variance(&posterior.covariance);
        Some(Forecast { posterior, service })
    }

    /// The forecast for logs at several temperatures, at distances (mount, body) from T0, K.
    pub fn forecast_temperatures(
        &self,
        rows: &Rows,
        weight: f64,
        sensors: &Sensors,
        distances_k: &[[f64; 2]],
    ) -> Option<TemperatureForecast> {
        let mut covariance = self.covariance(rows, weight, sensors.deviations())?;
        let amplitude_m = rows.rows.iter().map(|row| row.reference[1].abs());
        let white_m = self.noise.white_m[1];
        // Of a sine.
        let rms_to_noise = amplitude_m.fold(0.0, f64::max) / (f64::sqrt(2.0) * white_m);
        sensors.complete(&mut covariance, rms_to_noise * rms_to_noise);
        let posterior = Posterior::new(&covariance, &self.parameters, &self.noise);
        let posterior = posterior.with_temperature(&covariance);
        let ratios = distances_k.iter().map(|distance_k| {
            let there = covariance_at(&posterior.covariance, &self.parameters, *distance_k);
            self.service.variance(&there).ratios()
        });
        Some(TemperatureForecast {
            error_per_k: temperature_errors(&posterior.covariance)?,
            ratios: ratios.collect(),
        })
    }

    fn covariance(&self, rows: &Rows, weight: f64, temperature: [f64; 2]) -> Option<DMatrix<f64>> {
        let offsets = vec![[0.0; 3]; rows.movements.len()];
        let mut blocks = rows.evaluate(&probes(&self.parameters), &Dynamics::default(), &offsets);
        blocks.iter_mut().for_each(|block| block.rows *= weight);
        let places = self.parameters.places;
        let drawn = (&places, self.place_m);
        let equations = FieldEquations {
            rows,
            places,
            noise: self.noise,
            resets: None,
            faults: &[],
        };
        let normal = equations.sum_blocks(&blocks);
        let with = |acceleration| unknowns(drawn, temperature, acceleration).covariance(&normal);
        match with(PER_ACCELERATION)? {
            open if MotionFit::is_shown_by(&open) => Some(open),
            _ => with(HELD),
        }
    }
}
