//! The inputs that are trusted: an error in one of them leaves the residuals of a fit as they are, so no
//! log shows it.
//!
//! The fit turns the Hall signals into the pose that the reference shows. A scale of the reference that
//! is wrong becomes a scale of the pose. Scales and places on the side of the sensors are taken up
//! by fitted parameters: eta by that of the Hall codes, the lever arms by the coordinates of the
//! probes, the vertical terms by that of the gaps, which remain wrong in Z, Rx and Ry alone.

use runtime::ParameterSet;
use serde_json::{Value, json};

/// An error of this part of an input.
const PART: f64 = 0.01;

/// The axes, and of each input where it is said and what it scales.
const AXES: [&str; 6] = ["X", "Y", "Rz", "Z", "Rx", "Ry"];
const INPUTS: [(&str, &str, &[usize]); 4] = [
    (
        "scale of the interferometers",
        "the reference columns of the log",
        &[0, 1, 2],
    ),
    (
        "distance of the two beams along Y",
        "interferometer.y_baseline_m",
        &[2],
    ),
    (
        "scale of the capacitive codes",
        "capacitive.m_per_count",
        &[3, 4, 5],
    ),
    (
        "places of the capacitive sensors",
        "capacitive.probes_m",
        &[4, 5],
    ),
];

/// Every trusted input of a calibration, and what an error of 1 % of it costs: the error of the pose by axis
/// at the ends of the calibrated range, in um or urad.
pub fn trusted(set: &ParameterSet) -> Value {
    let constants = &set.constants;
    let ends = [constants.calibrated_planar, constants.calibrated_vertical].concat();
    let cost = |&axis: &usize| {
        let unit = if AXES[axis].starts_with('R') {
            "urad"
        } else {
            "um"
        };
        let value = PART * f64::from(ends[axis]) * 1e6;
        json!({ "axis": AXES[axis], "value": value, "unit": unit })
    };
    let of_input = |(input, place, axes): (_, _, &[usize])| {
        let cost: Vec<Value> = axes.iter().map(cost).collect();
        json!({ "input": input, "place": place, "cost": cost })
    };
    INPUTS.map(of_input).into_iter().collect()
}
