//! What is wrong with the clocks of a record: the lag of the reference and how it grows, fitted
//! together with all that a stage as designed may differ in.

use super::dynamics::Dynamics;
use super::noise::{USUAL_DRIFT, white_m};
use super::parameters::{FALL_PER_M, FieldParameters, place_m};
use super::probe::probes;
use super::rows::Rows;
use super::terms::{COUNT, ETA, LEVER_ARM, PER_PROBE, SLOPES, TERMS, THETA};
use super::whiten::{COLUMNS, FieldEquations, LAG, LAG_RATE, Noise};
use crate::estimator::gauss_newton::{Equations, Normal, Point, Unknowns};
use crate::estimator::paper::Parameters;
use hallstage_input::stage::Stage;
use nalgebra::{DMatrix, DVector};

/// Standard deviations of what is not known before: misalignment, sensitivity, lag and its rate.
/// Crystals differ by 50 parts in a million.
const THETA_RAD: f64 = 0.1;
const ETA_PART: f64 = 0.3;
const LAG_S: f64 = 0.01;
const RATE: f64 = 50e-6;

/// A stage as designed, to be aligned with a record step by step.
#[derive(Clone, Debug)]
pub struct Alignment<'s> {
    stage: &'s Stage,
    places: [[f64; 2]; 3],
    unknowns: Unknowns,
    x: DVector<f64>,
}

/// A lag that is left.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lag {
    /// Lag of the reference behind the probes at time zero of the rows, s.
    pub value_s: f64,
    /// What it grows by, s/s.
    pub rate: f64,
    /// Standard error of the rate, s/s.
    pub rate_standard_error: f64,
    /// Its standard errors at the first and the last of the rows, s.
    pub standard_errors_s: [f64; 2],
    /// The square of the residuals over what the noise makes of them, at least 1.
    pub excess: f64,
}

impl<'s> Alignment<'s> {
    /// Only the design is known.
    pub fn new(stage: &'s Stage) -> Self {
        let designed = FieldParameters::from_model_31(&Parameters::designed(stage), stage);
        let mut origin = DVector::zeros(LAG_RATE + 1);
        origin.as_mut_slice()[..COUNT].copy_from_slice(designed.probes.as_flattened());
        let mut deviations = DVector::zeros(LAG_RATE + 1);
        for probe in deviations.as_mut_slice()[..COUNT].chunks_mut(PER_PROBE) {
            for (deviation, term) in probe.iter_mut().zip(&TERMS) {
                *deviation = term.prior.unwrap_or_default();
            }
            probe[LEVER_ARM] = place_m(stage);
            probe[THETA] = THETA_RAD;
            probe[ETA] = ETA_PART;
            probe[SLOPES] = FALL_PER_M.abs();
            probe[SLOPES + 1..SLOPES + 3].fill(FALL_PER_M.abs());
        }
        deviations[LAG] = LAG_S;
        deviations[LAG_RATE] = RATE;
        Self {
            stage,
            places: designed.places,
            unknowns: Unknowns {
                origin,
                basis: DMatrix::from_diagonal(&deviations),
                prior: DMatrix::identity(LAG_RATE + 1, LAG_RATE + 1),
                ranges: Vec::new(),
            },
            x: DVector::zeros(LAG_RATE + 1),
        }
    }

    /// One step on rows with the reference at the lag found before; `None` where the rows do not show a lag.
    pub fn step(&mut self, rows: &Rows) -> Option<Lag> {
        let normal: Normal<COLUMNS> = self.equations(rows).normal(&self.point(rows))?;
        let factor = self.unknowns.factor(&normal)?;
        let descent = self.unknowns.descent(&normal, &self.x);
        let step = factor.solve(&descent);
        let residuals = 3 * rows.blocks.len().checked_sub(rows.movements.len())?;
        let left = normal.chi_squared() - descent.dot(&step);
        let excess = (left / residuals as f64).max(1.0);
        self.x += &step;
        let covariance = &self.unknowns.basis * factor.inverse() * &self.unknowns.basis * excess;
        let at = |time_s: f64| {
            let cross = 2.0 * time_s * covariance[(LAG, LAG_RATE)];
            let rate = time_s * time_s * covariance[(LAG_RATE, LAG_RATE)];
            (covariance[(LAG, LAG)] + cross + rate).max(0.0).sqrt()
        };
        let [first, last] = [rows.rows.first()?, rows.rows.last()?];
        Some(Lag {
            value_s: step[LAG] * LAG_S,
            rate: step[LAG_RATE] * RATE,
            rate_standard_error: covariance[(LAG_RATE, LAG_RATE)].max(0.0).sqrt(),
            standard_errors_s: [at(first.time_s), at(last.time_s)],
            excess,
        })
    }

    /// The lag of some rows with all other unknowns fixed, and its standard error, s.
    pub fn own_lag_s(&self, rows: &Rows) -> Option<[f64; 2]> {
        let normal: Normal<COLUMNS> = self.equations(rows).normal(&self.point(rows))?;
        let information = normal.curvature(LAG, LAG);
        Some([
            normal.descent(LAG) / information,
            information.sqrt().recip(),
        ])
    }

    /// The lag itself is in the reference of the rows.
    fn point(&self, rows: &Rows) -> Point {
        let mut values = self.unknowns.values(&self.x);
        values.as_mut_slice()[LAG..].fill(0.0);
        Point {
            values,
            offsets: vec![[0.0; 3]; rows.movements.len()],
        }
    }

    fn equations<'r>(&self, rows: &'r Rows) -> FieldEquations<'r> {
        let point = self.point(rows);
        let parameters = FieldParameters::from_values(point.values.as_slice(), self.places);
        let probes = probes(&parameters);
        FieldEquations {
            rows,
            places: self.places,
            noise: Noise {
                white_m: white_m(
                    rows,
                    &probes,
                    &Dynamics::default(),
                    &point.offsets,
                    self.stage,
                ),
                drift: USUAL_DRIFT,
            },
            resets: None,
            faults: &[],
        }
    }
}
