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
mod service_tests;
#[cfg(test)]
mod tests;

use crate::fit::{Repair, with_beams_later};
use crate::judge::predicted::{Predicted, declared_service};
use crate::judge::verdict::{GOOD_MAX, LIMITED_MAX, severity};
use columns::{Bank, Course, Family};
use estimate::Estimate;
use findings::{changes_often, not_determined};
use hallstage_input::channel::Channel;
use hallstage_input::dataset::Dataset;
use hallstage_input::finding::{Finding, Quantity, Severity};
use hallstage_input::stage::Stage;
use hallstage_solver::estimator::gauss_newton::Factor;
use hallstage_solver::estimator::model::Model;
use hallstage_solver::estimator::parameters::FieldParameters;
use hallstage_solver::estimator::probe::probes;
use hallstage_solver::estimator::service::Service;
use hallstage_solver::estimator::terms::{COUNT, PER_PROBE};
use means::Log;
use nalgebra::DMatrix;
use runtime::ModelKind;
use score::{Fault, Scan, Split, split};
use std::borrow::Cow;

/// Faults of one log at most.
const FAULTS_MAX: usize = 6;
/// Of one channel at most so many are taken off: it may change and come back. Steps and ramps can follow another
/// course, too, but are not that.
const COURSES_MAX: usize = 2;
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
/// cannot follow, of the gains of two large ones, which are not quite linear, of the residual as a prior.
pub(super) const NOTHING: f64 = 0.01;
/// Causes whose chi-squares differ by less are undecided: odds of 20 to 1.
pub(super) const UNDECIDED: f64 = 6.0;

/// What the diagnosis of a log says.
#[derive(Debug, Default)]
pub struct Diagnosis {
    /// What is wrong, each with its cost.
    pub findings: Vec<Finding>,
    /// What the fit has to expect at work; `None` of parameters that are not fitted to a log that leaves them open.
    pub predicted: Option<Predicted>,
    /// The parameters with the faults taken off and what they have to expect, where the faults are clear and
    /// that makes a good calibration.
    pub repair: Option<(Repair, Predicted)>,
    /// What the residuals have left, over their noise: 1 for a log without any fault.
    pub rest: f64,
}

/// What a log is judged by.
#[derive(Clone, Copy, Debug)]
pub struct Fitted<'a> {
    /// The parameters, of other models as one of the field model.
    pub parameters: &'a FieldParameters,
    /// The parameters that describe the log best, from which the estimate starts.
    pub start: &'a FieldParameters,
    /// The model.
    pub model: ModelKind,
    /// Whether the model describes service and the log can carry it without what is declared of resets.
    pub for_service: bool,
    /// Whether they are fitted to the rows that are judged.
    pub is_to_rows: bool,
}

/// The diagnosis of the rows of a log that no other test has found to be wrong, from the parameters of a
/// fit; `is_bent` where it had some that were. `None` where the log is too short or too still for an estimate.
pub fn diagnose(
    dataset: &Dataset,
    stage: &Stage,
    fitted: Fitted,
    is_bent: bool,
) -> Option<Diagnosis> {
    let mut job = Job {
        dataset: Cow::Borrowed(dataset),
        stage,
        fitted,
        is_bent,
        log: Log::new(dataset, stage, &probes(fitted.start)),
        lags_s: [0.0; 3],
    };
    let mut start = *fitted.start;
    let mut rounds = 0..ROUNDS;
    let first = loop {
        let bank = Bank::new(&job.log, stage, &start, 0.0);
        let late = [1, 2].map(|beam| bank.raw(Family::late(beam)));
        let first = Estimate::first(&job.log, &start, &late)?;
        let beyond_s = first.lags_s(job.log.per_fault());
        (0..3).for_each(|beam| job.lags_s[beam] += beyond_s[beam]);
        if !beyond_s.iter().any(|lag_s| job.is_lag(*lag_s)) || rounds.next().is_none() {
            break first;
        }
        // A lag is not linear.
        let later = with_beams_later(dataset, job.lags_s, 0.5 * stage.y_baseline_m);
        start = first.parameters;
        job.log = Log::new(&later, stage, &probes(&start));
        job.dataset = Cow::Owned(later);
    };
    job.diagnosis(&first.faultless(&job.log)?)
}

/// How far each is from the one in the middle.
fn off_middle(of: [f64; 3]) -> [f64; 3] {
    let mut sorted = of;
    sorted.sort_by(f64::total_cmp);
    of.map(|x| x - sorted[1])
}

/// A log with what it was fitted by.
struct Job<'a> {
    dataset: Cow<'a, Dataset>,
    stage: &'a Stage,
    fitted: Fitted<'a>,
    is_bent: bool,
    log: Log,
    /// Lags of the beams X, Y1, Y2, with what is taken off already, s.
    lags_s: [f64; 3],
}

