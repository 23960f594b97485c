//! What follows from a finding is not told beside it: each cause has its consequences.

use super::finding::{Code, Finding, Severity};

/// The findings without the consequences of others.
pub(super) fn without(findings: Vec<Finding>) -> Vec<Finding> {
    let follows = |found: &Finding| findings.iter().any(|cause| is_consequence(found, cause));
    let kept: Vec<bool> = findings.iter().map(|found| !follows(found)).collect();
    let pairs = findings.into_iter().zip(kept);
    pairs
        .filter_map(|(found, kept)| kept.then_some(found))
        .collect()
}

/// Whether `found` only shows what `cause` names.
fn is_consequence(found: &Finding, cause: &Finding) -> bool {
    if cause.severity == Severity::Note {
        return false;
    }
    if cause.code == Code::Saturated && found.code == Code::LogsDisagree {
        // Movements that reach a flat top seem to be of another stage than those that do not.
        return found.movement.is_some();
    }
    if found.code == Code::ModelLacks && found.severity == Severity::Refuse {
        // Any other reason says more.
        return cause.severity == Severity::Refuse && cause.code != Code::ModelLacks;
    }
    if found.severity > cause.severity {
        return false;
    }
    let of_axis = matches!(found.channel.as_deref(), Some("x" | "y" | "rz"));
    let same_movement = found.movement == cause.movement;
    match cause.code {
        // Of exchanged channels and wrong scales the whole fit is wrong.
        _ if cause.severity == Severity::Refuse => {
            matches!(found.code, Code::TermsAtLimit | Code::ModelLacks)
                && found.severity < Severity::Refuse
        }
        Code::ZeroClipped => found.code == Code::TermsAtLimit,
        Code::Step | Code::Stuck | Code::Saturated => match found.code {
            Code::TermsAtLimit => true,
            Code::ZeroClipped => same_movement,
            // A wild row of the pose, not rows of a channel.
            Code::Outliers => of_axis,
            // Where a channel stops and goes on, others seem to jump.
            Code::Step => {
                cause.code == Code::Stuck && same_movement && found.channel != cause.channel
            }
            _ => false,
        },
        Code::Outliers => cause.unit == Some("rows") && found.code == Code::Outliers && of_axis,
        Code::Drift => matches!(found.code, Code::TermsAtLimit | Code::ZeroClipped),
        Code::GainDrift => found.code == Code::TermsAtLimit,
        // A lag and a line of the reference can't be told apart.
        Code::Hum => match found.code {
            Code::ReferenceLag => cause
                .channel
                .as_deref()
                .is_some_and(|c| c.starts_with("ifm")),
            Code::Outliers => of_axis,
            _ => false,
        },
        _ => false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::warning;

    fn found(code: Code, channel: &str, unit: &'static str) -> Finding {
        Finding {
            channel: Some(channel.to_owned()),
            unit: Some(unit),
            ..warning(code)
        }
    }

    #[test]
    fn a_cause_stays_and_its_consequences_go() {
        let step = found(Code::Step, "ifm_y1", "um");
        let wild = found(Code::Outliers, "rz", "urad");
        let of_channel = found(Code::Outliers, "hall_a", "rows");
        let lag = found(Code::ReferenceLag, "ifm", "us");
        let all = vec![step.clone(), wild.clone(), of_channel.clone(), lag.clone()];
        assert_eq!(without(all), [step, of_channel, lag.clone()]);
        let alone = vec![wild];
        assert_eq!(without(alone.clone()), alone);
        let hum = |channel| found(Code::Hum, channel, "Hz");
        assert_eq!(without(vec![hum("ifm_x"), lag.clone()]), [hum("ifm_x")]);
        let apart = vec![hum("hall_a"), lag];
        assert_eq!(without(apart.clone()), apart);
    }

    #[test]
    fn a_refusal_hides_warnings_and_what_the_model_lacks_but_no_other_refusal() {
        let refused = |code| Finding {
            severity: Severity::Refuse,
            ..warning(code)
        };
        let all = vec![
            refused(Code::ChannelsSwapped),
            warning(Code::TermsAtLimit),
            refused(Code::LogsDisagree),
            refused(Code::ModelLacks),
        ];
        let kept = [refused(Code::ChannelsSwapped), refused(Code::LogsDisagree)];
        assert_eq!(without(all), kept);
        let alone = vec![refused(Code::ModelLacks)];
        assert_eq!(without(alone.clone()), alone);
    }
}
