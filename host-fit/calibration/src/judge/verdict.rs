//! The verdict: findings are ranked, and decide with the predicted errors whether a calibration can be used.

use super::predicted::Predicted;
use hallstage_input::channel::Channel;
use hallstage_input::finding::{Code, Finding, Kind, Severity, Trust};
use serde::Serialize;

/// Largest predicted errors in service over the noise floor for a note.
pub const NOTE_MAX: f64 = 1.05;
/// Largest predicted errors in service over the noise floor for the verdict good.
pub const GOOD_MAX: f64 = 1.10;
/// Largest predicted errors in service over the noise floor for the verdict limited.
pub const LIMITED_MAX: f64 = 1.30;

/// The severity of a fault that makes these errors in service, over the noise floor.
pub fn severity(ratio: f64) -> Severity {
    match ratio {
        ratio if ratio < NOTE_MAX => Severity::Note,
        ratio if ratio < LIMITED_MAX => Severity::Warn,
        _ => Severity::Refuse,
    }
}

/// Whether a calibration can be used.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Verdict {
    /// Its errors in service are the noise of the sensors.
    Good,
    /// Its errors in service are larger, or it is for movements like the log's only.
    Limited,
    /// It is not to be used.
    Refused,
}

/// The calibration that findings are about.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Basis {
    /// There is no fit to the log.
    NoFit,
    /// A fit to the log.
    Fit {
        /// Whether the model describes service, and the log alone determines it.
        is_for_service: bool,
    },
    /// A blob that was recalibrated by the log.
    Recalibrated,
    /// A blob from another log.
    Blob {
        /// Whether the model describes service.
        is_for_service: bool,
    },
}

/// Findings without the consequences of others, the most severe first, and the verdict; it is `None` for a blob
/// where the log cannot predict its errors. Sensors that stay late or disturbed add the variances `stays` to `predicted`:
/// the calibration is not at fault, so they do not refuse it.
pub fn conclude(
    mut findings: Vec<Finding>,
    predicted: Option<&Predicted>,
    stays: [f64; 3],
    basis: Basis,
) -> (Vec<Finding>, Option<Verdict>) {
    if let Basis::Blob { .. } = basis {
        // A fault of the log bends a fit, not a blob.
        for found in findings.iter_mut().filter(|found| found.cost.is_some()) {
            found.severity = found.severity.min(Severity::Warn);
        }
    }
    let is_cause = |found: &&Finding| !findings.iter().any(|cause| hides(cause, found));
    let mut ranked: Vec<Finding> = findings.iter().filter(is_cause).cloned().collect();
    ranked.sort_by_key(|found| std::cmp::Reverse(found.severity));
    let ratio = predicted.map(Predicted::worst_ratio);
    let in_service = predicted.map(|of| of.with_added(stays).worst_ratio());
    let decide =
        |findings: &[Finding], is_for_service| match decide(findings, ratio, is_for_service) {
            Verdict::Good if in_service > Some(GOOD_MAX) => Verdict::Limited,
            verdict => verdict,
        };
    let verdict = match basis {
        Basis::NoFit => Some(Verdict::Refused),
        Basis::Fit { is_for_service } => {
            if let Some(predicted) = predicted.filter(|_| is_for_service) {
                let (ratio, ratios) = (predicted.worst_ratio(), predicted.ratio);
                let are_notes = ranked.iter().all(|found| found.severity == Severity::Note);
                let cause = if ratio > GOOD_MAX && are_notes {
                    let open = Finding::new(Kind::NotDetermined { ratios });
                    Some(open.with_severity(severity(ratio)))
                } else if ratio > LIMITED_MAX && !is_refused(&ranked) {
                    Some(Finding::new(Kind::FaultsTogether { ratio }))
                } else if let Some(ratio) = in_service.filter(|of| *of > GOOD_MAX && are_notes) {
                    let together = Finding::new(Kind::FaultsTogether { ratio });
                    Some(together.with_severity(Severity::Warn))
                } else {
                    None
                };
                if let Some(cause) = cause {
                    ranked.insert(0, cause.with_cost(ratio));
                }
            }
            Some(decide(&ranked, is_for_service))
        }
        Basis::Blob { is_for_service } => ratio.map(|_| decide(&ranked, is_for_service)),
        Basis::Recalibrated => match decide(&ranked, true) {
            // A fault bends the parameters that were found.
            Verdict::Good if ranked.iter().any(|found| found.cost > Some(GOOD_MAX)) => {
                Some(Verdict::Limited)
            }
            verdict => Some(verdict),
        },
    };
    (ranked, verdict)
}

