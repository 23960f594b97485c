//! The inputs that are trusted: an error in one of them leaves the residuals of a fit as they are, so no
//! log shows it.
//!
//! The fit turns the Hall signals into the pose that the reference shows. A scale of the reference that
//! is wrong becomes a scale of the pose. Scales and places on the side of the sensors are taken up
//! by fitted parameters: eta by that of the Hall codes, the lever arms by the coordinates of the
//! probes, the vertical terms by that of the gaps, which remain wrong in Z, Rx and Ry alone.

use runtime::ParameterSet;
use serde::Serialize;

/// What an error of 1 % of an input costs.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Trusted {
    /// The input.
    pub input: &'static str,
    /// Where it is said.
    pub place: &'static str,
    /// The error of the pose at the ends of the calibrated range: X, Y, Z in um, Rx, Ry, Rz in urad.
    pub cost: Vec<AxisCost>,
}

/// The error of an axis.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct AxisCost {
    /// The axis.
    pub axis: &'static str,
    /// Error of the pose.
    pub value: f64,
    /// um or urad.
    pub unit: &'static str,
}

/// An error of this part of an input.
const PART: f64 = 0.01;

/// Every trusted input of a calibration.
pub fn trusted(set: &ParameterSet) -> Vec<Trusted> {
    let [x, y, rz] = set.constants.calibrated_planar.map(f64::from);
    let [z, rx, ry] = set.constants.calibrated_vertical.map(f64::from);
    let of = |axis, end: f64, unit| AxisCost {
        axis,
        value: PART * end * 1e6,
        unit,
    };
    let (x, y, rz) = (of("X", x, "um"), of("Y", y, "um"), of("Rz", rz, "urad"));
    let (z, rx, ry) = (of("Z", z, "um"), of("Rx", rx, "urad"), of("Ry", ry, "urad"));
    let input = |input, place, cost: &[AxisCost]| Trusted {
        input,
        place,
        cost: cost.to_vec(),
    };
    vec![
        input(
            "scale of the interferometers",
            "the reference columns of the log",
            &[x, y, rz],
        ),
        input(
            "distance of the two beams along Y",
            "interferometer.y_baseline_m",
            &[rz],
        ),
        input(
            "scale of the capacitive codes",
            "capacitive.m_per_count",
            &[z, rx, ry],
        ),
        input(
            "places of the capacitive sensors",
            "capacitive.probes_m",
            &[rx, ry],
        ),
    ]
}

impl Trusted {
    /// A line: input, place, cost.
    pub fn as_text(&self) -> String {
        let cost =
            (self.cost.iter()).map(|cost| format!("{} {:.2} {}", cost.axis, cost.value, cost.unit));
        format!(
            "{} ({}): {}",
            self.input,
            self.place,
            cost.collect::<Vec<_>>().join(", ")
        )
    }
}
