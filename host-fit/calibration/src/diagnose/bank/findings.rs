//! The findings of the bank.

use super::columns::{Course, FAMILIES, Kind};
use super::score::{Candidate, range_of};
use super::{Job, severity};
use crate::diagnose::slopes::CHANNELS;
use crate::finding::{Code, Finding, Severity};
use crate::judge::verdict::Predicted;

impl Job<'_> {
    /// Movement and time of a mean, and its log if that begins there.
    fn place(&self, at: usize) -> (String, i64, Option<String>) {
        let row = &self.dataset.rows[self.log.means[at].first];
        let name = self
            .dataset
            .movement_name(&self.dataset.movements[row.movement]);
        let log_of = |at: usize| {
            let row = &self.dataset.rows[self.log.means[at].first];
            self.dataset.movements[row.movement].log
        };
        let begins = at > 0 && log_of(at - 1) != log_of(at);
        let log = begins.then(|| self.dataset.logs[log_of(at)].name());
        (name, row.t_us, log)
    }

    pub(super) fn two_states(&self, from: usize, cost: f64) -> Finding {
        let (movement, t_us, log) = self.place(from);
        let part = match log {
            Some(log) => format!(
                "{log} does not fit to the logs before it: two stages, or everything changed between them"
            ),
            None => format!(
                "from movement {movement}, t_us = {t_us} on the log does not fit to what is before: two stages in one log, or \
                 everything changed there"
            ),
        };
        let message =
            format!("{part} ({cost:.2} times the noise floor at work). Fit the parts that agree");
        let found = Finding::new(Code::LogsDisagree, message).severe(severity(cost));
        found.at(movement, t_us).costing(cost)
    }

    pub(super) fn finding(
        &self,
        fault: &Candidate,
        alike: &[Candidate],
        size: f64,
        cost: f64,
    ) -> Finding {
        let family = &FAMILIES[fault.family];
        let (what, unit) = match family.kind {
            Kind::Gain => ("the gain", "%"),
            Kind::Offset => ("the zero", "um"),
        };
        let (movement, t_us, log) = self.place(range_of(self.log, fault.course).start);
        let course = match (fault.course, &log) {
            (Course::From(_), Some(log)) => {
                format!("in {log} differs by {size:+.2} {unit} from that before")
            }
            (Course::From(_), None) => {
                format!("changes by {size:+.2} {unit} in movement {movement} at t_us = {t_us}")
            }
            (Course::ToReset(_), _) => {
                format!("jumps by {size:+.1} {unit} in movement {movement} at t_us = {t_us}")
            }
            (Course::Ramp, _) => format!("drifts by {size:+.2} {unit} over the log"),
            (Course::RampInMovements, _) => {
                format!("drifts by {size:+.2} {unit}/s within movements")
            }
        };
        let mut names: Vec<String> = vec![title(family.channel)];
        for other in alike {
            let other = title(FAMILIES[other.family].channel);
            if !names.contains(&other) {
                names.push(other);
            }
        }
        let undecided = match names.len() {
            1 => "",
            _ => " (the log does not tell which)",
        };
        let code = match (&log, fault.course) {
            (Some(_), Course::From(_)) => Code::LogsDisagree,
            _ => family.code(fault.course),
        };
        let message = format!(
            "{what} of {}{undecided} {course}: {cost:.2} times the noise floor at work. Remedy: {}",
            names.join(" or "),
            code.entry().remedy
        );
        let found = Finding::new(code, message)
            .severe(severity(cost))
            .of(size, unit)
            .costing(cost);
        let found = if undecided.is_empty() {
            found.on(family.channel)
        } else {
            found
        };
        match fault.course {
            Course::From(_) | Course::ToReset(_) => found.at(movement, t_us),
            Course::Ramp | Course::RampInMovements => found,
        }
    }
}

/// That a beam (X, Y1, Y2) is late, s.
pub(super) fn late_beam(beam: usize, late_s: f64, cost: f64) -> Finding {
    let channel = CHANNELS[3 + beam];
    let late_ms = late_s * 1e3;
    let message = format!(
        "{} shows the pose {late_ms:+.2} ms later than the other beams: {cost:.2} times the noise floor at work. Remedy: set its delay",
        title(channel)
    );
    let found = Finding::new(Code::ReferenceLag, message).severe(severity(cost));
    found.on(channel).of(late_ms, "ms").costing(cost)
}

/// That the log leaves so much open.
pub(super) fn not_determined(predicted: &Predicted) -> Finding {
    let [x, y, rz] = predicted.ratio;
    let message = format!(
        "the log leaves so much open that {x:.2} / {y:.2} / {rz:.2} times the noise floor are to be expected in X / Y / Rz over the \
         range of service ([motion] in stage.toml). Remedy: {}",
        Code::NotDetermined.entry().remedy
    );
    Finding::new(Code::NotDetermined, message).costing(predicted.worst_ratio())
}

/// A finding of a fault that the calibration is without.
pub(in crate::diagnose) fn repaired(found: Finding) -> Finding {
    let message = format!(
        "{}. The calibration has this taken off, and is that of the stage at the end of the log",
        found.message
    );
    let severity = found.severity.min(Severity::Warn);
    Finding {
        message,
        severity,
        ..found
    }
}

fn title(channel: &str) -> String {
    match channel.split_once('_') {
        Some(("hall", probe)) => format!("Hall {}", probe.to_uppercase()),
        Some(("cap", gap)) => format!("capacitive sensor {gap}"),
        Some((_, beam)) => format!("beam {}", beam.to_uppercase()),
        None if channel == "hall" => "all Hall probes".to_owned(),
        None if channel == "cap" => "all capacitive sensors".to_owned(),
        None => "all beams".to_owned(),
    }
}
