//! The findings of the bank.

use super::columns::{Course, Kind};
use super::score::Fault;
use super::{Job, severity};
use crate::diagnose::slopes::title;
use crate::judge::verdict::Predicted;
use hallstage_input::finding::{Code, Finding, Severity};

impl Job<'_> {
    /// Movement and time of a mean, and its log if that begins there.
    fn place(&self, at: usize) -> (String, i64, Option<String>) {
        let (dataset, first) = (&self.dataset, &self.log.first);
        let movement = |at: usize| &dataset.movements[dataset.rows[first[at]].movement];
        let log = movement(at).log;
        let begins = at > 0 && movement(at - 1).log != log;
        let name = dataset.movement_name(movement(at));
        let log = begins.then(|| dataset.logs[log].name());
        (name, dataset.rows[first[at]].t_us, log)
    }

    pub(super) fn two_states(&self, from: usize, cost: f64) -> Finding {
        let (movement, t_us, log) = self.place(from);
        let part =
            log.unwrap_or_else(|| format!("from movement {movement}, t_us = {t_us} on the log"));
        let message = format!(
            "{part} does not fit to what is before: two stages, or everything changed there ({cost:.2} times the noise floor at \
             work). Fit the parts that agree"
        );
        let found = Finding::new(Code::LogsDisagree, message).severe(severity(cost));
        found.at(movement, t_us).costing(cost)
    }

    pub(super) fn finding(&self, fault: &Fault, size: f64, cost: f64) -> Finding {
        let (family, course) = (fault.family, fault.course);
        let (what, unit) = match family.0 {
            Kind::Gain => ("the gain", "%"),
            Kind::Offset => ("the zero", "um"),
            Kind::Lag => ("the time", "ms"),
        };
        let (movement, t_us, log) = self.place(course.onset().unwrap_or(0));
        let how = match (course, &log) {
            (Course::On(0, _), _) => {
                let how = if size > 0.0 { "later" } else { "earlier" };
                format!("is {:.2} {unit} {how} than that of the others", size.abs())
            }
            (Course::On(..), Some(log)) => {
                format!("in {log} differs by {size:+.2} {unit} from that before")
            }
            (Course::On(..), None) => {
                format!("changes by {size:+.2} {unit} in movement {movement} at t_us = {t_us}")
            }
            (Course::Ramp, _) => format!("drifts by {size:+.2} {unit} over the log"),
            (Course::RampInMovements, _) => {
                format!("drifts by {size:+.2} {unit}/s within movements")
            }
        };
        let causes = [family.channel()]
            .into_iter()
            .chain(fault.alike.iter().copied());
        let names: Vec<String> = causes.map(title).collect();
        let undecided = match names.len() {
            1 => "",
            _ => " (the log does not tell which)",
        };
        let code = match (family.0, course, &log) {
            (.., Some(_)) => Code::LogsDisagree,
            (Kind::Gain, ..) => Code::GainDrift,
            (Kind::Lag, ..) => Code::ReferenceLag,
            (Kind::Offset, Course::On(..), _) => Code::Step,
            (Kind::Offset, ..) => Code::Drift,
        };
        let message = format!(
            "{what} of {}{undecided} {how}: alone it makes errors in service of {cost:.2} times the noise floor. Remedy: {}",
            names.join(" or "),
            code.entry().remedy
        );
        let mut found = Finding::new(code, message).severe(severity(cost));
        if undecided.is_empty() {
            found = found.on(family.channel());
        }
        if course.onset().is_some() {
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
pub(super) fn without_course(channel: &str, cost: f64) -> Finding {
    let message = format!(
        "{} changes more than twice: what it does between is not known, and not taken off. Remedy: let it warm up, look for loose \
         contacts, and record the log again",
        title(channel)
    );
    let found = Finding::new(Code::ModelLacks, message).severe(severity(cost).max(Severity::Warn));
    found.on(channel).costing(cost)
}