/// Whether a finding refuses the log.
pub fn is_refused(findings: &[Finding]) -> bool {
    findings
        .iter()
        .any(|found| found.severity == Severity::Refuse)
}

/// The verdict on findings and predicted errors over the noise floor.
fn decide(findings: &[Finding], ratio: Option<f64>, is_for_service: bool) -> Verdict {
    let is_doubtful = |found: &Finding| {
        let is_lost = match found.code().entry().trust {
            Trust::Kept => false,
            Trust::Lost => true,
            of_kind => {
                let mut causes = found.channels.iter().chain(&found.alike);
                let are_beams = of_kind == Trust::LostOfBeams;
                causes.any(|channel| channel.is_beam() == are_beams)
            }
        };
        is_lost && found.severity > Severity::Note
    };
    let ratio = ratio.unwrap_or(LIMITED_MAX);
    match (is_refused(findings), is_for_service) {
        (true, _) => Verdict::Refused,
        (false, true) if ratio <= GOOD_MAX && !findings.iter().any(is_doubtful) => Verdict::Good,
        (false, true) if ratio > LIMITED_MAX => Verdict::Refused,
        // The log is not at fault where another model lacks terms.
        _ => Verdict::Limited,
    }
}

/// Whether `found` is a consequence of `cause`.
fn hides(cause: &Finding, found: &Finding) -> bool {
    if cause.severity == Severity::Note {
        return false;
    }
    // Another refusal says more than that the model does not describe the log, and the whole fit to a refused log
    // is wrong.
    if cause.severity == Severity::Refuse && cause.code() != found.code() {
        match found.code() {
            Code::ModelLacks => return true,
            Code::TermsAtLimit if found.severity < Severity::Refuse => return true,
            _ => {}
        }
    }
    if !cause.code().entry().hides.contains(&found.code()) {
        return false;
    }
    let is_same_movement = cause.movement() == found.movement();
    match found.code() {
        // Movements that reach the end of a converter's range look like movements of another stage.
        Code::LogsDisagree => found.place.is_some(),
        _ if found.severity > cause.severity => false,
        // Where a channel stops and goes on, others seem to jump.
        Code::Step => is_same_movement && found.channels() != cause.channels(),
        Code::ZeroClipped => cause.place.is_none() || is_same_movement,
        // A line in the spectrum of a beam looks like a lag.
        Code::ReferenceLag => cause
            .channels()
            .iter()
            .any(|channel: &Channel| channel.is_beam()),
        _ => true,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use hallstage_input::finding::{Quantity, TimeCourse};

    fn change(quantity: Quantity, course: TimeCourse, channel: Channel) -> Finding {
        let kind = Kind::Change {
            quantity,
            course,
            size: 1.0,
        };
        Finding::new(kind).with_channel(channel)
    }

    fn ranked(findings: Vec<Finding>) -> Vec<Finding> {
        conclude(findings, None, [0.0; 3], Basis::NoFit).0
    }

    #[test]
    fn a_cause_stays_and_its_consequences_go() {
        let step = change(Quantity::Zero, TimeCourse::Onset, Channel::BeamY1);
        let clipped = Finding::new(Kind::ZerosClipped {
            movements: 1,
            of: 2,
            largest_um: 9.0,
        });
        let rows = Finding::new(Kind::OutlierRows {
            rows: 1,
            largest_um: 10.0,
        });
        let rows = rows.with_channel(Channel::HallA);
        let lag = change(Quantity::Time, TimeCourse::Constant, Channel::Beams);
        let all = vec![step.clone(), clipped.clone(), rows.clone(), lag.clone()];
        assert_eq!(ranked(all), [step, rows, lag.clone()]);
        let alone = vec![clipped];
        assert_eq!(ranked(alone.clone()), alone);
        let hum = Finding::new(Kind::Hum {
            frequency_hz: 50.0,
            amplitude_um: 1.0,
        });
        let of_beam = hum.clone().with_channel(Channel::BeamX);
        assert_eq!(ranked(vec![of_beam.clone(), lag.clone()]), [of_beam]);
        let apart = vec![hum.with_channel(Channel::HallA), lag];
        assert_eq!(ranked(apart.clone()), apart);
    }

    #[test]
    fn a_refusal_hides_warnings_and_what_the_model_lacks_but_no_other_refusal() {
        let refused = |kind| Finding::new(kind).with_severity(Severity::Refuse);
        let swapped = refused(Kind::Mistake {
            code: Code::ChannelsSwapped,
            causes: Vec::new(),
            is_sure: true,
            may_be_magnets: false,
        });
        let (other, lacks) = (
            refused(Kind::OtherState { log: None }),
            refused(Kind::NotLinear {}),
        );
        let limits = Finding::new(Kind::OtherProbes { tolerances: 9.0 });
        let all = vec![swapped.clone(), limits, other.clone(), lacks.clone()];
        assert_eq!(ranked(all), [swapped, other]);
        assert_eq!(ranked(vec![lacks.clone()]), [lacks]);
    }

    #[test]
    fn a_log_that_is_not_good_has_a_finding_that_says_why() {
        let fit = Basis::Fit {
            is_for_service: true,
        };
        let causes = |worst: f64, findings: Vec<Finding>| {
            let predicted = Predicted {
                rms: [1e-6; 3],
                ratio: [1.0, worst, 1.0],
                range: [[1e-6; 2]; 3],
            };
            let (ranked, verdict) = conclude(findings, Some(&predicted), [0.0; 3], fit);
            let first = ranked.first().map(|found| (found.code(), found.severity));
            (verdict, first)
        };
        let open = |severity| Some((Code::NotDetermined, severity));
        assert_eq!(causes(1.09, vec![]), (Some(Verdict::Good), None));
        let limited = (Some(Verdict::Limited), open(Severity::Warn));
        assert_eq!(causes(1.2, vec![]), limited);
        let refused = (Some(Verdict::Refused), open(Severity::Refuse));
        assert_eq!(causes(1.4, vec![]), refused);
        let step = change(Quantity::Zero, TimeCourse::Onset, Channel::BeamY1);
        let told = (Some(Verdict::Limited), Some((Code::Step, Severity::Warn)));
        assert_eq!(causes(1.2, vec![step]), told);
    }

    #[test]
    fn what_no_prediction_holds_keeps_a_verdict_from_good() {
        let good = Predicted {
            rms: [1e-6; 3],
            ratio: [1.0; 3],
            range: [[1e-6; 2]; 3],
        };
        let verdict = |findings, basis| conclude(findings, Some(&good), [0.0; 3], basis).1;
        let fit = Basis::Fit {
            is_for_service: true,
        };
        assert_eq!(verdict(vec![], fit), Some(Verdict::Good));
        let with = |stays: f64| conclude(vec![], Some(&good), [0.0, stays, 0.0], fit).1;
        assert_eq!(with(0.2e-12), Some(Verdict::Good));
        assert_eq!(with(9e-12), Some(Verdict::Limited));
        let late = |channel| change(Quantity::Time, TimeCourse::Constant, channel);
        assert_eq!(
            verdict(vec![late(Channel::BeamX)], fit),
            Some(Verdict::Good)
        );
        assert_eq!(
            verdict(vec![late(Channel::HallB)], fit),
            Some(Verdict::Limited)
        );
        let rough = |channel| {
            Finding::new(Kind::Noisy {
                noise_um: 1.0,
                ratio: 1.4,
            })
            .with_channel(channel)
        };
        assert_eq!(
            verdict(vec![rough(Channel::HallB)], fit),
            Some(Verdict::Good)
        );
        assert_eq!(
            verdict(vec![rough(Channel::BeamX)], fit),
            Some(Verdict::Limited)
        );
        let limits = || Finding::new(Kind::OtherProbes { tolerances: 9.0 });
        assert_eq!(verdict(vec![limits()], fit), Some(Verdict::Limited));
        let costly = || {
            late(Channel::BeamX)
                .with_severity(Severity::Refuse)
                .with_cost(2.0)
        };
        assert_eq!(verdict(vec![costly()], fit), Some(Verdict::Refused));
        assert_eq!(
            verdict(vec![costly()], Basis::Recalibrated),
            Some(Verdict::Refused)
        );
        let blob = Basis::Blob {
            is_for_service: true,
        };
        assert_eq!(verdict(vec![costly()], blob), Some(Verdict::Good));
        assert_eq!(conclude(vec![], None, [0.0; 3], blob).1, None);
    }
}
