//! The findings of the bank.

use super::Job;
use super::columns::Course;
use super::score::Fault;
use crate::judge::predicted::Predicted;
use crate::judge::verdict::severity;
use hallstage_input::channel::Channel;
use hallstage_input::finding::{Finding, Kind, Severity, TimeCourse};

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

    pub(super) fn other_state(&self, from: usize, cost: f64) -> Finding {
        let (movement, t_us, log) = self.place(from);
        let found = Finding::new(Kind::OtherState { log }).with_severity(severity(cost));
        found.with_place(movement, t_us).with_cost(cost)
    }

    pub(super) fn finding(&self, fault: &Fault, size: f64, cost: f64) -> Finding {
        let (movement, t_us, log) = self.place(fault.course.onset().unwrap_or(0));
        let course = match (fault.course, log) {
            (Course::On(0, _), _) => TimeCourse::Constant,
            (Course::On(..), Some(log)) => TimeCourse::Log(log),
            (Course::On(..), None) => TimeCourse::Onset,
            (Course::Ramp, _) => TimeCourse::OverLog,
            (Course::RampInMovements, _) => TimeCourse::OverMovement,
        };
        let quantity = fault.family.0;
        let mut found = Finding::new(Kind::Change {
            quantity,
            course,
            size,
        });
        if fault.course.onset().is_some() {
            found = found.with_place(movement, t_us);
        }
        Finding {
            alike: fault.alike.clone(),
            ..found.with_channel(fault.family.channel())
        }
        .with_severity(severity(cost))
        .with_cost(cost)
    }
}

/// That the log leaves so much open.
pub(super) fn not_determined(predicted: &Predicted) -> Finding {
    let ratios = predicted.ratio;
    Finding::new(Kind::NotDetermined { ratios }).with_cost(predicted.worst_ratio())
}

/// That a channel has more faults than are repaired.
pub(super) fn changes_often(channel: Channel, cost: f64) -> Finding {
    let severity = severity(cost).max(Severity::Warn);
    let found = Finding::new(Kind::ChangesOften {}).with_severity(severity);
    found.with_channel(channel).with_cost(cost)
}
