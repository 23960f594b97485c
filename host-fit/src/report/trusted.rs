//! The trusted inputs: an error in one of them does not change the residuals of a fit, so no log shows it.
//!
//! The fit turns the Hall signals into the pose of the reference. A wrong scale of the reference becomes a wrong scale of
//! the pose. Fitted parameters absorb wrong scales and places of the sensors: eta the scale of the Hall codes, the lever
//! arms the coordinates of the probes, the vertical terms the scale of the gaps, which stays wrong in Z, Rx and Ry alone.

use super::figure::{Group, bare, group};
use hallstage_input::axis::AXES;
use runtime::ParameterSet;
use serde_json::json;

/// The relative error of an input.
const PART: f64 = 0.01;

/// The inputs: name, where the user gives it, and the axes that it scales.
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

/// Each trusted input of a calibration, and the cost of an error of 1 % in it: the error of the pose by axis at the ends of
/// the calibrated range.
pub fn trusted(set: &ParameterSet) -> Vec<Group> {
    let constants = &set.constants;
    let ends = [constants.calibrated_planar, constants.calibrated_vertical].concat();
    let cost = |&axis: &usize| {
        let (value, unit) = (PART * f64::from(ends[axis]) * 1e6, AXES[axis].micro);
        group! { "axis" => AXES[axis].name, "value" => bare(value, unit), "unit" => json!(unit) }
    };
    let input = |(input, place, axes): (&str, &str, &[usize])| {
        group! { "input" => input, "place" => place, "cost" => axes.iter().map(cost).collect::<Vec<_>>() }
    };
    INPUTS.map(input).into()
}
