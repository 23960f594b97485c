//! The most likely parameters of the field model, with faults as further unknowns. Equations and prior are the
//! fit's, over means.

use super::FAULTS_MAX;
use super::means::Means;
use crate::diagnose::limits::ROUNDS;
use hallstage_solver::estimator::dynamics::Dynamics;
use hallstage_solver::estimator::gauss_newton::{self, Factor, Limits, Point, Solved, Unknowns};
use hallstage_solver::estimator::noise::{DRIFT_SPREAD, USUAL_DRIFT, drift};
use hallstage_solver::estimator::parameters::{FieldParameters, HELD, unknowns};
use hallstage_solver::estimator::probe::probes;
use hallstage_solver::estimator::terms::{BEYOND_MODEL_31, COUNT, PER_PROBE, TERMS};
use hallstage_solver::estimator::whiten::{FieldEquations, Gain, LAG, Noise, PROBE_LAGS, UNKNOWNS};
use nalgebra::{DMatrix, DVector};

/// Columns: the unknowns of the fit, the sizes of the faults, and last the residual; a multiple of four is quick.
pub(super) const WIDTH: usize = (UNKNOWNS + FAULTS_MAX + 1).next_multiple_of(4);
pub(super) const RESIDUAL: usize = WIDTH - 1;

/// Terms of usual magnets from a usual workshop, in parts of their prior in
/// [`TERMS`].
const USUAL_PART: f64 = 0.5;
/// E in parts of its prior, over the part of the terms even in u: from 60 simulated stages.
const E_PART: f64 = 0.4;
/// Least part of their prior of the terms even in u: the probes stand 2.5 mm off the tilt plane, which alone makes
/// .03 of E.
const EVEN_LEAST: f64 = 0.075;
/// Standard deviation of the lag and of parameters with a flat prior, in their units: so large that no log that
/// determines them is changed by it.
const FLAT: f64 = 1e3;

/// Columns of a mean for A, B, C.
pub(super) type Row = [[f64; WIDTH]; 3];

/// The estimate of a log.
#[derive(Debug)]
pub(super) struct Estimate {
    pub(super) parameters: FieldParameters,
    /// The whitened rows, by mean.
    pub(super) rows: Vec<Row>,
    /// The gains of the filter that whitens them.
    pub(super) gains: Vec<Gain>,
    /// The curvature, with the prior: the unknowns, then the faults.
    pub(super) squares: DMatrix<f64>,
    pub(super) curvature: Factor,
    /// The last step, too small for a fit but not for a comparison of parts of a log.
    pub(super) step: DVector<f64>,
    /// Sum of squares of the whitened residuals.
    pub(super) chi_squared: f64,
    pub(super) noise: Noise,
    at: Point,
    /// The precision of the prior; its mean is zero.
    pub(super) prior: DMatrix<f64>,
}

impl Estimate {
    /// Without faults, from a start near the truth, with the noise of the residuals that these faults leave.
    pub(super) fn new(
        means: &Means,
        start: &FieldParameters,
        faults: &[Vec<[f64; 3]>],
    ) -> Option<Self> {
        let values = start.probes.as_flattened();
        let at = Point {
            values: DVector::from_fn(UNKNOWNS, |k, _| values.get(k).copied().unwrap_or(0.0)),
            offsets: vec![[0.0; 3]; means.rows.movements.len()],
        };
        let mut noise = Noise {
            white_m: means.white_m,
            drift: USUAL_DRIFT,
        };
        let first = Self::descend(means, start.places, at, noise, faults)?;
        let (probes, offsets) = (probes(&first.parameters), &first.at.offsets);
        let mut blocks = (means.rows).evaluate(&probes, &first.dynamics(), offsets);
        for (fault, size) in faults.iter().zip(first.sizes()) {
            for (block, by) in blocks.iter_mut().zip(fault) {
                (0..3).for_each(|k| block.residual_m[k] -= size * by[k]);
            }
        }
        let covariance = first.without_faults(PER_PROBE)?.inverse();
        noise.drift = drift(&means.rows, &blocks, noise.white_m, &covariance);
        for (drift, usual) in noise.drift.iter_mut().zip(USUAL_DRIFT) {
            // A free walk swallows faults.
            *drift = drift.min(usual * libm::exp(DRIFT_SPREAD));
        }
        Self::descend(means, start.places, first.at, noise, &[])
    }

