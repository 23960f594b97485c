//! The stage as designed: geometry, scales, and the ranges in which a fit may search.

mod columns;
mod document;
mod error;
mod file;
mod motion;
mod search;

pub use error::{Place, StageError};
pub use motion::{AXES, AxisMotion, Motion};

use crate::input::log::layout::LogLayout;
use runtime::capacitive::ProbePositions;
use runtime::frame::CodeWindow;
use runtime::geometry::ProbeCoordinates;
use std::collections::BTreeMap;

/// A closed interval, in the unit of the field that holds it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Range {
    /// Lower end.
    pub low: f64,
    /// Upper end.
    pub high: f64,
}

impl Range {
    /// The length of the interval.
    pub const fn width(&self) -> f64 {
        self.high - self.low
    }

    /// Whether `value` lies in the interval.
    pub const fn contains(&self, value: f64) -> bool {
        self.low <= value && value <= self.high
    }

    /// `value`, or the nearer end.
    pub const fn clip(&self, value: f64) -> f64 {
        value.clamp(self.low, self.high)
    }
}

/// How codes of one kind of sensor are scaled, and which of them are decoded.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CodeScale {
    /// Displacement or gap change per code, m.
    pub m_per_count: f64,
    /// Codes that are decoded: all between the converter's rails.
    pub window: CodeWindow,
}

/// Ranges in which a fit may search (Tables 3 and 5 of the paper, and the zero deviation).
#[derive(Clone, Debug, PartialEq)]
pub struct SearchRanges {
    /// H1x, H1y, H2x, H2y, H3x, H3y, m.
    pub h_m: ProbeCoordinates<Range>,
    /// Zero deviation of a movement, m.
    pub delta_m: Range,
    terms: BTreeMap<&'static str, [Range; 3]>,
}

impl SearchRanges {
    /// Ranges of the coordinates and of the zero deviation, m; those of the model's terms are
    /// [`set`](Self::set) one by one.
    pub const fn new(h_m: ProbeCoordinates<Range>, delta_m: Range) -> Self {
        Self {
            h_m,
            delta_m,
            terms: BTreeMap::new(),
        }
    }

    /// The ranges of a term of the model for the probes A, B, C, by its key in the table
    /// `[search]`: `eta`, `theta_deg` (in rad here), `a_per_m`, `b_per_rad`, `c_per_rad`.
    pub fn of(&self, key: &str) -> Option<[Range; 3]> {
        self.terms.get(key).copied()
    }

    /// Sets the ranges of a term for A, B, C, in SI units.
    pub fn set(&mut self, key: &'static str, ranges: [Range; 3]) {
        self.terms.insert(key, ranges);
    }
}

/// A stage as `stage.toml` describes it, checked.
#[derive(Clone, Debug, PartialEq)]
pub struct Stage {
    /// Designed coordinates of the Hall probes.
    pub designed: ProbeCoordinates<f64>,
    /// Scale of the Hall codes.
    pub hall: CodeScale,
    /// Where the capacitive sensors stand, m.
    pub capacitive_probes_m: ProbePositions<f64>,
    /// Scale of the capacitive codes.
    pub capacitive: CodeScale,
    /// Distance between the two Y beams of the interferometer, m.
    pub y_baseline_m: f64,
    /// Servo period, s.
    pub servo_period_s: f64,
    /// Search ranges.
    pub search: SearchRanges,
    /// How it moves.
    pub motion: Motion,
    /// Which column of a log holds what.
    pub log: LogLayout,
}

#[cfg(test)]
pub(crate) mod tests;
