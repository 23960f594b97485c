//! The most likely parameters of the field model, with faults as further unknowns: the fit's own equations
//! and prior, over means.

use super::means::Log;
use super::{FAULTS_MAX, ROUNDS};
use hallstage_solver::estimator::gauss_newton::{self, Factor, Limits, Point, Solved, Unknowns};
use hallstage_solver::estimator::noise::{DRIFT_SPREAD, USUAL_DRIFT_MM, drift_mm};
use hallstage_solver::estimator::parameters::{FieldParameters, HELD, unknowns};
use hallstage_solver::estimator::probe::probes;
use hallstage_solver::estimator::terms::{BEYOND_MODEL_31, COUNT, PER_PROBE, TERMS};
use hallstage_solver::estimator::whiten::{FieldEquations, Gain, Noise, UNKNOWNS};
use nalgebra::{DMatrix, DVector};

/// Columns: the unknowns of the fit, the sizes of the faults, and the residual in the last one; a multiple of
/// four is quick.
pub(super) const WIDTH: usize = (UNKNOWNS + FAULTS_MAX + 1).next_multiple_of(4);
pub(super) const RESIDUAL: usize = WIDTH - 1;

/// The priors are so much wider than what magnets and a workshop give: see
/// [`TERMS`](hallstage_solver::estimator::terms::TERMS).
const USUAL_PART: f64 = 0.5;
/// E in parts of its prior, over the part that the terms even in u have of theirs: by 60 simulated stages.
const CARRY_PART: f64 = 0.4;
/// Terms even in u have at least this part of their prior: the probes stand 2.5 mm off the tilt plane, which
/// alone makes .03 of E.
const EVEN_LEAST: f64 = 0.075;
/// Standard deviation of the lag and of the parameters whose priors are flat, in their units: so far that no log
/// that shows them feels it.
const OPEN: f64 = 1e3;

/// Columns of a mean for A, B, C.
pub(super) type Row = [[f64; WIDTH]; 3];

/// The estimate of a log.
#[derive(Debug)]
pub(super) struct Estimate {
    pub(super) parameters: FieldParameters,
    /// By mean, whitened.
    pub(super) rows: Vec<Row>,
    /// What whitened them.
    pub(super) gains: Vec<Gain>,
    /// The curvature, with the prior: the unknowns, then the faults.
    pub(super) squares: DMatrix<f64>,
    pub(super) curvature: Factor,
    /// The step to the very end, which is too small for a fit but not where parts of a log are compared.
    pub(super) step: DVector<f64>,
    /// Sum of squares of the whitened residuals.
    pub(super) chi_squared: f64,
    noise: Noise,
    at: Point,
    /// Its precision; the mean is zero.
    pub(super) prior: DMatrix<f64>,
}

impl Estimate {
    /// From a start near the truth, with these faults, under noise as usual.
    pub(super) fn first(
        log: &Log,
        start: &FieldParameters,
        faults: &[Vec<[f64; 3]>],
    ) -> Option<Self> {
        let values = start.probes.as_flattened();
        let at = Point {
            values: DVector::from_fn(UNKNOWNS, |k, _| values.get(k).copied().unwrap_or(0.0)),
            offsets: vec![[0.0; 3]; log.means.movements.len()],
        };
        let noise = Noise {
            white_mm: log.white_mm,
            drift_mm: USUAL_DRIFT_MM,
        };
        Self::descend(log, start.places, at, noise, faults)
    }

    /// Without faults, under the noise that the residuals show.
    pub(super) fn faultless(self, log: &Log) -> Option<Self> {
        let (parameters, at, mut noise) = (&self.parameters, &self.at, self.noise);
        let blocks = (log.means).evaluate(&probes(parameters), self.lag_s(), &at.offsets);
        let covariance = self.curvature.inverse();
        noise.drift_mm = drift_mm(&log.means, &blocks, noise.white_mm, &covariance);
        for (drift_mm, usual_mm) in noise.drift_mm.iter_mut().zip(USUAL_DRIFT_MM) {
            // A free walk swallows faults.
            *drift_mm = drift_mm.min(usual_mm * libm::exp(DRIFT_SPREAD));
        }
        Self::descend(log, parameters.places, self.at, noise, &[])
    }

    fn descend(
        log: &Log,
        places: [[f64; 2]; 3],
        at: Point,
        noise: Noise,
        faults: &[Vec<[f64; 3]>],
    ) -> Option<Self> {
        let size = UNKNOWNS + faults.len();
        let mut prior = unknowns(&places, [HELD; 2]).prior;
        for k in (0..=COUNT).filter(|k| k % PER_PROBE < BEYOND_MODEL_31) {
            prior[(k, k)] += 1.0 / (OPEN * OPEN);
        }
        let unknowns = Unknowns {
            origin: DVector::zeros(size),
            basis: DMatrix::identity(size, size),
            prior: prior.clone().resize(size, size, 0.0),
            ranges: Vec::new(),
        };
        let equations = FieldEquations {
            rows: &log.means,
            places,
            noise,
            resets_mm: log.resets_mm,
            faults,
        };
        let x = at.values.resize_vertically(size, 0.0);
        let solved: Option<Solved<WIDTH>> =
            gauss_newton::solve(&equations, &unknowns, x, at.offsets, Limits::CLOSE);
        let solved = solved?;
        let (rows, gains) = equations.whitened(&solved.point);
        let curvature = unknowns.factor(&solved.normal)?;
        Some(Self {
            parameters: equations.parameters(&solved.point),
            rows,
            gains,
            step: curvature.solve(&unknowns.descent(&solved.normal, &solved.x)),
            curvature,
            squares: unknowns.curvature(&solved.normal),
            chi_squared: solved.normal.chi_squared(),
            noise,
            at: solved.point,
            prior,
        })
    }

