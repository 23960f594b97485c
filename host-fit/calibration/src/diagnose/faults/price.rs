//! The cost of the faults in service, and the calibration without them.

use super::effects::{Shape, Suspect};
use super::estimate::Estimate;
use super::score::Fault;
use super::unexplained::Unexplained;
use super::{Faults, Finder};
use crate::fit::Repair;
use crate::judge::predicted::Predicted;
use crate::judge::verdict::{GOOD_MAX, severity};
use hallstage_input::channel::Channel;
use hallstage_input::finding::{Quantity, Severity};
use hallstage_solver::estimator::dynamics::MotionFit;
use hallstage_solver::estimator::service::Service;
use hallstage_solver::estimator::terms::COUNT;
use nalgebra::DMatrix;
use runtime::ModelKind;

/// Maximum number of repairs per channel. Steps and ramps can follow any other course, but do not describe it.
const REPAIRS_MAX: usize = 2;
/// A fault below this cost, errors in service over the noise floor, is not reported.
const COST_MIN: f64 = 1.01;

/// The distance of each value from the middle one.
fn off_middle(values: [f64; 3]) -> [f64; 3] {
    let mut sorted = values;
    sorted.sort_by(f64::total_cmp);
    values.map(|x| x - sorted[1])
}

impl Finder<'_> {
    /// The cost of the faults, and the estimate with the faults as a repair where that is the better calibration.
    pub(super) fn priced(
        &self,
        faults: &[Fault],
        estimate: &Estimate,
        declared: &Service,
        residual: f64,
    ) -> Option<Faults> {
        // Residuals that no fault explains make the parameters less certain.
        let inflation = residual.max(1.0).powi(2);
        let (predicted, off) = self.expected(estimate, declared, inflation)?;
        let (own_cost, bent) = (predicted.worst_ratio(), self.own_curvature(estimate)?);
        let is_felt = |cost: f64| severity(cost) > Severity::Note;
        let (mut is_worth_it, mut is_clear) = (is_felt(own_cost), self.calibrated.is_fitted);
        let (mut findings, mut channels) = (Vec::new(), Vec::new());
        let (mut lags_s, mut probe_lags_s) = (self.lags_s, [0.0; 3]);
        for (number, (fault, size)) in faults.iter().zip(estimate.sizes()).enumerate() {
            let off = bent.solve(&(estimate.gradient(number) * *size));
            let (known, off) = (DMatrix::zeros(COUNT, COUNT), &off.as_slice()[..COUNT]);
            let cost = Predicted::new(declared, &known, off).worst_ratio();
            if is_felt(cost) {
                is_worth_it = true;
                // A gain of the reference, or a fault that may be another channel's, does not show the stage.
                let suspect = fault.suspect;
                let is_laser = suspect.quantity == Quantity::Gain && suspect.is_beam();
                is_clear &= fault.alike.is_empty() && !is_laser;
                channels.push(suspect.channel());
            }
            if let Some(probe) = fault.suspect.late_probe() {
                probe_lags_s[probe] += 1e-3 * size;
            }
            // The lag of a beam that was taken off because of another fault comes back.
            let back = (0..3).find(|&beam| {
                (fault.suspect, fault.shape.onset()) == (Suspect::late(beam), None)
                    && self.is_lag(off_middle(self.lags_s)[beam])
            });
            if let Some(beam) = back {
                lags_s[beam] += 1e-3 * size;
            } else if cost >= COST_MIN {
                // A robust fit may have rejected the rows that would have cost more.
                findings.push(self.finding(fault, *size, cost.min(own_cost)));
            }
        }
        let count = |of: Channel| channels.iter().filter(|other| **other == of).count();
        is_clear &= channels.iter().all(|of| count(*of) <= REPAIRS_MAX);
        if let Some((fault, late_ms)) = self.late_beam(lags_s) {
            // The lag is part of all that bent the fit.
            findings.insert(0, self.finding(&fault, late_ms, own_cost));
        }
        let covariance = estimate.covariance() * inflation;
        let expected = Predicted::new(declared, &covariance, &[0.0; COUNT]);
        // Other models lack terms, and are not for service.
        let unexplained = match self.calibrated.is_for_service {
            true => Some(Unexplained::new(self, (faults, estimate), declared, &off)?),
            false => None,
        };
        if let Some(more) = &unexplained {
            probe_lags_s = more.probe_lags_s;
        }
        let [predicted, expected] = match &unexplained {
            Some(more) => [
                predicted.with_added(more.added),
                expected.with_added(more.after_repair),
            ],
            None => [predicted, expected],
        };
        let is_better = is_worth_it
            && is_clear
            && expected.worst_ratio() <= GOOD_MAX
            && self.calibrated.model == ModelKind::Field
            && (self.is_bent || !findings.is_empty());
        let shows = self.calibrated.shows_acceleration;
        let motion = MotionFit::new(estimate.values().as_slice(), &covariance, shows);
        let middle = |values: [f64; 3]| values[0] - off_middle(values)[0];
        let lag_s = middle(self.lags_s) + estimate.lag_s();
        let repair = Repair {
            parameters: estimate.parameters,
            covariance: covariance.view((0, 0), (COUNT, COUNT)).into_owned(),
            // One late probe is no lag of all.
            lag_s: lag_s - middle(motion.dynamics.probe_lag_s),
            motion: motion.with_other_lags(probe_lags_s),
        };
        let judged = if is_better { &expected } else { &predicted };
        findings.extend(unexplained.as_ref().and_then(|more| more.finding(judged)));
        Some(Faults {
            findings,
            predicted: Some(predicted),
            probe_lags_s: unexplained.is_some().then_some(probe_lags_s),
            repair: is_better.then_some((repair, expected)),
            residual,
        })
    }

    /// The beam that is late or early against the two others, and its lag, ms.
    fn late_beam(&self, lags_s: [f64; 3]) -> Option<(Fault, f64)> {
        let off_s = off_middle(lags_s);
        let late = (0..3).filter(|&beam| self.is_lag(off_s[beam]));
        let beam = late.max_by(|&a, &b| off_s[a].abs().total_cmp(&off_s[b].abs()))?;
        let fault = Fault {
            suspect: Suspect::late(beam),
            shape: Shape::From(0, self.means.rows.rows.len()),
            gain: 0.0,
            alike: Vec::new(),
        };
        Some((fault, off_s[beam] * 1e3))
    }
}
