//! What a log that is not recorded yet will tell: its posterior does not depend on the residuals.

use super::blocks::Rows;
use super::carry::{ServiceVariance, service_poses};
use super::parameters::FieldParameters;
use super::posterior::{FORM_MM, PoseErrors, Posterior};
use super::probe::probes;
use super::step::factor;
use super::terms::COUNT;
use super::whiten::{Noise, Normal};

/// What is to be expected of a fit to rows whose signals are not known yet.
#[derive(Clone, Debug)]
pub struct Forecast {
    /// The posterior of the parameters.
    pub posterior: Posterior,
    /// Errors in service; Model (31) differs from a field model without E and p by nothing.
    pub service: ServiceVariance,
}

/// A stage about to be calibrated, with the poses of its service.
#[derive(Clone, Debug)]
pub struct Forecaster {
    parameters: FieldParameters,
    noise: Noise,
    /// Of X, Y, Rz: means over the poses of the products of the derivatives by two parameters.
    by_parameters: [Vec<[f64; COUNT]>; 3],
    /// Of X, Y, Rz: variance by the noise of the probes.
    by_noise: [f64; 3],
    /// By what the form leaves of their readings.
    by_form: [f64; 3],
}

impl Forecaster {
    /// For a stage of these parameters, of which E = p = 0, under this noise, in service within X,
    /// Y, Rz and Z, Rx, Ry of these largest magnitudes (m, rad); `None` where its probes can't tell
    /// a pose there.
    pub fn new(
        parameters: &FieldParameters,
        noise: &Noise,
        service: ([f64; 3], [f64; 3]),
    ) -> Option<Self> {
        let probes = probes(parameters);
        let poses = service_poses(service);
        let share = 1.0 / poses.len() as f64;
        let mut by_parameters = [0; 3].map(|_| vec![[0.0; COUNT]; COUNT]);
        let mut by_noise = [0.0; 3];
        let mut by_form = [0.0; 3];
        for (planar, vertical) in poses {
            let errors = PoseErrors::new(&probes, planar, vertical)?;
            for (axis, by) in errors.by_parameter.iter().enumerate() {
                for (row, x) in by_parameters[axis].iter_mut().zip(by) {
                    for (sum, y) in row.iter_mut().zip(by) {
                        *sum += share * (x * y);
                    }
                }
                for (by, white) in errors.by_signal[axis].iter().zip(noise.white_mm) {
                    by_noise[axis] += share * (by * white) * (by * white);
                    by_form[axis] += share * (by * FORM_MM) * (by * FORM_MM);
                }
            }
        }
        Some(Self {
            parameters: *parameters,
            noise: *noise,
            by_parameters,
            by_noise,
            by_form,
        })
    }

    /// The forecast for rows that each stand for `weight` rows of the log; `None` where they don't
    /// determine the parameters.
    pub fn forecast(&self, rows: &Rows, weight: f64) -> Option<Forecast> {
        let offsets_mm = vec![[0.0; 3]; rows.movements.len()];
        let mut blocks = rows.evaluate(&probes(&self.parameters), 0.0, &offsets_mm);
        blocks.iter_mut().for_each(|block| block.rows *= weight);
        let normal = Normal::new(rows, &blocks, &self.noise);
        let covariance = factor(&normal, 0.0)?.covariance();
        let posterior = Posterior::new(covariance, &self.parameters, &self.noise);
        let systematic = [0, 1, 2].map(|axis| {
            let products = &self.by_parameters[axis];
            let mut sum = self.by_form[axis];
            for (column, products) in posterior.covariance.column_iter().zip(products) {
                for (covariance, product) in column.iter().zip(products) {
                    sum += covariance * product;
                }
            }
            sum
        });
        Some(Forecast {
            posterior,
            service: ServiceVariance {
                systematic,
                noise: self.by_noise,
                difference: [0.0; 3],
            },
        })
    }
}
