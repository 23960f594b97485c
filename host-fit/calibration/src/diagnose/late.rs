//! A lag between the reference and all probes: the log does not show which of them has the wrong time.

use crate::fit::{Fit, Repair, is_clear, is_significant};
use crate::judge::predicted::Predicted;
use crate::judge::verdict::{GOOD_MAX, severity};
use hallstage_input::channel::Channel;
use hallstage_input::finding::{Code, Finding, Kind, Quantity, Severity};
use hallstage_input::stage::Stage;
use hallstage_solver::estimator::sandwich::ReferenceLag;

/// The prior of the lags leaves up to this part of the lag of one late probe to all.
const ONE_PROBE: f64 = 0.5;

/// The lag of the reference behind the middle probe, beside these findings.
pub(super) fn late_reference(
    fit: &Fit,
    repair: Option<&Repair>,
    findings: &[Finding],
    stage: &Stage,
    at_rest: Option<&Predicted>,
) -> Option<Finding> {
    let lag = fit.estimate.lag?;
    let taken_off_s = fit.later.as_ref().map_or(0.0, |_| lag.value_s);
    // One late probe is no lag of all: the middle probe counts.
    let motion = repair.map_or(fit.estimate.motion, |repair| repair.motion);
    let mut probes_s = motion.dynamics.probe_lag_s;
    probes_s.sort_by(f64::total_cmp);
    let one_s = (probes_s[2] - probes_s[1]).max(probes_s[1] - probes_s[0]);
    let errors_s = motion.probe_lag_errors_s().into_iter().fold(0.0, f64::max);
    let lag = ReferenceLag {
        value_s: repair.map_or(lag.value_s - probes_s[1], |repair| {
            taken_off_s + repair.lag_s
        }),
        standard_error_s: lag.standard_error_s.hypot(errors_s),
    };
    if lag.value_s.abs() < ONE_PROBE * one_s {
        return None;
    }
    // A late channel bends the lag of all, and a fit without a repair takes one late beam for a lag of all.
    let mut late = findings
        .iter()
        .filter(|found| found.code() == Code::ReferenceLag);
    let is_hidden = match (repair, is_clear(&lag, stage)) {
        (Some(_), true) => false,
        (None, true) => late.any(|found| found.channels.iter().all(|channel| channel.is_beam())),
        (_, false) => late.next().is_some(),
    };
    told(lag, stage, at_rest).filter(|_| !is_hidden)
}

/// What the lag adds to X, Y, Rz in service, m2, m2, rad2, where it is one of the probes.
pub(super) fn in_service(found: &Finding, stage: &Stage) -> Option<[f64; 3]> {
    match found.kind {
        Kind::LateReference {
            lag_us,
            is_declared: true,
            ..
        } => Some(by_late_probes(lag_us * 1e-6, stage)),
        _ => None,
    }
}

/// The lags of probes that findings name, s: in service they stay.
pub(super) fn probe_lags_s(findings: &[Finding]) -> [f64; 3] {
    [Channel::HallA, Channel::HallB, Channel::HallC].map(|probe| {
        let of_probe = findings
            .iter()
            .filter(|found| found.channels.contains(&probe));
        let lag_s = of_probe.map(|found| match found.kind {
            Kind::Change {
                quantity: Quantity::Time,
                size,
                ..
            } => 1e-3 * size,
            _ => 0.0,
        });
        lag_s.sum()
    })
}

/// A lag of the reference that is clear, or that costs more than a note in service if it is a lag of all probes. Where the
/// latency of the reference is declared, the rest of the lag is one of the probes.
fn told(lag: ReferenceLag, stage: &Stage, at_rest: Option<&Predicted>) -> Option<Finding> {
    let value_s = lag.value_s - stage.latency_s.unwrap_or(0.0);
    let lag = &ReferenceLag { value_s, ..lag };
    let added = by_late_probes(value_s, stage);
    let cost = at_rest.map(|at_rest| at_rest.cost_of(added));
    let is_felt = cost.is_some_and(|cost| severity(cost) > Severity::Note);
    let kind = Kind::LateReference {
        lag_us: value_s * 1e6,
        periods: value_s / stage.servo_period_s,
        is_declared: stage.latency_s.is_some(),
    };
    let found = Finding {
        cost,
        // A good calibration needs to know which.
        alike: match stage.latency_s {
            None if cost > Some(GOOD_MAX) => vec![Channel::Halls],
            _ => Vec::new(),
        },
        ..Finding::new(kind)
    };
    let (is_told, channel) = match stage.latency_s {
        None => (is_clear(lag, stage), Channel::Beams),
        Some(_) => (false, Channel::Halls),
    };
    let is_told = is_told || is_felt && is_significant(lag);
    is_told.then(|| found.with_channel(channel))
}

/// Variances of X, Y, Rz in the declared motion by probes that all have another time than the reference, m2, m2, rad2.
fn by_late_probes(late_s: f64, stage: &Stage) -> [f64; 3] {
    [0, 1, 2].map(|axis| (late_s * stage.motion.axes[axis].service_speed_rms).powi(2))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::judge::verdict::{Basis, Verdict, conclude};
    use hallstage_input::shipped::stage;

    /// Both probes and reference may have the wrong time. The declared latency of the reference decides.
    #[test]
    fn a_declared_latency_charges_the_rest_of_a_lag_to_the_probes() {
        let lag = ReferenceLag {
            value_s: 1.8e-4,
            standard_error_s: 1e-6,
        };
        let at_rest = Predicted {
            rms: [3e-7; 3],
            ratio: [1.0; 3],
            range: [[3e-7; 2]; 3],
        };
        let mut stage = stage();
        let mut found = |latency_s: Option<f64>| {
            stage.latency_s = latency_s;
            told(lag, &stage, Some(&at_rest))
        };
        let unknown = found(None).expect("a lag");
        assert_eq!(
            (unknown.channels[0], &unknown.alike[..]),
            (Channel::Beams, &[Channel::Halls][..])
        );
        let late = found(Some(0.0)).expect("a lag of the probes");
        assert_eq!(
            (late.channel().as_deref(), late.cost),
            (Some("hall"), unknown.cost)
        );
        assert_eq!(found(Some(1.79e-4)), None);
        for found in [unknown, late] {
            let (_, verdict) = conclude(
                vec![found],
                Some(&at_rest),
                [0.0; 3],
                Basis::Fit {
                    is_for_service: true,
                },
            );
            assert_eq!(verdict, Some(Verdict::Limited));
        }
    }
}
