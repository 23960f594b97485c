//! Faults of channels: score tests on one estimate find them, and their severity is their cost in service.
//!
//! | module | what it does |
//! |---|---|
//! | `means` | the log in means over a few rows, without spikes |
//! | `estimate` | the most likely parameters, with faults as further unknowns |
//! | `effects` | the effect on the Hall signals of every fault that is looked for |
//! | `score` | the fault that explains the residuals best, with the parameters profiled out |
//! | `search` | the faults, one after the other as long as they explain more than chance |
//! | `motion` | what errors of channels follow, in a log and in service |
//! | `slow` | slow residuals beyond noise and drift |
//! | `price` | the cost of the faults, and the repair |
//! | `findings` | the faults as findings |

mod effects;
mod estimate;
mod findings;
mod means;
mod motion;
mod price;
mod score;
mod search;
#[cfg(test)]
mod service_tests;
mod slow;
#[cfg(test)]
mod tests;
#[cfg(test)]
mod time_tests;
#[cfg(test)]
mod unexplained_tests;

use crate::fit::Repair;
use crate::judge::predicted::{Predicted, declared_service};
use crate::judge::verdict::LIMITED_MAX;
use effects::{Effects, Shape, Suspect};
use estimate::Estimate;
use findings::not_determined;
use hallstage_input::channels::USUAL_NOISE_M;
use hallstage_input::dataset::Dataset;
use hallstage_input::finding::{Finding, Severity};
use hallstage_input::stage::Stage;
use hallstage_solver::estimator::gauss_newton::Factor;
use hallstage_solver::estimator::model::Model;
use hallstage_solver::estimator::parameters::FieldParameters;
use hallstage_solver::estimator::service::Service;
use hallstage_solver::estimator::terms::{COUNT, PER_PROBE};
use means::Means;
use motion::Follows;
use runtime::ModelKind;
use score::{Fault, Split, split};

/// Maximum number of faults of one log.
const FAULTS_MAX: usize = 11;
/// The faults of a log.
#[derive(Debug, Default)]
pub struct Faults {
    /// The faults as findings, each with its cost.
    pub findings: Vec<Finding>,
    /// The errors of the calibration in service; `None` for parameters that are not fitted to a log that
    /// does not determine them.
    pub predicted: Option<Predicted>,
    /// The parameters without the faults, and their errors in service, where the faults are clear and this
    /// makes a good calibration.
    pub repair: Option<(Repair, Predicted)>,
    /// What they add in service beside [`Self::predicted`].
    pub added: Added,
    /// The residuals over their noise, after all faults: 1 for a sound log.
    pub residual: f64,
}

/// What faults add in service: variances of X, Y, Rz in m2, m2, rad2.
#[derive(Clone, Copy, Debug, Default)]
pub struct Added {
    /// Lags of A, B, C behind their mean, s, where the log shows them.
    pub probe_lags_s: Option<[f64; 3]>,
    /// By drifts of the probes.
    pub drifts: [f64; 3],
    /// By a calibration that beams with a slow rate bend.
    pub bent: [f64; 3],
}

/// The calibration that a log is judged by.
#[derive(Clone, Copy, Debug)]
pub struct Calibrated<'a> {
    /// The parameters; other models are written as the field model.
    pub parameters: &'a FieldParameters,
    /// The parameters that describe the log best: the start of the estimate.
    pub start: &'a FieldParameters,
    /// The model.
    pub model: ModelKind,
    /// The noise of the probes in service, m; `None` where the readings of the log do not show it.
    pub floor_m: Option<[f64; 3]>,
    /// Whether the model describes service and the log determines it without declared errors of the resets.
    pub is_for_service: bool,
    /// Whether the parameters are fitted to the rows that are judged.
    pub is_fitted: bool,
    /// Whether the fit determined what acceleration adds to the readings.
    pub shows_acceleration: bool,
    /// What their rate takes off X, Y1, Y2: m per m/s2 of their own acceleration.
    pub slow_beams_s2: [f64; 3],
}

/// The faults in the rows of a log that the tests of the signals leave; `is_bent` if the fit had other rows, too.
/// `None` where the log is too short or too still for an estimate.
pub fn find_faults(
    dataset: &Dataset,
    stage: &Stage,
    calibrated: Calibrated,
    is_bent: bool,
) -> Option<Faults> {
    let start = calibrated.start;
    let finder = Finder {
        dataset,
        stage,
        calibrated,
        is_bent,
        means: Means::new(dataset, stage, start, calibrated.shows_acceleration),
    };
    let effects = Effects::new(&finder.means, stage, start, 0.0);
    // Probes and beams may be late, and a lag is no noise.
    let late = [4, 5, 0, 1].map(|channel| Suspect::single(Follows::OwnSpeed, channel));
    let late = late.map(|suspect| effects.shaped(suspect, Shape::From(0, usize::MAX)));
    finder.faults(&Estimate::new(&finder.means, start, &late)?)
}

/// A log with the calibration that it is judged by.
struct Finder<'a> {
    dataset: &'a Dataset,
    stage: &'a Stage,
    calibrated: Calibrated<'a>,
    is_bent: bool,
    means: Means,
}