impl Job<'_> {
    /// What lowers chi-square from one value to another is worth this, whatever the noise is: where much
    /// is left that no fault explains, as hum, a fault must explain its part of that.
    fn worth(&self, from: f64, to: f64) -> f64 {
        self.log.freedom() * libm::log(from / to.max(1.0))
    }

    fn is_lag(&self, lag_s: f64) -> bool {
        lag_s.abs() > LAG_MAX * self.stage.servo_period_s
    }

    /// The estimate with faults among its unknowns.
    fn refitted(&self, estimate: &Estimate, faults: &[Fault]) -> Option<Estimate> {
        let bank = self.bank(estimate);
        let columns = faults
            .iter()
            .map(|fault| bank.column(fault.family, fault.course));
        estimate.with_faults(&self.log, &columns.collect::<Vec<_>>())
    }

    /// One fault after the other, as long as they explain more than chance, and the estimate that has them among
    /// its unknowns; `None` where it is the one without.
    fn search(&self, faultless: &Estimate) -> Option<(Vec<Fault>, Option<Estimate>)> {
        let (mut faults, mut last): (Vec<Fault>, Option<Estimate>) = (Vec::new(), None);
        while faults.len() < FAULTS_MAX {
            let estimate = last.as_ref().unwrap_or(faultless);
            let mut found = Scan::new(&self.bank(estimate), estimate)?.faults();
            found.sort_by(|a, b| b.gain.total_cmp(&a.gain));
            let before = estimate.chi_squared;
            let counts = |gain: f64| self.worth(before, before - gain) > self.log.per_fault();
            let Some(best) = found.first().filter(|best| counts(best.gain)) else {
                break;
            };
            let near = best.gain - f64::max(UNDECIDED, NOTHING * best.gain);
            let channels = found.iter().filter(|other| other.gain > near);
            let channels = channels.map(|other| other.family.channel());
            let mut alike: Vec<Channel> = channels
                .filter(|channel| *channel != best.family.channel())
                .collect();
            // Of one channel several courses may explain the log.
            alike.sort_unstable();
            alike.dedup();
            faults.push(Fault {
                alike,
                ..best.clone()
            });
            // A large fault bends what the others do, too.
            let next = self.refitted(estimate, &faults);
            let Some(next) = next.and_then(|next| self.refitted(&next, &faults)) else {
                // It can no longer be separated from the others.
                faults.pop();
                break;
            };
            last = Some(next);
        }
        Some((faults, last))
    }

    fn bank(&self, estimate: &Estimate) -> Bank<'_> {
        Bank::new(
            &self.log,
            self.stage,
            &estimate.parameters,
            estimate.lag_s(),
        )
    }

    /// The curvature that the model at hand has.
    fn bent(&self, estimate: &Estimate) -> Option<Factor> {
        estimate.without_faults(match self.fitted.model {
            ModelKind::Field => PER_PROBE,
            model => Model::from_kind(model).fitted,
        })
    }

    fn diagnosis(&self, faultless: &Estimate) -> Option<Diagnosis> {
        let declared = declared_service(self.stage, self.fitted.parameters, self.log.white_mm)?;
        let own = self.bent(faultless)?.inverse();
        let own = Predicted::new(&declared, &own, &[0.0; COUNT]);
        let is_open = own.worst_ratio() > LIMITED_MAX;
        // What the log leaves open decides before any fault does, but where the fit lives with it.
        let decides = is_open && (self.fitted.model != ModelKind::Field || self.fitted.for_service);
        let (faults, last) = match decides {
            true => (Vec::new(), None),
            false => self.search(faultless)?,
        };
        let estimate = last.as_ref().unwrap_or(faultless);
        let rest = (estimate.chi_squared / self.log.freedom()).sqrt();
        // Two stages are a fault whose onset is found, and more than all faults explain.
        let worth = |to: f64, penalty: f64| self.worth(faultless.chi_squared, to) - penalty;
        let of_faults = faults.len() as f64 * self.log.per_fault();
        let of_faults = worth(estimate.chi_squared, of_faults).max(0.0);
        let of_parts = COUNT as f64 * self.log.per_unknown();
        let other = split(
            faultless,
            faults.iter().filter_map(|fault| fault.course.onset()),
        );
        let other =
            other.filter(|other| worth(faultless.chi_squared - other.gain, of_parts) > of_faults);
        let without_repair = |finding: Finding, predicted: Predicted| Diagnosis {
            findings: vec![finding],
            predicted: Some(predicted),
            repair: None,
            rest,
        };
        let mut out = if decides && !self.fitted.is_to_rows {
            // What a log leaves open is no fault of parameters that are not fitted to it.
            Diagnosis {
                rest,
                ..Diagnosis::default()
            }
        } else if decides {
            let predicted = self.expected(faultless, &declared, 1.0)?;
            without_repair(not_determined(&predicted), predicted)
        } else if let Some(Split { from, off, .. }) = other {
            let whole = faultless.curvature.inverse();
            let predicted = Predicted::new(&declared, &whole, &off.as_slice()[..COUNT]);
            without_repair(self.other_state(from, predicted.worst_ratio()), predicted)
        } else {
            self.of_faults(&faults, estimate, &declared, rest)?
        };
        if is_open && !decides {
            let open = not_determined(&own).with_severity(Severity::Warn);
            out.findings.insert(0, open);
        }
        Some(out)
    }

    /// What the faults cost, and whether the estimate that has them among its unknowns is the better calibration.
    fn of_faults(
        &self,
        faults: &[Fault],
        estimate: &Estimate,
        declared: &Service,
        rest: f64,
    ) -> Option<Diagnosis> {
        // What no fault explains makes the parameters as much less certain.
        let certain = rest.max(1.0).powi(2);
        let predicted = self.expected(estimate, declared, certain)?;
        let (of_fit, bent) = (predicted.worst_ratio(), self.bent(estimate)?);
        let is_felt = |cost: f64| severity(cost) > Severity::Note;
        let (mut is_worth_it, mut is_clear) = (is_felt(of_fit), self.fitted.is_to_rows);
        let (mut findings, mut channels) = (Vec::new(), Vec::new());
        let mut lags_s = self.lags_s;
        for (number, (fault, size)) in faults.iter().zip(estimate.sizes()).enumerate() {
            let off = bent.solve(&(estimate.pull(number) * *size));
            let (known, off) = (DMatrix::zeros(COUNT, COUNT), &off.as_slice()[..COUNT]);
            let cost = Predicted::new(declared, &known, off).worst_ratio();
            if is_felt(cost) {
                is_worth_it = true;
                // An error of the reference or one that may be another's says nothing of the stage.
                let of_laser = fault.family.0 == Quantity::Gain && fault.family.is_of_beams();
                is_clear &= fault.alike.is_empty() && !of_laser;
                channels.push(fault.family.channel());
            }
            // A beam that was taken for late where something else is comes back.
            let again = (0..3).find(|&beam| {
                (fault.family, fault.course.onset()) == (Family::late(beam), None)
                    && self.is_lag(off_middle(self.lags_s)[beam])
            });
            if let Some(beam) = again {
                lags_s[beam] += 1e-3 * size;
            } else if cost >= 1.0 + NOTHING {
                // A robust fit may have left out of account what it would have cost.
                findings.push(self.finding(fault, *size, cost.min(of_fit)));
            }
        }
        let of = |channel: Channel| channels.iter().filter(|other| **other == channel).count();
        if let Some(&channel) = channels.iter().find(|channel| of(**channel) > COURSES_MAX) {
            is_clear = false;
            findings.push(changes_often(channel, of_fit));
        }
        if let Some((fault, late_ms)) = self.late_beam(lags_s) {
            // What bent the fit, whatever else did.
            findings.insert(0, self.finding(&fault, late_ms, of_fit));
        }
        let covariance = estimate.curvature.inverse() * certain;
        let expected = Predicted::new(declared, &covariance, &[0.0; COUNT]);
        let is_better = is_worth_it
            && is_clear
            && expected.worst_ratio() <= GOOD_MAX
            && self.fitted.model == ModelKind::Field
            && (self.is_bent || !findings.is_empty());
        let repair = Repair {
            parameters: estimate.parameters,
            covariance: covariance.view((0, 0), (COUNT, COUNT)).into_owned(),
        };
        Some(Diagnosis {
            findings,
            predicted: Some(predicted),
            repair: is_better.then_some((repair, expected)),
            rest,
        })
    }

    /// The beam that is not of the time of the two others, and by how much it is late, ms.
    fn late_beam(&self, lags_s: [f64; 3]) -> Option<(Fault, f64)> {
        let off_s = off_middle(lags_s);
        let late = (0..3).filter(|&beam| self.is_lag(off_s[beam]));
        let beam = late.max_by(|&a, &b| off_s[a].abs().total_cmp(&off_s[b].abs()))?;
        let fault = Fault {
            family: Family::late(beam),
            course: Course::On(0, self.log.means.rows.len()),
            gain: 0.0,
            alike: Vec::new(),
        };
        Some((fault, off_s[beam] * 1e3))
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
}
