//! The stage as designed: geometry, scales, and search ranges.

mod air;
mod beams;
mod certificate;
mod columns;
mod document;
mod error;
mod file;
mod interferometer;
mod motion;
mod search;
mod temperature;
mod uncertainty;

pub use certificate::{CertificateTable, TEXTS};
pub use error::{StageError, TextPosition};
pub use interferometer::Interferometer;
pub use motion::{AxisMotion, Motion};
pub use temperature::TemperatureTable;
pub use uncertainty::{Input, Uncertainty};

use crate::log::layout::LogLayout;
use runtime::capacitive::ProbePositions;
use runtime::frame::CodeWindow;
use runtime::geometry::ProbeGeometry;
use std::collections::BTreeMap;
use std::ops::Neg;

/// A closed interval, in the unit of the field that holds it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Range {
    /// Lower end.
    pub low: f64,
    /// Upper end.
    pub high: f64,
}

impl Range {
    /// From one end to the other.
    pub const fn new(low: f64, high: f64) -> Self {
        Self { low, high }
    }

    /// The narrowest range that holds all of these.
    pub fn around(values: impl IntoIterator<Item = f64>) -> Self {
        let none = Self::new(f64::INFINITY, f64::NEG_INFINITY);
        values.into_iter().fold(none, |range, value| {
            Self::new(range.low.min(value), range.high.max(value))
        })
    }

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

impl Neg for Range {
    type Output = Self;

    fn neg(self) -> Self {
        Self::new(-self.high, -self.low)
    }
}

/// A Hall probe as designed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Probe {
    /// Where it stands: (x, y), m.
    pub place_m: [f64; 2],
    /// Angle of its sensing axis, counterclockwise from +Y for A and B and from +X for C, rad: the
    /// designed theta, see [`runtime::geometry`].
    pub theta_rad: f64,
}

/// From (x, y) of the probes to (H1x, H1y), (H2x, H2y), (H3x, H3y) of the paper, or back: the
/// paper counts B's x to the left.
pub fn paper_signs<T: Neg<Output = T>>([a, [bx, by], c]: [[T; 2]; 3]) -> [[T; 2]; 3] {
    [a, [-bx, by], c]
}

/// Scale of the codes of one kind of sensor, and the range that is decoded.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CodeScale {
    /// Displacement or gap change per code, m.
    pub m_per_count: f64,
    /// Codes that are decoded: all between the converter's rails.
    pub window: CodeWindow,
}

/// Search ranges: Tables 3 and 5 of the paper, and the zero deviation.
#[derive(Clone, Debug, PartialEq)]
pub struct SearchRanges {
    /// x and y of the probes A, B, C, m.
    pub places_m: [[Range; 2]; 3],
    /// Zero deviation of a movement, m.
    pub delta_m: Range,
    terms: BTreeMap<&'static str, [Range; 3]>,
}

impl SearchRanges {
    /// Ranges of the places and of the zero deviation, m. [`set`](Self::set) adds the range of each term of the
    /// model.
    pub const fn new(places_m: [[Range; 2]; 3], delta_m: Range) -> Self {
        Self {
            places_m,
            delta_m,
            terms: BTreeMap::new(),
        }
    }

    /// The ranges of a term of the model for the probes A, B, C, by its key in the table
    /// `[search]`: `eta`, `theta_deg` (here in rad, from the designed theta), `a_per_m`,
    /// `b_per_rad`, `c_per_rad`.
    pub fn get(&self, key: &str) -> Option<[Range; 3]> {
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
    /// The Hall probes A, B, C as designed.
    pub probes: [Probe; 3],
    /// Scale of the Hall codes.
    pub hall: CodeScale,
    /// Where the capacitive sensors stand, m.
    pub capacitive_probes_m: ProbePositions<f64>,
    /// Scale of the capacitive codes.
    pub capacitive: CodeScale,
    /// The interferometers.
    pub interferometer: Interferometer,
    /// Error of a reset of the interferometers in X, Y, Rz, standard deviation, m, m, rad; `None` where nothing
    /// is known of it, or where the Hall probes say where the stage is reset.
    pub reset_sd: Option<[f64; 3]>,
    /// How long the rows of a log have the beams after the stage was there, s; `None` where it is not known.
    pub latency_s: Option<f64>,
    /// Servo period, s.
    pub servo_period_s: f64,
    /// Search ranges.
    pub search: SearchRanges,
    /// How it moves.
    pub motion: Motion,
    /// Temperatures in a log, and what is known of their effect.
    pub temperature: TemperatureTable,
    /// Standard uncertainties of the drawing, the reference and the sensors.
    pub uncertainty: Uncertainty,
    /// What a certificate says beside the results, and when a calibration conforms.
    pub certificate: CertificateTable,
    /// Which column of a log holds what.
    pub log: LogLayout,
}

impl Stage {
    /// Where the designed probes stand, m.
    pub fn places_m(&self) -> [[f64; 2]; 3] {
        self.probes.map(|probe| probe.place_m)
    }

    /// Lever arms and thetas of the designed probes.
    pub fn geometry(&self) -> ProbeGeometry<f64> {
        ProbeGeometry::from_places(self.places_m(), self.probes.map(|probe| probe.theta_rad))
    }
}

#[cfg(test)]
pub(crate) mod tests;
