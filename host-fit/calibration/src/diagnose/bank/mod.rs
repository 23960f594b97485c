//! One likelihood, one currency: what is wrong with a log by score tests on one estimate, and what it costs
//! at work.
//!
//! | module | what it does |
//! |---|---|
//! | `means` | the log in means over a few rows, spikes left out |
//! | `estimate` | the most likely parameters, with faults as further unknowns |
//! | `columns` | the bank: each fault of a channel or a group, and its course in time |
//! | `score` | which of them explains the residuals, the parameters profiled out |
//! | `findings` | the findings, in words |

mod columns;
mod estimate;
mod findings;
mod means;
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
use columns::{BEAMS_LATE, Course, FAMILIES, Family, Kind, by_channel, shaped};
use estimate::Estimate;
use findings::not_determined;
use means::Log;
use nalgebra::{DMatrix, DVector};
use runtime::ModelKind;
use score::{Candidate, Scan, split};
use std::borrow::Cow;

/// Faults of one log at most.
const FAULTS_MAX: usize = 6;
/// Of one channel at most so many are taken off: it may change and come back.
const COURSES_MAX: usize = 2;
/// Errors in service over the noise floor below which a finding is a note.
const NOTE_MAX: f64 = 1.05;
/// Poses spread evenly over this part of a range have half of it as rms, as sines have that start anywhere.
const OF_SINES: f64 = 0.866;
/// One sound log in so many has a fault that a fit can feel.
pub(super) const RARITY: f64 = 100.0;
/// A lag beyond this part of a servo period is taken off before anything else is looked at.
const LAG_MAX: f64 = 0.5;
/// Rounds in which what is not linear settles.
pub(super) const ROUNDS: usize = 8;
/// Of long logs a mean is over so many more rows that there are not many more than these: a scan is
/// quick, and onsets within a tenth of a second.
pub(super) const MEANS_MAX: usize = 4000;
/// A part that counts for nothing: of the errors at work by a fault, of its information that the parameters
/// cannot follow, of the gains of two large ones, which are not quite linear.
const NOTHING: f64 = 0.01;
/// Causes whose chi-squares differ by less are undecided: odds of 20 to 1.
pub(super) const UNDECIDED: f64 = 6.0;

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

/// The diagnosis of the rows of a log that no other test has found to be wrong, from the parameters of a
/// fit. `None` where the log is too short or too still for an estimate.
pub fn diagnose(dataset: &Dataset, stage: &Stage, fitted: Fitted) -> Option<Diagnosis> {
    let (mut later, mut lags_s) = (Cow::Borrowed(dataset), [0.0; 3]);
    let mut start = *fitted.parameters;
    let mut rounds = 0..ROUNDS;
    let (log, first) = loop {
        let log = Log::new(&later, stage, &probes(&start));
        let by_channel = by_channel(&log, stage, &start, 0.0);
        let late = [1, 2].map(|beam| BEAMS_LATE[beam].raw(&log, stage, &by_channel));
        let first = Estimate::first(&log, &start, &late)?;
        let beyond_s = first.lags_s(log.per_unknown() + 2.0 * libm::log(RARITY));
        lags_s
            .iter_mut()
            .zip(beyond_s)
            .for_each(|(lag_s, beyond_s)| *lag_s += beyond_s);
        let most_s = LAG_MAX * stage.servo_period_s;
        if beyond_s.iter().all(|lag_s| lag_s.abs() < most_s) || rounds.next().is_none() {
            break (log, first);
        }
        // A lag is not linear.
        later = Cow::Owned(with_beams_later(dataset, lags_s, 0.5 * stage.y_baseline_m));
        start = first.parameters;
    };
    let faultless = first.faultless(&log)?;
    let job = Job {
        dataset: &later,
        stage,
        fitted,
        log,
        lags_s,
    };
    job.diagnosis(faultless)
}

/// A fault, and those that the log cannot tell it from.
struct Fault {
    best: Candidate,
    alike: Vec<Candidate>,
}

impl Fault {
    fn family(&self) -> &'static Family {
        &FAMILIES[self.best.family]
    }
}

/// A fault of a channel that changes more often than it may: steps and ramps that together follow a course are
/// not that course.
fn without_course<'f>(faults: &'f [Fault], costs: &[f64]) -> Option<&'f Fault> {
    let worse = || {
        let both = faults.iter().zip(costs);
        both.filter(|(_, cost)| severity(**cost) > Severity::Note)
    };
    let of = |channel| worse().filter(move |(other, _)| other.family().1 == channel);
    let mut found = worse().map(|(fault, _)| fault);
    found.find(|fault| of(fault.family().1).count() > COURSES_MAX)
}

