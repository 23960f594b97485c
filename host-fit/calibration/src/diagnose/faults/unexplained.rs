//! The cost in service of the evidence beside the faults.

use super::Finder;
use super::estimate::Estimate;
use super::evidence::Evidence;
use super::motion::{AtWork, Follows, Moving};
use super::score::Fault;
use crate::judge::predicted::Predicted;
use crate::judge::verdict::{GOOD_MAX, NOTE_MAX, severity};
use hallstage_input::channel::Channel;
use hallstage_input::finding::{Finding, Kind, Quantity, Severity};
use hallstage_solver::estimator::service::Service;
use hallstage_solver::estimator::terms::COUNT;
use nalgebra::DMatrix;

/// Errors in service beyond the faults.
pub(super) struct Unexplained {
    /// Variances that they add to X, Y, Rz, m2, m2, rad2, with these parameters.
    pub(super) added: [f64; 3],
    /// The same after a repair.
    pub(super) after_repair: [f64; 3],
    /// Lags of A, B, C, s, unless they are part of these errors.
    pub(super) probe_lags_s: [f64; 3],
    /// The channel with the clearest error.
    channel: Option<Channel>,
}

impl Unexplained {
    /// For parameters with an error `off` in the service `declared`.
    pub(super) fn new(
        finder: &Finder,
        (faults, estimate): (&[Fault], &Estimate),
        declared: &Service,
        off: &[f64],
    ) -> Option<Self> {
        let (stage, parameters) = (finder.stage, finder.calibrated.parameters);
        let effects = finder.effects(estimate);
        let rows = &finder.means.rows.rows;
        let moving = Moving::new(
            rows,
            &effects.sensed,
            stage,
            &estimate.parameters,
            estimate.lag_s(),
        );
        let evidence = Evidence::new(&finder.means, estimate, &moving)?;
        let is_sensor = |channel: &usize| !(3..6).contains(channel);
        let errors = evidence.errors.iter().copied();
        let mut sensors: Vec<_> = errors.filter(|(channel, ..)| is_sensor(channel)).collect();
        // Probes and gaps that are late stay late.
        let mut probe_lags_s = evidence.probe_lags_s;
        let sizes = estimate.sizes().iter().zip(&evidence.sizes);
        let sized = faults.iter().zip(sizes.map(|(size, change)| size + change));
        for (fault, size) in sized.filter(|(fault, _)| fault.suspect.quantity == Quantity::Time) {
            let gaps = fault.suspect.gaps();
            sensors.extend(gaps.map(|gap| (gap, Follows::OwnSpeed, size)));
            if let Some(probe) = fault.suspect.late_probe() {
                probe_lags_s[probe] += 1e-3 * size;
            }
        }
        let mean_s = probe_lags_s.iter().sum::<f64>() / 3.0;
        probe_lags_s = probe_lags_s.map(|lag_s| lag_s - mean_s);
        if !sensors.is_empty() {
            // Lags of the probes add to the other errors.
            let lags_s = std::mem::take(&mut probe_lags_s).into_iter().enumerate();
            sensors.extend(lags_s.map(|(probe, s)| (probe, Follows::OwnSpeed, 1e3 * s)));
        }
        let at_work = AtWork::new(stage, parameters);
        let slow = declared.by_signals(evidence.slow_m2);
        let [spread, none] = [&evidence.added, &DMatrix::zeros(COUNT, COUNT)]
            .map(|covariance| declared.variance(covariance).systematic);
        let is_form =
            |(channel, follows, _): &(usize, Follows, f64)| is_sensor(channel) && follows.is_form();
        let only_stays = !evidence.errors.is_empty() && evidence.errors.iter().all(is_form);
        // The parameters are bent more, or sensors stay wrong.
        let added = |off: &[f64]| {
            let bent: Vec<f64> = off
                .iter()
                .zip(&evidence.shift)
                .map(|(a, b)| a - b)
                .collect();
            let stays = match sensors.is_empty() {
                true => [0.0; 3],
                false => at_work.squares((stage, declared), parameters, &bent, &sensors),
            };
            let (known, bent) = (declared.squares(off), declared.squares(&bent));
            [0, 1, 2].map(|axis| {
                let bent = match only_stays {
                    true => 0.0,
                    false => bent[axis] - (spread[axis] - none[axis]),
                };
                slow[axis] + (bent.max(stays[axis]) - known[axis]).max(0.0)
            })
        };
        Some(Self {
            added: added(off),
            after_repair: added(&[0.0; COUNT]),
            probe_lags_s,
            channel: (evidence.errors.first()).map(|(channel, ..)| Channel::SINGLE[*channel]),
        })
    }

    /// Where it is felt in service: the finding; `predicted` includes it.
    pub(super) fn finding(&self, predicted: &Predicted) -> Option<Finding> {
        let added = |axis: usize| self.added[axis] / predicted.noise(axis).powi(2);
        let ratio = |axis: usize| (1.0 + added(axis)).sqrt();
        let ratio = ratio(0).max(ratio(1)).max(ratio(2));
        let severity = match predicted.worst_ratio() <= GOOD_MAX {
            true => Severity::Note,
            false => severity(ratio).max(Severity::Warn),
        };
        let mut found = Finding::new(Kind::Inconsistent { ratio }).with_severity(severity);
        if let Some(channel) = self.channel {
            found = found.with_channel(channel);
        }
        (ratio >= NOTE_MAX).then(|| found.with_cost(ratio))
    }
}
