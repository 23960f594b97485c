//! One likelihood, one currency: what is wrong with a log by score tests on one estimate, and what it costs
//! at work.
//!
//! | module | what it does |
//! |---|---|
//! | `blocks` | the log in means over a few rows, spikes left out |
//! | `noise` | white noise and the walk of the reference: three scalar filters |
//! | `map` | the most likely parameters, with faults as further unknowns |
//! | `columns` | the bank: each fault of a channel or a group, and its course in time |
//! | `score` | which of them explains the residuals, the parameters profiled out |
//! | `findings` | the findings, in words |

mod blocks;
mod columns;
mod findings;
mod map;
mod noise;
mod score;
#[cfg(test)]
mod tests;

use crate::finding::{Finding, Severity};
use crate::fit::Repair;
use crate::fit::with_beams_later;
use crate::input::dataset::Dataset;
use crate::input::stage::Stage;
use crate::judge::verdict::{GOOD_MAX, LIMITED_MAX, Predicted};
use crate::problem::model::Model;
use crate::solve::field::carry::{Service, service_poses};
use crate::solve::field::parameters::FieldParameters;
use crate::solve::field::probe::probes;
use crate::solve::field::terms::{BEYOND_MODEL_31, COUNT, PER_PROBE};
use blocks::Log;
use columns::{FAMILIES, Kind, by_channel, shaped};
use findings::not_determined;
pub(super) use findings::repaired;
use map::{Estimate, UNKNOWNS};
use nalgebra::{DMatrix, DVector};
use runtime::ModelKind;
use score::{Candidate, Scan, Split, split};

/// Faults of one log at most.
const FAULTS_MAX: usize = 6;
/// Errors in service over the noise floor below which a finding is a note.
const NOTE_MAX: f64 = 1.05;
/// Poses spread evenly over this part of a range have half of it as rms, as sines have that start anywhere.
const OF_SINES: f64 = 0.866;
/// One sound log in so many has a fault that a fit can feel.
const RARITY: f64 = 100.0;
/// A lag beyond this part of a servo period is taken off before anything else is looked at.
const LAG_MAX: f64 = 0.5;
/// A fault that costs less is none.
const COST_MIN: f64 = 1.01;
/// Faults whose gains in chi-square differ by less are undecided: odds of 20 to 1, ...
pub(super) const UNDECIDED: f64 = 6.0;
/// ... or by less than this part, for large faults are not quite linear.
const ALIKE: f64 = 0.01;

/// What the diagnosis of a log says.
#[derive(Debug)]
pub struct Diagnosis {
    /// What is wrong, each with its cost.
    pub findings: Vec<Finding>,
    /// What the fit has to expect at work.
    pub predicted: Predicted,
    /// The parameters with the faults taken off and what they have to expect, where the faults are clear and
    /// that makes a good calibration.
    pub repair: Option<(Repair, Predicted)>,
    /// What the residuals have left, over their noise: 1 for a log without any fault.
    pub rest: f64,
}

/// The severity of a cost.
pub fn severity(ratio: f64) -> Severity {
    match ratio {
        ratio if ratio < NOTE_MAX => Severity::Note,
        ratio if ratio < LIMITED_MAX => Severity::Warn,
        _ => Severity::Refuse,
    }
}

/// The diagnosis of the rows of a log that no other test has found to be wrong, from the parameters of a
/// fit. `None` where the log is too short or too still for an estimate.
pub fn diagnose(dataset: &Dataset, stage: &Stage, fitted: Fitted) -> Option<Diagnosis> {
    let log = Log::new(dataset, stage, &probes(fitted.parameters));
    let estimate = Estimate::new(&log, fitted.parameters)?;
    let of = |dataset, log: &Log, estimate, lags_s: [f64; 3]| {
        Job {
            dataset,
            stage,
            log,
            fitted,
            lags_s,
        }
        .diagnosis(estimate)
    };
    let lags_s = estimate.lags_s();
    let most_s = LAG_MAX * stage.servo_period_s;
    if lags_s.iter().all(|lag_s| lag_s.abs() < most_s) {
        return of(dataset, &log, estimate, [0.0; 3]);
    }
    // A lag is not linear.
    let dataset = &with_beams_later(dataset, lags_s, log.half_m);
    let log = Log::new(dataset, stage, &probes(&estimate.parameters));
    let estimate = Estimate::new(&log, &estimate.parameters)?;
    of(dataset, &log, estimate, lags_s)
}

/// The service that `[motion]` declares, of a stage with this white noise of its probes, mm.
pub fn declared_service(
    stage: &Stage,
    parameters: &FieldParameters,
    white_mm: [f64; 3],
) -> Option<Service> {
    let most = |axis: usize| OF_SINES * stage.motion.axes[axis].service;
    let poses = service_poses(([0, 1, 2].map(most), [3, 4, 5].map(most)));
    Service::new(parameters, white_mm, poses)
}

