//! The stage as designed: geometry, scales, and the ranges in which a fit may search.

mod columns;
mod error;
mod file;
mod ranges;
mod value;

pub use error::{Place, StageError, ValueFault};

use crate::input::log::layout::LogLayout;
use runtime::capacitive::ProbePositions;
use runtime::frame::CodeWindow;
use runtime::geometry::ProbeCoordinates;

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
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SearchRanges {
    /// H1x, H1y, H2x, H2y, H3x, H3y, m.
    pub h_m: ProbeCoordinates<Range>,
    /// eta of A, B, C.
    pub eta: [Range; 3],
    /// theta, the same for all probes, rad.
    pub theta_rad: Range,
    /// a of A, B, C, 1/m.
    pub a_per_m: [Range; 3],
    /// b of A, B, C, 1/rad.
    pub b_per_rad: [Range; 3],
    /// c of A, B, C, 1/rad.
    pub c_per_rad: [Range; 3],
    /// Zero deviation of a movement, m.
    pub delta_m: Range,
}

impl SearchRanges {
    /// The ranges of a term for A, B, C, by its key in `stage.toml`.
    pub fn of(&self, key: &str) -> Option<[Range; 3]> {
        Some(match key {
            "eta" => self.eta,
            "theta_deg" => [self.theta_rad; 3],
            "a_per_m" => self.a_per_m,
            "b_per_rad" => self.b_per_rad,
            "c_per_rad" => self.c_per_rad,
            _ => return None,
        })
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
    /// Which column of a log holds what.
    pub log: LogLayout,
}

#[cfg(test)]
pub(crate) mod tests;