    /// With columns of faults (changes of the signals, mm) as further unknowns.
    pub(super) fn with_faults(&self, log: &Log, faults: &[Vec<[f64; 3]>]) -> Option<Self> {
        let places = self.parameters.places;
        Self::descend(log, places, self.at.clone(), self.noise, faults)
    }

    /// Lags of the beams X, Y1, Y2, s, where the faults are what Y1 and Y2 are later than X, ms; 0 where the
    /// square of one is not so many times its variance.
    pub(super) fn lags_s(&self, likely: f64) -> [f64; 3] {
        let covariance = self.curvature.inverse();
        let sure_s = |(k, unit_s): (usize, f64)| {
            let value = self.at.values[k];
            let is_sure = value * value > likely * covariance[(k, k)];
            if is_sure { unit_s * value } else { 0.0 }
        };
        let [x, y1, y2] = [(COUNT, 1.0), (UNKNOWNS, 1e-3), (UNKNOWNS + 1, 1e-3)].map(sure_s);
        [x, x + y1, x + y2]
    }

    /// The lag of the reference, s.
    pub(super) fn lag_s(&self) -> f64 {
        self.at.values[COUNT]
    }

    /// The values of the unknowns: the parameters, the lag of the reference (s), k and h.
    pub(super) fn values(&self) -> DVector<f64> {
        self.at.values.rows(0, UNKNOWNS).into_owned()
    }

    /// How large the faults are.
    pub(super) fn sizes(&self) -> &[f64] {
        &self.at.values.as_slice()[UNKNOWNS..]
    }

    /// What a unit of a fault adds to the gradient of the parameters.
    pub(super) fn pull(&self, fault: usize) -> DVector<f64> {
        DVector::from_fn(UNKNOWNS, |k, _| self.squares[(k, UNKNOWNS + fault)])
    }

    /// The curvature of a fit that knows of no faults and has only the first `free` parameters of each
    /// probe.
    pub(super) fn without_faults(&self, free: usize) -> Option<Factor> {
        let is_free = |unknown: usize| unknown >= COUNT || unknown % PER_PROBE < free;
        let own = DMatrix::from_fn(UNKNOWNS, UNKNOWNS, |i, j| match is_free(i) && is_free(j) {
            true => self.squares[(i, j)],
            false => 0.0,
        });
        Factor::new(&own, 0.0)
    }

    /// The parameters and their covariance where terms beyond Model (31) are as large as on a stage of this
    /// kind, for what a log leaves open of them is what it does to a model without them. A magnet as designed
    /// has none that are even in u: how large those are that the log shows says how large the others are.
    pub(super) fn of_this_stage(&self) -> Option<(DVector<f64>, DMatrix<f64>)> {
        let powers = |k: usize| TERMS[k % PER_PROBE].powers;
        let is_even = |k: &usize| powers(*k) != [0; 3] && powers(*k)[0].is_multiple_of(2);
        let mut imperfect = USUAL_PART;
        let mut found = None;
        for _ in 0..ROUNDS {
            let mut squares = self.squares.clone();
            let mut change = DVector::zeros(squares.nrows());
            for k in (0..COUNT).filter(|k| k % PER_PROBE >= BEYOND_MODEL_31) {
                let part = match powers(k) {
                    [0, 0, 0] => CARRY_PART * imperfect,
                    _ if is_even(&k) => imperfect,
                    _ => USUAL_PART,
                };
                let more = (1.0 / (part * part) - 1.0) * self.prior[(k, k)];
                squares[(k, k)] += more;
                change[k] = -more * self.at.values[k];
            }
            let factor = Factor::new(&squares, 0.0)?;
            let values = &self.at.values + factor.solve(&change);
            let covariance = factor.inverse();
            // Squares over the number of terms that the log, not the prior, tells (MacKay 1992).
            let sum =
                |of: &dyn Fn(usize) -> f64| -> f64 { (0..COUNT).filter(is_even).map(of).sum() };
            let squares = sum(&|k| self.prior[(k, k)] * values[k] * values[k]);
            let by_prior = |k| self.prior[(k, k)] * covariance[(k, k)] / (imperfect * imperfect);
            let count = sum(&|k| 1.0 - by_prior(k)).max(1e-9);
            imperfect = (squares / count).sqrt().clamp(EVEN_LEAST, 1.0);
            found = Some((values, covariance));
        }
        found
    }
}
