//! The cost of the faults in service, and the calibration without them.

use super::estimate::Estimate;
use super::motion::{Follows, squares_at_work};
use super::score::Fault;
use super::slow::slow_m2;
use super::{Added, Faults, Finder};
use crate::fit::Repair;
use crate::judge::predicted::Predicted;
use crate::judge::verdict::{GOOD_MAX, NOTE_MAX, severity};
use hallstage_input::channel::Channel;
use hallstage_input::finding::{Finding, Kind, Quantity, Severity};
use hallstage_solver::estimator::dynamics::MotionFit;
use hallstage_solver::estimator::service::Service;
use hallstage_solver::estimator::terms::COUNT;
use nalgebra::DMatrix;
use runtime::ModelKind;

/// Maximum number of repairs per channel. Steps and ramps can follow any other course, but do not describe it.
const REPAIRS_MAX: usize = 2;
/// A fault below this cost, errors in service over the noise floor, is not reported.
const COST_MIN: f64 = 1.01;

/// What stays wrong in service.
struct Stays {
    /// Errors of sensors, with their sizes.
    sensors: Vec<(usize, Follows, f64)>,
    /// Whether all errors that follow the motion are forms of sensors.
    are_forms: bool,
    /// Lags of A, B, C, s, for the motion of a fit, unless they are among these errors.
    probe_lags_s: [f64; 3],
}

impl Stays {
    fn new(faults: &[Fault], sizes: &[f64], is_fitted: bool) -> Self {
        let (mut sensors, mut are_forms, mut probe_lags_s) = (Vec::new(), true, [0.0; 3]);
        for (Fault { suspect, .. }, size) in faults.iter().zip(sizes) {
            for channel in suspect.channels() {
                match (suspect.quantity(), channel) {
                    (None, 3..6) => are_forms = false,
                    (None, _) => {
                        are_forms &= suspect.follows.is_form();
                        sensors.push((channel, suspect.follows, *size));
                    }
                    (Some(Quantity::Time), 0..3) => probe_lags_s[channel] += 1e-3 * size,
                    (Some(Quantity::Time), 6..) => sensors.push((channel, suspect.follows, *size)),
                    // The reference may be right before its gain changes, or after.
                    (Some(Quantity::Gain), 3..6) => {
                        are_forms = false;
                        sensors.push((channel, suspect.follows, -size));
                    }
                    _ => {}
                }
            }
        }
        let mean_s = probe_lags_s.iter().sum::<f64>() / 3.0;
        probe_lags_s = probe_lags_s.map(|lag_s| lag_s - mean_s);
        if !sensors.is_empty() || !is_fitted {
            // Lags of the probes add to the other errors, and a blob has no motion of a fit that counts them.
            let lags_s = std::mem::take(&mut probe_lags_s).into_iter().enumerate();
            sensors.extend(lags_s.map(|(probe, s)| (probe, Follows::OwnSpeed, 1e3 * s)));
        }
        Self {
            sensors,
            are_forms,
            probe_lags_s,
        }
    }
}

/// Whether zeros change together, as where a mount moves.
fn is_one_event(a: &Fault, b: &Fault) -> bool {
    let of_zero = |fault: &Fault| fault.suspect.follows == Follows::Zero;
    of_zero(a) && of_zero(b) && a.shape.onset().is_some() && a.shape.onset() == b.shape.onset()
}

