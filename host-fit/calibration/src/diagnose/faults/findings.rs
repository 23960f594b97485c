//! The faults as findings.

use super::Finder;
use super::effects::Shape;
use super::score::Fault;
use crate::judge::predicted::Predicted;
use crate::judge::verdict::severity;
use hallstage_input::channel::Channel;
use hallstage_input::finding::{Finding, Kind, Quantity, TimeCourse};

impl Finder<'_> {
    /// The movement and the time of a mean, and its log if the log begins there.
    fn place(&self, at: usize) -> (String, i64, Option<String>) {
        let (dataset, first) = (&self.dataset, &self.means.first);
        let movement = |at: usize| &dataset.movements[dataset.rows[first[at]].movement];
        let log = movement(at).log;
        let begins = at > 0 && movement(at - 1).log != log;
        let name = dataset.movement_name(movement(at));
        let log = begins.then(|| dataset.logs[log].name());
        (name, dataset.rows[first[at]].t_us, log)
    }

    /// From a mean on the log is of another stage, or of another state of the stage.
    pub(super) fn other_state(&self, from: usize, cost: f64) -> Finding {
        let (movement, t_us, log) = self.place(from);
        let found = Finding::new(Kind::OtherState { log }).with_severity(severity(cost));
        found.with_place(movement, t_us).with_cost(cost)
    }

    /// A change of a quantity by faults that begin together; the size of the largest, in the unit of the quantity.
    pub(super) fn change(
        &self,
        quantity: Quantity,
        faults: &[&Fault],
        size: f64,
        cost: f64,
    ) -> Finding {
        let fault = faults[0];
        let (movement, t_us, log) = self.place(fault.shape.onset().unwrap_or(0));
        let course = match (fault.shape, log) {
            (Shape::From(0, _), _) => TimeCourse::Constant,
            (Shape::From(..), Some(log)) => TimeCourse::Log(log),
            (Shape::From(..), None) => TimeCourse::Onset,
            (Shape::Ramp | Shape::Arc, _) => TimeCourse::OverLog,
            (Shape::RampInMovements, _) => TimeCourse::OverMovement,
        };
        let mut found = Finding::new(Kind::Change {
            quantity,
            course,
            size,
        });
        if fault.shape.onset().is_some() {
            found = found.with_place(movement, t_us);
        }
        let channels: Vec<Channel> = faults.iter().map(|fault| fault.suspect.channel()).collect();
        let others = faults.iter().flat_map(|fault| fault.alike.clone());
        Finding {
            alike: others.filter(|other| !channels.contains(other)).collect(),
            channels,
            ..found
        }
        .with_severity(severity(cost))
        .with_cost(cost)
    }
}

/// The log does not determine the calibration.
pub(super) fn not_determined(predicted: &Predicted) -> Finding {
    let ratios = predicted.ratio;
    Finding::new(Kind::NotDetermined { ratios }).with_cost(predicted.worst_ratio())
}
