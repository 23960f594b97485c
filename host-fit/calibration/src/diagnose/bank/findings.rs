//! The findings of the bank.

use super::columns::{Course, FAMILIES, Kind, range_of};
use super::{Fault, Job, severity};
use crate::diagnose::slopes::title;
use crate::finding::{Code, Finding, Severity};
use crate::judge::verdict::Predicted;

impl Job<'_> {
    /// Movement and time of a mean, and its log if that begins there.
    fn place(&self, at: usize) -> (String, i64, Option<String>) {
        let (dataset, first) = (self.dataset, &self.log.first);
        let movement = |at: usize| &dataset.movements[dataset.rows[first[at]].movement];
        let log = movement(at).log;
        let begins = at > 0 && movement(at - 1).log != log;
        let name = dataset.movement_name(movement(at));
        let log = begins.then(|| dataset.logs[log].name());
        (name, dataset.rows[first[at]].t_us, log)
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

    pub(super) fn finding(&self, fault: &Fault, size: f64, cost: f64) -> Finding {
        let (kind, channel) = (fault.family().0, fault.family().1);
        let course = fault.best.course;
        let (what, unit) = match kind {
            Kind::Gain => ("the gain", "%"),
            Kind::Offset => ("the zero", "um"),
            Kind::Lag => ("the time", "ms"),
        };
        let (movement, t_us, log) = self.place(range_of(&self.log, course).start);
        let how = match (course, &log) {
            (Course::Whole, _) => format!("is {size:+.2} {unit} later than that of the others"),
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
        let mut names = vec![title(channel)];
        names.extend(
            fault
                .alike
                .iter()
                .map(|other| title(FAMILIES[other.family].1)),
        );
        names.dedup();
        let undecided = match names.len() {
            1 => "",
            _ => " (the log does not tell which)",
        };
        let code = match (&log, course) {
            (Some(_), Course::From(_)) => Code::LogsDisagree,
            _ => fault.family().code(course),
        };
        let message = format!(
            "{what} of {}{undecided} {how}: {cost:.2} times the noise floor at work. Remedy: {}",
            names.join(" or "),
            code.entry().remedy
        );
        let mut found = Finding::new(code, message).severe(severity(cost));
        if undecided.is_empty() {
            found = found.on(channel);
        }
        if let Course::From(_) | Course::ToReset(_) = course {
            found = found.at(movement, t_us);
        }
        found.of(size, unit).costing(cost)
    }
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

/// That a channel has more faults than are taken off.
pub(super) fn without_course(fault: &Fault, cost: f64) -> Finding {
    let channel = fault.family().1;
    let message = format!(
        "{} changes more than twice: what it does between is not known, and not taken off. Remedy: let it warm up, look for loose \
         contacts, and record the log again",
        title(channel)
    );
    let found = Finding::new(Code::ModelLacks, message).severe(severity(cost).max(Severity::Warn));
    found.on(channel).costing(cost)
}
