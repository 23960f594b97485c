//! The trusted inputs: an error in one of them does not change the residuals of a fit, so no log shows it.
//!
//! The fit turns the Hall signals into the pose of the reference. A wrong scale or place of the reference becomes a wrong
//! pose. Fitted parameters absorb wrong scales and places of the sensors: eta the scale of the Hall codes, the lever
//! arms the coordinates of the probes, the vertical terms the scale of the gaps, which stays wrong in Z, Rx and Ry alone.

use super::figure::{Group, bare, group};
use hallstage_input::axis::AXES;
use hallstage_input::stage::Stage;
use runtime::ParameterSet;
use serde_json::json;

/// The error of a scale.
const PART: f64 = 0.01;
/// The error of a place, m, and of an angle, rad.
const MILLI: f64 = 1e-3;

/// Where an error of an input is seen: an axis, and a factor of the motion along another axis, as numbers in [`AXES`].
type Seen = (usize, f64, usize);

/// Each trusted input of a calibration, and the cost of an error in it: the error of the pose by axis at the ends of the
/// calibrated range.
pub fn trusted(set: &ParameterSet, stage: &Stage) -> Vec<Group> {
    let constants = &set.constants;
    let ends = [constants.calibrated_planar, constants.calibrated_vertical].concat();
    let cost = |(axis, factor, by): Seen| {
        let (value, unit) = (factor * f64::from(ends[by]) * 1e6, AXES[axis].micro);
        group! { "axis" => AXES[axis].name, "value" => bare(value, unit), "unit" => json!(unit) }
    };
    let input = |input: &str, place: &str, error: &str, seen: Vec<Seen>| {
        let cost: Vec<Group> = seen.into_iter().map(cost).collect();
        group! { "input" => input, "place" => place, "error" => error, "cost" => cost }
    };
    let scale = |name, place, axes: &[usize]| {
        let seen = axes.iter().map(|&axis| (axis, PART, axis));
        input(name, place, "1 %", seen.collect())
    };
    let [x, y, rz, z, rx, ry] = [0, 1, 2, 3, 4, 5];
    let turned = MILLI / stage.interferometer.y_baseline_m;
    vec![
        scale(
            "scale of the interferometers",
            "the reference columns of the log, interferometer.scale",
            &[x, y, rz],
        ),
        scale(
            "distance of the two beams along Y",
            "interferometer.y_baseline_m",
            &[rz],
        ),
        scale(
            "scale of the capacitive codes",
            "capacitive.m_per_count",
            &[z, rx, ry],
        ),
        scale(
            "places of the capacitive sensors",
            "capacitive.probes_m",
            &[rx, ry],
        ),
        input(
            "height of the X beam",
            "interferometer.x.z_m",
            "1 mm",
            vec![(x, MILLI, ry)],
        ),
        input(
            "place of the X beam",
            "interferometer.x.y_m",
            "1 mm",
            vec![(x, MILLI, rz)],
        ),
        input(
            "direction of the X beam",
            "interferometer.x.towards_y_rad",
            "1 mrad",
            vec![(x, MILLI, y)],
        ),
        input(
            "height of one Y beam",
            "interferometer.y1.z_m",
            "1 mm",
            vec![(y, MILLI / 2.0, rx), (rz, turned, rx)],
        ),
        input(
            "place of both Y beams",
            "interferometer.y1.x_m",
            "1 mm",
            vec![(y, MILLI, rz)],
        ),
        input(
            "direction of one Y beam",
            "interferometer.y1.towards_x_rad",
            "1 mrad",
            vec![(y, MILLI / 2.0, x), (rz, turned, x)],
        ),
    ]
}

/// What the pose of a calibration is the pose of, and where the beams are taken to be.
pub fn reference(stage: &Stage) -> String {
    let beams = match stage.interferometer.has_places() {
        false => "beams on the axes".to_owned(),
        true => {
            let [x, y1, y2] = stage
                .interferometer
                .places_m()
                .map(|at| at.map(|m| m * 1e3));
            format!(
                "X beam at y {:.1}, z {:.1} mm, Y beams at x {:.1} and {:.1}, z {:.1} and {:.1} mm",
                x[1], x[2], y1[0], y2[0], y1[2], y2[2]
            )
        }
    };
    format!("pose of the tool point, the origin of stage.toml; interferometers X, Y1, Y2, {beams}")
}