impl Finder<'_> {
    /// The cost of the faults, and the estimate with the changes as a repair where that is the better calibration.
    pub(super) fn priced(
        &self,
        faults: &[Fault],
        (faultless, estimate): (&Estimate, &Estimate),
        declared: &Service,
    ) -> Option<Faults> {
        let by = self.calibrated;
        let residual = (estimate.chi_squared / self.means.freedom()).sqrt();
        // Residuals that no fault explains make the parameters less certain.
        let inflation = residual.max(1.0).powi(2);
        let covariance = estimate.covariance() * inflation;
        let bent = self.own_curvature(estimate)?;
        let stays = Stays::new(faults, estimate.sizes(), by.is_fitted);
        // The noise of what is estimated beside the parameters.
        let systematic = |covariance: &DMatrix<f64>| declared.variance(covariance).systematic;
        let [with, without] = [&estimate.curvature, &bent].map(|of| systematic(&of.inverse()));
        let [slow, drifts] = match by.is_for_service {
            true => slow_m2(&self.effects(estimate), estimate).map(|m2| declared.by_signals(m2)),
            false => [[0.0; 3]; 2],
        };
        // Variances by errors of the parameters, which sensors that stay wrong make larger or smaller.
        let variances = |off: &[f64]| {
            let known = declared.squares(off);
            let at_work = match stays.sensors.is_empty() {
                true => [0.0; 3],
                false => {
                    squares_at_work((self.stage, declared), by.parameters, off, &stays.sensors)
                }
            };
            [0, 1, 2].map(|axis| {
                let own = known[axis] - inflation * (with[axis] - without[axis]);
                match !stays.sensors.is_empty() && stays.are_forms {
                    true => at_work[axis],
                    false => own.max(at_work[axis]),
                }
            })
        };
        let in_service = |predicted: Predicted, off: &[f64]| match by.is_for_service {
            true => {
                let (known, whole) = (declared.squares(off), variances(off));
                predicted.with_added([0, 1, 2].map(|axis| slow[axis] + whole[axis] - known[axis]))
            }
            // Other models lack terms, and are not for service.
            false => predicted,
        };
        let (predicted, off) = self.expected(estimate, declared, inflation)?;
        let predicted = in_service(predicted, &off);
        let own_cost = predicted.worst_ratio();
        let is_felt = |cost: f64| severity(cost) > Severity::Note;
        let (mut is_worth_it, mut is_clear) = (is_felt(own_cost), by.is_fitted);
        let (mut findings, mut channels) = (Vec::new(), Vec::new());
        let sizes = estimate.sizes();
        let follows = |number: &usize| faults[*number].suspect.quantity().is_none();
        let (by_motion, changes): (Vec<usize>, Vec<usize>) = (0..faults.len()).partition(follows);
        let off_by =
            |numbers: &[usize]| estimate.off_by(&bent, numbers.iter().map(|&k| (k, sizes[k])));
        let mut events: Vec<Vec<usize>> = Vec::new();
        for &number in &changes {
            let is_same =
                |event: &&mut Vec<usize>| is_one_event(&faults[event[0]], &faults[number]);
            match events.iter_mut().find(is_same) {
                Some(event) => event.push(number),
                None => events.push(vec![number]),
            }
        }
        for event in events {
            let faults: Vec<&Fault> = event.iter().map(|&number| &faults[number]).collect();
            let largest = event.iter().map(|&number| sizes[number]);
            let size = largest.fold(0.0, |a: f64, b| if b.abs() > a.abs() { b } else { a });
            let fault = faults[0];
            let Some(quantity) = fault.suspect.quantity() else {
                continue;
            };
            let known = DMatrix::zeros(COUNT, COUNT);
            let cost = Predicted::new(declared, &known, &off_by(&event)).worst_ratio();
            if is_felt(cost) {
                is_worth_it = true;
                // What may be a change of the reference does not show the stage as it ends.
                let is_laser = quantity == Quantity::Gain && fault.suspect.is_beam();
                let mut others = faults.iter().flat_map(|fault| &fault.alike);
                is_clear &= !is_laser && !others.any(|other| other.is_beam());
                channels.extend(faults.iter().map(|fault| fault.suspect.channel()));
            }
            if cost >= COST_MIN {
                // A robust fit may have rejected the rows that would have cost more.
                findings.push(self.change(quantity, &faults, size, cost.min(own_cost)));
            }
        }
        let count = |of: Channel| channels.iter().filter(|other| **other == of).count();
        is_clear &= channels.iter().all(|of| count(*of) <= REPAIRS_MAX);
        // An error that follows the motion is never taken off.
        let refitted = (!by_motion.is_empty() && !changes.is_empty()).then(|| {
            let changes: Vec<Fault> = changes.iter().map(|&k| faults[k].clone()).collect();
            self.refitted(faultless, &changes)
        });
        is_clear &= !matches!(refitted, Some(None));
        let repaired = match &refitted {
            Some(Some(refitted)) => refitted,
            _ if changes.is_empty() => faultless,
            _ => estimate,
        };
        let left = (repaired.values() - estimate.values()).as_slice()[..COUNT].to_vec();
        let expected = in_service(Predicted::new(declared, &covariance, &left), &left);
        let is_better = is_worth_it
            && is_clear
            && expected.worst_ratio() <= GOOD_MAX
            && by.model == ModelKind::Field
            && (self.is_bent || !findings.is_empty());
        let values = repaired.values();
        let motion = MotionFit::new(values.as_slice(), &covariance, by.shows_acceleration);
        let mut probes_s = motion.dynamics.probe_lag_s;
        probes_s.sort_by(f64::total_cmp);
        let repair = Repair {
            parameters: repaired.parameters,
            covariance: covariance.view((0, 0), (COUNT, COUNT)).into_owned(),
            // One late probe is no lag of all.
            lag_s: repaired.lag_s() - probes_s[1],
            motion: motion.with_other_lags(stays.probe_lags_s),
        };
        let judged = if is_better { expected } else { predicted };
        let judged = judged.with_added(drifts);
        let unexplained = variances(&off_by(&by_motion));
        let unexplained = [0, 1, 2].map(|axis| slow[axis] + unexplained[axis]);
        // A cause explains most of the misfit.
        let most = 0.5 * (faultless.chi_squared / self.means.freedom() - 1.0).max(0.0);
        let first = by_motion.first().filter(|_| inflation - 1.0 <= most);
        let first = first.map(|&number| &faults[number]);
        if by.is_for_service {
            findings.extend(unexplained_finding([unexplained, drifts], first, &judged));
        }
        Some(Faults {
            findings,
            predicted: Some(predicted),
            added: Added {
                probe_lags_s: (!faults.is_empty()).then_some(stays.probe_lags_s),
                drifts,
                ..Added::default()
            },
            repair: is_better.then_some((repair, expected)),
            residual,
        })
    }
}

/// Errors that no change explains, where they are felt in service, and drifts, which refuse no calibration; `predicted`
/// includes them. The fault is the clearest.
fn unexplained_finding(
    [variances, drifts]: [[f64; 3]; 2],
    fault: Option<&Fault>,
    predicted: &Predicted,
) -> Option<Finding> {
    // Other errors of the parameters cancel a part of them.
    let cost = |variances| predicted.cost_of(variances).min(predicted.worst_ratio());
    let ratio = cost([0, 1, 2].map(|axis| variances[axis] + drifts[axis]));
    let severity = match predicted.worst_ratio() <= GOOD_MAX {
        true => Severity::Note,
        false => severity(cost(variances)).max(Severity::Warn),
    };
    let found = Finding::new(Kind::Inconsistent { ratio }).with_severity(severity);
    let channel = |fault: &Fault| fault.suspect.channel();
    let found = Finding {
        channels: fault.map(channel).into_iter().collect(),
        alike: fault.map_or_else(Vec::new, |fault| fault.alike.clone()),
        ..found.with_cost(ratio)
    };
    (ratio >= NOTE_MAX).then_some(found)
}