/// A log with what it was fitted by.
struct Job<'a> {
    dataset: &'a Dataset,
    stage: &'a Stage,
    fitted: Fitted<'a>,
    log: Log,
    /// Lags of the beams X, Y1, Y2, with what is taken off already, s.
    lags_s: [f64; 3],
}

impl Job<'_> {
    fn freedom(&self) -> f64 {
        (self.log.count() - COUNT as f64).max(1.0)
    }

    /// What lowers chi-square from one value to another is worth this, whatever the noise is: where much
    /// is left that no fault explains, as hum, a fault must explain its part of that.
    fn worth(&self, from: f64, to: f64) -> f64 {
        self.freedom() * libm::log(from / to.max(1.0))
    }

    fn penalty(&self, choices: f64) -> f64 {
        self.log.per_unknown() + 2.0 * libm::log(RARITY * choices)
    }

    /// One fault after the other, as long as they explain more than chance: with the estimate that has them
    /// among its unknowns, and what their gain is worth.
    fn search(&self, mut estimate: Estimate) -> Option<(Vec<Fault>, Estimate, f64)> {
        let log = &self.log;
        let raw_at = |estimate: &Estimate| {
            let (parameters, lag_s) = (&estimate.parameters, estimate.lag_s());
            let by_channel = by_channel(log, self.stage, parameters, lag_s);
            FAMILIES.map(|family| family.raw(log, self.stage, &by_channel))
        };
        let refitted = |estimate: &Estimate, faults: &[Fault], raw: &[Vec<[f64; 3]>]| {
            let column = |fault: &Fault| {
                let raw = &raw[fault.best.family];
                shaped(log, raw, fault.family(), fault.best.course)
            };
            let columns: Vec<_> = faults.iter().map(column).collect();
            estimate.with_faults(log, &columns)
        };
        let mut raw = raw_at(&estimate);
        let (mut faults, mut worth): (Vec<Fault>, f64) = (Vec::new(), 0.0);
        while faults.len() < FAULTS_MAX {
            let mut candidates = Scan::new(log, &estimate)?.candidates(&raw);
            let before = estimate.chi_squared;
            let net = |candidate: &Candidate| {
                self.worth(before, before - candidate.gain) - self.penalty(candidate.choices)
            };
            candidates.sort_by(|a, b| net(b).total_cmp(&net(a)));
            let Some(best) = candidates.first().copied().filter(|best| net(best) > 0.0) else {
                break;
            };
            let near = f64::max(UNDECIDED, NOTHING * best.gain);
            let is_other = |other: &&Candidate| {
                FAMILIES[other.family].1 != FAMILIES[best.family].1 && best.gain - other.gain < near
            };
            let alike = candidates[1..].iter().filter(is_other).copied().collect();
            faults.push(Fault { best, alike });
            // A large fault bends what the others do, too.
            let next = refitted(&estimate, &faults, &raw).and_then(|next| {
                raw = raw_at(&next);
                refitted(&next, &faults, &raw)
            });
            // A fault that can no longer be separated from the others is not a further one.
            let Some(next) = next else {
                faults.pop();
                break;
            };
            worth += self.worth(before, next.chi_squared) - self.penalty(best.choices);
            estimate = next;
        }
        Some((faults, estimate, worth))
    }

    fn diagnosis(&self, faultless: Estimate) -> Option<Diagnosis> {
        let (log, fitted) = (&self.log, &self.fitted);
        let declared = declared_service(self.stage, fitted.parameters, log.white_mm)?;
        // What the log leaves open of the model's own parameters decides before any fault does.
        let of_model = match fitted.model {
            ModelKind::Field => PER_PROBE,
            model => Model::of(model).fitted,
        };
        let own = faultless.without_faults(of_model)?.inverse();
        let own = Predicted::new(&declared, &own, &[0.0; COUNT]);
        let is_open = own.worst_ratio() > LIMITED_MAX;
        let by_resets = fitted.model == ModelKind::Field && !fitted.for_service;
        if is_open && !by_resets {
            let predicted = match fitted.model {
                ModelKind::Field => own,
                _ => self.expected(&faultless, &declared, 1.0)?,
            };
            return Some(Diagnosis {
                findings: vec![not_determined(&predicted)],
                predicted,
                repair: None,
                rest: 1.0,
            });
        }
        let whole = faultless.curvature.inverse();
        let carried = Predicted::new(&declared, &whole, &[0.0; COUNT]).worst_ratio() < LIMITED_MAX;
        let other = split(log, &faultless);
        let before = faultless.chi_squared;
        let (faults, estimate, worth) = self.search(faultless)?;
        let rest = (estimate.chi_squared / self.freedom()).sqrt();
        // What no fault explains makes the parameters as much less certain.
        let certain = rest.max(1.0).powi(2);
        // A log that leaves the field model open shows what it costs the smaller one, on motion like its own.
        let (free, at_work) = match carried {
            true => (PER_PROBE, declared.clone()),
            false => {
                let poses = log.poses();
                let own = Service::new(fitted.parameters, log.white_mm, poses)?;
                (BEYOND_MODEL_31, own)
            }
        };
        let without_faults = estimate.without_faults(free)?;
        let nothing = DMatrix::zeros(COUNT, COUNT);
        let cost = |pull: &DVector<f64>| {
            let off = without_faults.solve(pull);
            Predicted::new(&at_work, &nothing, &off.as_slice()[..COUNT]).worst_ratio()
        };
        let of_parts =
            |gain: f64| self.worth(before, before - gain) - COUNT as f64 * self.log.per_unknown();
        let open = (is_open && by_resets).then(|| not_determined(&own).severe(Severity::Warn));
        let mut findings: Vec<Finding> = open.into_iter().collect();
        if let Some(other) = other.filter(|other| of_parts(other.gain) > worth.max(0.0)) {
            let off = without_faults.solve(&other.pull);
            findings.push(self.two_states(other.from, cost(&other.pull)));
            return Some(Diagnosis {
                findings,
                predicted: Predicted::new(&declared, &whole, &off.as_slice()[..COUNT]),
                repair: None,
                rest,
            });
        }
        let predicted = self.expected(&estimate, &declared, certain)?;
        let cost_of = |number: usize| cost(&(estimate.pull(number) * estimate.sizes()[number]));
        let mut costs: Vec<f64> = (0..faults.len()).map(cost_of).collect();
        for (number, (fault, cost)) in faults.iter().zip(&costs).enumerate() {
            if *cost >= 1.0 + NOTHING {
                // A robust fit may have left out of account what it would have cost.
                let cost = cost.min(predicted.worst_ratio());
                findings.push(self.finding(fault, estimate.sizes()[number], cost));
            }
        }
        if let Some(fault) = without_course(&faults, &costs) {
            findings.push(findings::without_course(fault, predicted.worst_ratio()));
        }
        if let Some((fault, late_ms)) = self.late_beam() {
            // What bent the fit, whatever else did.
            costs.push(predicted.worst_ratio());
            findings.insert(0, self.finding(&fault, late_ms, predicted.worst_ratio()));
        }
        let covariance = estimate.curvature.inverse() * certain;
        let repair = self.repair(
            &estimate,
            (&declared, &covariance),
            &faults,
            (&costs, predicted.worst_ratio()),
        );
        Some(Diagnosis {
            findings,
            predicted,
            repair,
            rest,
        })
    }

    /// The beam that is not of the time of the two others, and by how much it is late, ms.
    fn late_beam(&self) -> Option<(Fault, f64)> {
        let mut sorted = self.lags_s;
        sorted.sort_by(f64::total_cmp);
        let off_s = self.lags_s.map(|lag_s| lag_s - sorted[1]);
        let beam = (0..3).max_by(|&a, &b| off_s[a].abs().total_cmp(&off_s[b].abs()))?;
        let best = Candidate {
            family: FAMILIES.len() - 3 + beam,
            course: Course::Whole,
            gain: 0.0,
            choices: 1.0,
        };
        let alike = Vec::new();
        let is_late = off_s[beam].abs() > LAG_MAX * self.stage.servo_period_s;
        is_late.then_some((Fault { best, alike }, off_s[beam] * 1e3))
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

    /// The estimate that has the faults among its unknowns, and what it has to expect, if it is good and a fault
    /// costs something, or the fit at hand does, whose rows have more that is wrong; an error of the reference or
    /// one that may be another's says nothing of the stage.
    fn repair(
        &self,
        estimate: &Estimate,
        (declared, covariance): (&Service, &DMatrix<f64>),
        faults: &[Fault],
        (costs, of_fit): (&[f64], f64),
    ) -> Option<(Repair, Predicted)> {
        let counts = |cost: &f64| severity(*cost) > Severity::Note;
        let is_clear = |fault: &Fault| {
            let family = fault.family();
            fault.alike.is_empty() && (family.1 != "ifm" || family.0 != Kind::Gain)
        };
        let mut of_faults = faults.iter().zip(costs);
        let are_clear = of_faults.all(|(fault, cost)| !counts(cost) || is_clear(fault))
            && without_course(faults, costs).is_none();
        let is_worth_it = counts(&of_fit) || costs.iter().any(counts);
        if self.fitted.model != ModelKind::Field || !is_worth_it || !are_clear {
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