impl Finder<'_> {
    /// Log-likelihood gain of a smaller chi-square, with the noise level profiled out: a fault must explain a share
    /// of the misfit that remains, and nothing explains noise.
    fn gain(&self, from: f64, to: f64) -> f64 {
        let freedom = self.means.freedom();
        freedom * libm::log(from / to.max(freedom))
    }

    fn effects(&self, estimate: &Estimate) -> Effects<'_> {
        let lag_s = estimate.lag_s();
        Effects::new(&self.means, self.stage, &estimate.parameters, lag_s)
    }

    /// The estimate with faults among its unknowns.
    fn refitted(&self, estimate: &Estimate, faults: &[Fault]) -> Option<Estimate> {
        let effects = self.effects(estimate);
        let columns = faults
            .iter()
            .map(|fault| effects.shaped(fault.suspect, fault.shape));
        estimate.with_faults(&self.means, &columns.collect::<Vec<_>>())
    }

    /// The curvature of the calibration's own model.
    fn own_curvature(&self, estimate: &Estimate) -> Option<Factor> {
        estimate.without_faults(match self.calibrated.model {
            ModelKind::Field => PER_PROBE,
            model => Model::from_kind(model).fitted,
        })
    }

    fn faults(&self, faultless: &Estimate) -> Option<Faults> {
        let by = self.calibrated;
        let most_m = self.means.white_m.into_iter().fold(0.0, f64::max);
        let floor_m = match by.floor_m {
            Some(floor_m) => floor_m.map(|floor_m| floor_m.min(most_m)),
            // Filters may hide the noise of all probes.
            None => [USUAL_NOISE_M; 3],
        };
        let declared = declared_service(self.stage, by.parameters, floor_m)?;
        let own = self.own_curvature(faultless)?.inverse();
        let own = Predicted::new(&declared, &own, &[0.0; COUNT]);
        let is_open = own.worst_ratio() > LIMITED_MAX;
        // A log that does not determine the calibration shows no fault. Other models are for other service.
        let decides = is_open && (by.model != ModelKind::Field || by.is_for_service);
        let alone = |finding: Finding, predicted: Predicted| Faults {
            findings: vec![finding],
            predicted: Some(predicted),
            ..Faults::default()
        };
        if decides && !by.is_fitted {
            // That is no fault of parameters from another log.
            return Some(Faults::default());
        } else if decides {
            let (predicted, _) = self.expected(faultless, &declared, 1.0)?;
            return Some(alone(not_determined(&predicted), predicted));
        }
        let (faults, last) = self.search(faultless);
        let estimate = last.as_ref().unwrap_or(faultless);
        let mut out = match self.other_part(faultless, &faults, estimate.chi_squared) {
            Some(Split { from, off, .. }) => {
                let whole = faultless.curvature.inverse();
                let predicted = Predicted::new(&declared, &whole, &off.as_slice()[..COUNT]);
                alone(self.other_state(from, predicted.worst_ratio()), predicted)
            }
            None => self.priced(&faults, (faultless, estimate), &declared)?,
        };
        out.added.bent = self.bent(faultless, &declared)?;
        if is_open {
            let open = not_determined(&own).with_severity(Severity::Warn);
            out.findings.insert(0, open);
        }
        Some(out)
    }

    /// Variances of X, Y, Rz in service because beams with a slow rate bend the calibration.
    fn bent(&self, faultless: &Estimate, declared: &Service) -> Option<[f64; 3]> {
        let sizes_s2 = self.calibrated.slow_beams_s2;
        let beams = || (0..3).filter(|&beam| sizes_s2[beam] > 0.0);
        let faults = beams().map(|beam| Fault {
            suspect: Suspect::single(Follows::OwnAcceleration, 3 + beam),
            shape: Shape::From(0, usize::MAX),
            gain: 0.0,
            alike: Vec::new(),
        });
        let faults: Vec<Fault> = faults.collect();
        if faults.is_empty() {
            return Some([0.0; 3]);
        }
        let with = self.refitted(faultless, &faults)?;
        // A unit of the fault is 1 um per m/s2.
        let sizes = beams().map(|beam| 1e6 * sizes_s2[beam]).enumerate();
        Some(declared.squares(&with.off_by(&self.own_curvature(&with)?, sizes)))
    }

    /// Two stages in one log: a fault with a known onset that explains more than all faults. `left` is the chi-square after
    /// all faults.
    fn other_part(&self, faultless: &Estimate, faults: &[Fault], left: f64) -> Option<Split> {
        let gain = |to: f64| self.gain(faultless.chi_squared, to);
        let needs = (0..faults.len()).map(|number| self.needs(&faults[number], &faults[..number]));
        let by_faults = (gain(left) - needs.sum::<f64>()).max(0.0);
        let penalty = COUNT as f64 * self.means.per_unknown();
        let onsets = faults.iter().filter_map(|fault| fault.shape.onset());
        // Logs may be of two stages.
        let log = |at: &usize| {
            let row = &self.dataset.rows[self.means.first[*at]];
            self.dataset.movements[row.movement].log
        };
        let starts = (1..self.means.first.len()).filter(|at| log(at) != log(&(at - 1)));
        let other = split(faultless, onsets.chain(starts));
        other.filter(|other| gain(faultless.chi_squared - other.gain) - penalty > by_faults)
    }

    /// The errors of the calibration in service: its distance from the estimate, and the covariance of the estimate
    /// times `inflation`. And that distance.
    fn expected(
        &self,
        estimate: &Estimate,
        declared: &Service,
        inflation: f64,
    ) -> Option<(Predicted, Vec<f64>)> {
        let (values, covariance) = match self.calibrated.model {
            ModelKind::Field => (estimate.values(), estimate.covariance()),
            _ => estimate.with_usual_terms()?,
        };
        let own = self.calibrated.parameters.probes.as_flattened();
        let off: Vec<f64> = own.iter().zip(&values).map(|(a, b)| a - b).collect();
        let predicted = Predicted::new(declared, &(covariance * inflation), &off);
        Some((predicted, off))
    }
}
