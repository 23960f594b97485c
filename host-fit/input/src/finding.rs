//! What is wrong with a log, or remarkable about it, as data: what was measured, where, and what it costs.
//!
//! Readers, the fit and the diagnosis emit [`Finding`]s. [`TABLE`] has one row for each [`Code`], [`Kind`] one
//! variant for each thing that is measured. The words are made where findings are shown, by
//! `hallstage_calibration::words`. A new finding is one row here, one arm of words and one test.

mod kind;
mod table;

pub use kind::{Cause, Correction, Kind, Quantity, TimeCourse};
pub use table::{Code, Entry, TABLE, Trust};

use crate::channel::Channel;
use serde::Serialize;

/// What a finding means for the calibration.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Severity {
    /// The calibration is as good as without it.
    Note,
    /// The calibration is good, but less so than it could be, or less certain.
    Warn,
    /// The calibration would be wrong: no blob is written.
    Refuse,
}

/// Where in the logs something begins.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Place {
    /// The movement, by [`Dataset::movement_name`](crate::dataset::Dataset::movement_name).
    pub movement: String,
    /// The time in the log, us.
    pub t_us: i64,
}

/// One finding.
#[derive(Clone, Debug, PartialEq)]
pub struct Finding {
    /// What was measured.
    pub kind: Kind,
    /// What it means for the calibration.
    pub severity: Severity,
    /// The channels at fault, or the axis of the pose; empty if none can be named.
    pub channels: Vec<Channel>,
    /// Other channels that explain the log as well, each by itself.
    pub alike: Vec<Channel>,
    /// Where it begins.
    pub place: Option<Place>,
    /// The log, where there are several and the finding concerns one of them.
    pub log: Option<String>,
    /// How many rows were looked at, out of how many, where these are a sample.
    pub sample: Option<[usize; 2]>,
    /// Errors predicted for service over the noise floor, with this fault alone.
    pub cost: Option<f64>,
    /// Whether the calibration was estimated together with this fault, and so is free of it.
    pub is_repaired: bool,
}

impl Finding {
    /// A finding of the severity that is usual for its code, without channel, place and cost.
    pub fn new(kind: Kind) -> Self {
        Self {
            severity: kind.code().entry().severity,
            kind,
            channels: Vec::new(),
            alike: Vec::new(),
            place: None,
            log: None,
            sample: None,
            cost: None,
            is_repaired: false,
        }
    }

    /// The same with another severity.
    #[must_use]
    pub fn with_severity(self, severity: Severity) -> Self {
        Self { severity, ..self }
    }

    /// The same on a channel.
    #[must_use]
    pub fn with_channel(self, channel: Channel) -> Self {
        let channels = vec![channel];
        Self { channels, ..self }
    }

    /// The same in a movement, at a time in the log, us.
    #[must_use]
    pub fn with_place(self, movement: impl Into<String>, t_us: i64) -> Self {
        let movement = movement.into();
        let place = Some(Place { movement, t_us });
        Self { place, ..self }
    }

    /// The same with a cost in service.
    #[must_use]
    pub fn with_cost(self, ratio: f64) -> Self {
        let cost = Some(ratio);
        Self { cost, ..self }
    }

    /// The code.
    pub const fn code(&self) -> Code {
        self.kind.code()
    }

    /// The channels at fault where nothing else explains the log as well, else none.
    pub fn channels(&self) -> &[Channel] {
        match self.alike.is_empty() {
            true => &self.channels,
            false => &[],
        }
    }

    /// The names of the channels at fault, as JSON has them; `None` without one.
    pub fn channel(&self) -> Option<String> {
        let names: Vec<&str> = self
            .channels()
            .iter()
            .map(|channel| channel.name())
            .collect();
        (!names.is_empty()).then(|| names.join(", "))
    }

    /// The movement where it begins.
    pub fn movement(&self) -> Option<&str> {
        self.place.as_ref().map(|place| place.movement.as_str())
    }

    /// The time in the log when it begins, us.
    pub fn t_us(&self) -> Option<i64> {
        self.place.as_ref().map(|place| place.t_us)
    }

    /// How large it is, in the unit of [`Kind::size`].
    pub fn value(&self) -> Option<f64> {
        self.kind.size().map(|(value, _)| value)
    }
}