    fn descend(
        means: &Means,
        places: [[f64; 2]; 3],
        at: Point,
        noise: Noise,
        faults: &[Vec<[f64; 3]>],
    ) -> Option<Self> {
        let size = UNKNOWNS + faults.len();
        let mut prior = unknowns((&places, means.place_m), [HELD; 2], means.acceleration).prior;
        let flat = (0..COUNT).filter(|k| k % PER_PROBE < BEYOND_MODEL_31);
        for k in flat.chain([LAG]) {
            prior[(k, k)] += 1.0 / (FLAT * FLAT);
        }
        // A late probe is a fault that is looked for.
        for k in [PROBE_LAGS, PROBE_LAGS + 1] {
            prior[(k, k)] = 1.0 / (HELD * HELD);
        }
        let unknowns = Unknowns {
            origin: DVector::zeros(size),
            basis: DMatrix::identity(size, size),
            prior: prior.clone().resize(size, size, 0.0),
            ranges: Vec::new(),
        };
        let equations = FieldEquations {
            rows: &means.rows,
            places,
            noise,
            resets: means.resets,
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

    /// With effects of faults (changes of the signals, m) as further unknowns.
    pub(super) fn with_faults(&self, means: &Means, faults: &[Vec<[f64; 3]>]) -> Option<Self> {
        let places = self.parameters.places;
        Self::descend(means, places, self.at.clone(), self.noise, faults)
    }

    /// The lag of the reference, s.
    pub(super) fn lag_s(&self) -> f64 {
        self.at.values[LAG]
    }

    /// Lags, and changes by acceleration.
    fn dynamics(&self) -> Dynamics {
        Dynamics::from_values(self.at.values.as_slice())
    }

    /// The values of the unknowns.
    pub(super) fn values(&self) -> DVector<f64> {
        self.at.values.rows(0, UNKNOWNS).into_owned()
    }

    /// The sizes of the faults.
    pub(super) fn sizes(&self) -> &[f64] {
        &self.at.values.as_slice()[UNKNOWNS..]
    }

    /// The error of the parameters in a fit of this curvature that does not know of these faults, by number and size.
    pub(super) fn off_by(
        &self,
        curvature: &Factor,
        faults: impl Iterator<Item = (usize, f64)>,
    ) -> Vec<f64> {
        let faults: Vec<(usize, f64)> = faults.collect();
        let gradient = |k: usize, fault: usize| self.squares[(k, UNKNOWNS + fault)];
        let sum = |k: usize| {
            faults
                .iter()
                .map(|(fault, size)| gradient(k, *fault) * size)
                .sum()
        };
        let off = curvature.solve(&DVector::from_fn(UNKNOWNS, |k, _| sum(k)));
        off.as_slice()[..COUNT].to_vec()
    }

    /// The covariance of all unknowns. Where terms are larger than usual, also the others are, and their prior pulls
    /// them to zero.
    pub(super) fn covariance(&self) -> DMatrix<f64> {
        let own = self.curvature.inverse();
        let mut prior = DMatrix::zeros(own.nrows(), own.nrows());
        let terms = || (0..COUNT).filter(|k| k % PER_PROBE >= BEYOND_MODEL_31);
        terms().for_each(|k| prior[(k, k)] = self.prior[(k, k)]);
        // A fault that is not found bends terms, too: harsh magnets fill their prior, no more.
        let part = self.size_of(terms(), &self.at.values, &own, 1.0);
        let over_usual = part.clamp(USUAL_PART, 1.0).powi(2) / (USUAL_PART * USUAL_PART);
        &own + &own * (prior * (over_usual - 1.0)) * &own
    }

    /// The size of terms in parts of their prior: squares over the number of them that the log determines (MacKay
    /// 1992), with this part of the prior.
    fn size_of(
        &self,
        terms: impl Iterator<Item = usize>,
        values: &DVector<f64>,
        covariance: &DMatrix<f64>,
        part: f64,
    ) -> f64 {
        let (mut squares, mut count) = (0.0, 0.0);
        for k in terms {
            let prior = self.prior[(k, k)];
            squares += prior * values[k] * values[k];
            count += 1.0 - prior * covariance[(k, k)] / (part * part);
        }
        (squares / f64::max(count, 1e-9)).sqrt()
    }

    /// The curvature of a fit without faults, with the first `free` parameters of each probe.
    pub(super) fn without_faults(&self, free: usize) -> Option<Factor> {
        let is_free = |unknown: usize| unknown >= COUNT || unknown % PER_PROBE < free;
        let own = DMatrix::from_fn(UNKNOWNS, UNKNOWNS, |i, j| match is_free(i) && is_free(j) {
            true => self.squares[(i, j)],
            false => 0.0,
        });
        Factor::new(&own, 0.0)
    }

    /// The parameters and their covariance with terms beyond Model (31) of the usual size: their uncertainty is the
    /// error of a model without them. An ideal magnet has no terms even in u. Their fitted size shows how imperfect
    /// this magnet is.
    pub(super) fn with_usual_terms(&self) -> Option<(DVector<f64>, DMatrix<f64>)> {
        let powers = |k: usize| TERMS[k % PER_PROBE].powers;
        let is_even = |k: &usize| powers(*k) != [0; 3] && powers(*k)[0].is_multiple_of(2);
        let mut imperfect = USUAL_PART;
        let mut found = None;
        for _ in 0..ROUNDS {
            let mut squares = self.squares.clone();
            let mut change = DVector::zeros(squares.nrows());
            for k in (0..COUNT).filter(|k| k % PER_PROBE >= BEYOND_MODEL_31) {
                let part = match powers(k) {
                    [0, 0, 0] => E_PART * imperfect,
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
            let even = (0..COUNT).filter(is_even);
            let size = self.size_of(even, &values, &covariance, imperfect);
            imperfect = size.clamp(EVEN_LEAST, 1.0);
            found = Some((values, covariance));
        }
        found
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::faults::effects::{Effects, Shape, Suspect};
    use crate::diagnose::faults::motion::Follows;
    use hallstage_input::shipped::stage;
    use hallstage_simulate::assembly::Assembly;
    use hallstage_simulate::pose::StagePose;
    use hallstage_simulate::protocol::{Protocol, Run};
    use hallstage_simulate::recording::record;
    use hallstage_simulate::sensors::SensorErrors;
    use hallstage_solver::estimator::paper::Parameters;
    use std::f64::consts::TAU;

    #[test]
    fn terms_that_are_larger_than_usual_make_also_the_hidden_ones_uncertain() {
        let (stage, seed) = (stage(), 3);
        let mut run = Protocol::Combined.run(stage.servo_period_s, seed);
        run.movements.truncate(1);
        let assembly = Assembly::draw(&stage, seed);
        let log = record(&stage, &assembly, run, &SensorErrors::USUAL, seed).expect("clear");
        let log = log.dataset(&stage).expect("a triangle");
        let designed = FieldParameters::from_model_31(&Parameters::designed(&stage), &stage);
        let means = Means::new(&log, &stage, &designed, true);
        let mut estimate = Estimate::new(&means, &designed, &[]).expect("an estimate");
        let own = estimate.curvature.inverse();
        assert_eq!(estimate.covariance(), own, "usual magnets");
        for k in (0..COUNT).filter(|k| k % PER_PROBE >= BEYOND_MODEL_31) {
            estimate.at.values[k] = 2.0 / self_prior(&estimate, k);
        }
        let more = estimate.covariance();
        let grown = |k: usize| more[(k, k)] / own[(k, k)];
        // uz3 is as uncertain as its prior, eta is known from the log.
        assert!(grown(term("uz3")) > 3.0, "{}", grown(term("uz3")));
        assert!(grown(term("eta")) < 2.0, "{}", grown(term("eta")));
    }

    #[test]
    fn lags_that_a_log_leaves_open_do_not_pass_for_drift() {
        let stage = stage();
        // Eight seconds of a run of thirty, whose tones are hardly apart.
        let pose = |row: i32| {
            let time_s = 3.7 + stage.servo_period_s * f64::from(row);
            let tone = |axis: usize, cycles: f64| {
                let angle = TAU * cycles * time_s / 30.0 + 1.7 * axis as f64;
                stage.motion.axes[axis].service * libm::sin(angle)
            };
            StagePose {
                planar: [tone(0, 13.0), tone(1, 17.0), tone(2, 14.0)],
                vertical: [tone(3, 19.0), tone(4, 16.0), tone(5, 11.0)],
            }
        };
        let run = Run::planned((0..4000).map(pose).collect());
        let log = record(
            &stage,
            &Assembly::draw(&stage, 2),
            run,
            &SensorErrors::USUAL,
            2,
        );
        let log = log.expect("clear").dataset(&stage).expect("a triangle");
        let designed = FieldParameters::from_model_31(&Parameters::designed(&stage), &stage);
        let means = Means::new(&log, &stage, &designed, false);
        let effects = Effects::new(&means, &stage, &designed, 0.0);
        let late = [4, 5, 0, 1].map(|channel| Suspect::single(Follows::OwnSpeed, channel));
        let late = late.map(|suspect| effects.shaped(suspect, Shape::From(0, usize::MAX)));
        let estimate = Estimate::new(&means, &designed, &late).expect("an estimate");
        let [x, y, _] = estimate.noise.drift;
        assert!(x < 1.5e-7 && y < 1.5e-7, "{x} {y}");
    }

    fn term(name: &str) -> usize {
        TERMS
            .iter()
            .position(|term| term.name == name)
            .expect("a term")
    }

    fn self_prior(estimate: &Estimate, k: usize) -> f64 {
        estimate.prior[(k, k)].sqrt()
    }
}