/// What a log is judged by.
#[derive(Clone, Copy, Debug)]
pub struct Fitted<'a> {
    /// The parameters, of other models as one of the field model.
    pub parameters: &'a FieldParameters,
    /// The model.
    pub model: ModelKind,
    /// Whether the model describes service and the log can carry it without what is declared of resets.
    pub for_service: bool,
}

/// A log with what it was fitted by.
struct Job<'a> {
    dataset: &'a Dataset,
    stage: &'a Stage,
    log: &'a Log,
    fitted: Fitted<'a>,
    /// Lags of the beams X, Y1, Y2 that are taken off, s.
    lags_s: [f64; 3],
}

impl Job<'_> {
    fn diagnosis(&self, mut estimate: Estimate) -> Option<Diagnosis> {
        let log = self.log;
        let declared = declared_service(self.stage, self.fitted.parameters, log.white_mm)?;
        // What the log leaves open of the model's own parameters decides before any fault does.
        let of_model = match self.fitted.model {
            ModelKind::Field => PER_PROBE,
            model => Model::of(model).fitted,
        };
        let own = estimate.without_faults(of_model)?.inverse();
        let own = Predicted::new(&declared, &own, &[0.0; COUNT]);
        let is_open = own.worst_ratio() > LIMITED_MAX;
        let by_resets = self.fitted.model == ModelKind::Field && !self.fitted.for_service;
        if is_open && !by_resets {
            let predicted = match self.fitted.model {
                ModelKind::Field => own,
                _ => self.expected(&estimate, &declared, 1.0)?,
            };
            return Some(Diagnosis {
                findings: vec![not_determined(&predicted)],
                predicted,
                repair: None,
                rest: 1.0,
            });
        }
        let whole = estimate.curvature.inverse();
        let carried = Predicted::new(&declared, &whole, &[0.0; COUNT]).worst_ratio() < LIMITED_MAX;
        // A log that leaves the field model open shows what it costs the smaller one, on motion like its own.
        let (free, at_work) = match carried {
            true => (PER_PROBE, declared.clone()),
            false => {
                let poses = log.poses().into_iter();
                let own = Service::new(self.fitted.parameters, log.white_mm, poses)?;
                (BEYOND_MODEL_31, own)
            }
        };
        let other = split(log, &estimate);
        let by_channel = by_channel(log, self.stage, &estimate);
        let raw: Vec<Vec<[f64; 3]>> = FAMILIES
            .iter()
            .map(|family| family.raw(log, &estimate, &by_channel))
            .collect();
        let per_unknown = libm::log(3.0 * log.means.len() as f64);
        let count = log.count() - UNKNOWNS as f64;
        // What lowers chi-square from one value to another is worth this, whatever the noise is: where much
        // is left that no fault explains, as hum, a fault must explain its part of that.
        let worth = |from: f64, to: f64| count.max(1.0) * libm::log(from / to.max(1.0));
        let faultless = estimate.chi_squared;
        let mut penalties = 0.0;
        let mut faults: Vec<(Candidate, Vec<Candidate>)> = Vec::new();
        while faults.len() < FAULTS_MAX {
            let mut candidates = Scan::new(log, &estimate).candidates(&raw);
            let penalty =
                |candidate: &Candidate| per_unknown + 2.0 * libm::log(RARITY * candidate.choices);
            let before = estimate.chi_squared;
            let net =
                |candidate: &Candidate| worth(before, before - candidate.gain) - penalty(candidate);
            candidates.sort_by(|a, b| net(b).total_cmp(&net(a)));
            let Some(best) = candidates.first().copied().filter(|best| net(best) > 0.0) else {
                break;
            };
            let near = f64::max(UNDECIDED, ALIKE * best.gain);
            let is_other = |other: &&Candidate| {
                FAMILIES[other.family].channel != FAMILIES[best.family].channel
                    && best.gain - other.gain < near
            };
            let alike = candidates[1..].iter().filter(is_other).copied().collect();
            faults.push((best, alike));
            let columns: Vec<_> = faults
                .iter()
                .map(|(fault, _)| {
                    let family = &FAMILIES[fault.family];
                    shaped(log, &raw[fault.family], family, fault.course)
                })
                .collect();
            // A fault that can no longer be separated from the others is not a further one.
            let Some(next) = estimate.with_faults(log, &columns) else {
                faults.pop();
                break;
            };
            estimate = next;
            penalties += penalty(&best);
        }
        let rest = (estimate.chi_squared / count.max(1.0)).sqrt();
        // What no fault explains makes the parameters as much less certain.
        let certain = rest.max(1.0).powi(2);
        let without_faults = estimate.without_faults(free)?;
        let nothing = DMatrix::zeros(COUNT, COUNT);
        let cost = |off: &DVector<f64>| {
            Predicted::new(&at_work, &nothing, &off.as_slice()[..COUNT]).worst_ratio()
        };
        let explained = worth(faultless, estimate.chi_squared) - penalties;
        let of_parts = |other: &Split| {
            worth(faultless, faultless - other.gain) - UNKNOWNS as f64 * per_unknown
        };
        let other = other.filter(|other| of_parts(other) > explained.max(0.0));
        let off_by =
            |number: usize| without_faults.solve(&estimate.pull(number)) * estimate.sizes()[number];
        let (predicted, of_parts, offs) = match &other {
            Some(other) => {
                let off = without_faults.solve(&other.pull);
                let predicted = Predicted::new(&declared, &whole, &off.as_slice()[..COUNT]);
                (
                    predicted,
                    Some(self.two_states(other.from, cost(&off))),
                    Vec::new(),
                )
            }
            None => {
                let predicted = self.expected(&estimate, &declared, certain)?;
                (predicted, None, (0..faults.len()).map(off_by).collect())
            }
        };
        let mut costs: Vec<f64> = offs.iter().map(cost).collect();
        let covariance = estimate.curvature.inverse() * certain;
        let likely = per_unknown + 2.0 * libm::log(RARITY);
        let late = self.late_beam(&estimate, &covariance, likely);
        // What bent the fit, whatever else did.
        let late = late.filter(|_| other.is_none()).map(|(beam, late_s)| {
            costs.push(predicted.worst_ratio());
            findings::late_beam(beam, late_s, predicted.worst_ratio())
        });
        let repair = self.repair(&estimate, (&declared, &covariance), &faults, &costs);
        let of_faults = faults.iter().zip(costs.iter().copied()).enumerate();
        let of_faults = of_faults.filter(|(_, (_, cost))| *cost >= COST_MIN);
        let of_faults = of_faults.map(|(number, ((fault, alike), cost))| {
            // A robust fit may have left out of account what it would have cost.
            let cost = cost.min(predicted.worst_ratio());
            self.finding(fault, alike, estimate.sizes()[number], cost)
        });
        let open = (is_open && by_resets).then(|| not_determined(&own).severe(Severity::Warn));
        Some(Diagnosis {
            findings: (open.into_iter().chain(of_parts))
                .chain(late)
                .chain(of_faults)
                .collect(),
            predicted,
            repair,
            rest,
        })
    }

    /// What the fit at hand has to expect: what it is off the estimate, whatever bent it, and what that leaves
    /// open, its variances times `certain`.
    fn expected(&self, estimate: &Estimate, declared: &Service, certain: f64) -> Option<Predicted> {
        let (own, covariance) = match self.fitted.model {
            ModelKind::Field => (estimate.values(), estimate.curvature.inverse()),
            _ => estimate.of_this_stage()?,
        };
        let pairs = (self.fitted.parameters.probes.as_flattened().iter()).zip(&own);
        let off: Vec<f64> = pairs.map(|(a, b)| a - b).collect();
        Some(Predicted::new(declared, &(covariance * certain), &off))
    }

    /// The beam that is not of the time of the two others, and by how much it is late, s.
    fn late_beam(
        &self,
        estimate: &Estimate,
        covariance: &DMatrix<f64>,
        likely: f64,
    ) -> Option<(usize, f64)> {
        let rest_s = estimate.lags_s();
        let lags_s = [0, 1, 2].map(|beam| self.lags_s[beam] + rest_s[beam]);
        let mut sorted = lags_s;
        sorted.sort_by(f64::total_cmp);
        let off_s = lags_s.map(|lag_s| lag_s - sorted[1]);
        let beam = (0..3).max_by(|&a, &b| off_s[a].abs().total_cmp(&off_s[b].abs()))?;
        let late_s = off_s[beam];
        let variance = covariance[(COUNT + beam, COUNT + beam)];
        let is_late = late_s.abs() > LAG_MAX * self.stage.servo_period_s;
        (is_late && late_s * late_s > likely * variance).then_some((beam, late_s))
    }

    /// The estimate that has the faults among its unknowns, and what it has to expect, if it is worth it and
    /// good; an error of the reference or one that may be another's says nothing of the stage.
    fn repair(
        &self,
        estimate: &Estimate,
        (declared, covariance): (&Service, &DMatrix<f64>),
        faults: &[(Candidate, Vec<Candidate>)],
        costs: &[f64],
    ) -> Option<(Repair, Predicted)> {
        let is_worth_it = costs.iter().any(|cost| severity(*cost) > Severity::Note);
        let is_clear = |(fault, alike): &(Candidate, Vec<Candidate>)| {
            let family = &FAMILIES[fault.family];
            alike.is_empty() && (family.channel != "ifm" || family.kind != Kind::Gain)
        };
        if self.fitted.model != ModelKind::Field || !is_worth_it || !faults.iter().all(is_clear) {
            return None;
        }
        let predicted = Predicted::new(declared, covariance, &[0.0; COUNT]);
        (predicted.worst_ratio() <= GOOD_MAX).then(|| {
            let repair = Repair {
                parameters: estimate.parameters,
                covariance: covariance.view((0, 0), (COUNT, COUNT)).into_owned(),
                faults: Vec::new(),
            };
            (repair, predicted)
        })
    }
}
