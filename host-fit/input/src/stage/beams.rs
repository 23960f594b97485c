//! Reads the table `[interferometer]`: places, angles and scales of the beams, and the air.
//!
//! ```toml
//! [interferometer]
//! y_baseline_m = 0.10
//! x = { y_m = 0.0, z_m = 0.01 }                          # where the X beam meets its mirror, from the tool point
//! y1 = { x_m = 0.05, z_m = 0.01, towards_x_rad = 1e-3 }  # it measures along Y, turned towards X
//! y2 = { z_m = 0.01 }                                    # its x_m: a baseline from Y1
//! scale = [1.0, 1.0, 1.0]                                # displacements over readings of X, Y1, Y2
//! air = { index = 1.0, temperature_c = 20.0, pressure_pa = 101325.0, humidity = 0.5 }
//! ```

use super::air::refractive_index;
use super::document::{Document, Value};
use super::error::StageError;
use super::interferometer::{Beam, Interferometer};
use nalgebra::Vector3;

const TABLE: &str = "interferometer";
/// The tables of the beams, and the axis along which each measures.
const BEAMS: [(&str, usize); 3] = [("x", 0), ("y1", 1), ("y2", 1)];
const AXES: [&str; 3] = ["x", "y", "z"];
/// Distances between the two Y beams that make sense, m.
const BASELINES_M: (f64, f64) = (1e-3, 10.0);
/// Places of the beams that make sense, from the tool point, m.
const PLACES_M: (f64, f64) = (-2.0, 2.0);
/// Angles of the beams that make sense, rad.
const ANGLES_RAD: (f64, f64) = (-0.1, 0.1);
/// Factors of the readings that make sense.
const SCALES: (f64, f64) = (0.1, 10.0);
/// The places of the Y beams may differ from the baseline by this part of it: the digits of a drawing.
const ROUNDING: f64 = 1e-6;
/// Least determinant of the beams by X, Y and Rz, as a part of the baseline.
const DETERMINANT_MIN: f64 = 0.1;

/// The table of a checked stage.
pub(super) fn interferometer(document: &Document<'_>) -> Result<Interferometer, StageError> {
    let baseline_m = document.required(TABLE, "y_baseline_m", BASELINES_M, "m")?;
    let scale = scale(document)?;
    if BEAMS
        .iter()
        .all(|(beam, _)| document.get(TABLE, beam).is_none())
    {
        return Ok(Interferometer::new(baseline_m, scale, None));
    }
    let [x1_m, x2_m] = y_beams_m(document, baseline_m)?;
    let starts_m = [[0.0; 3], [x1_m, 0.0, 0.0], [x2_m, 0.0, 0.0]];
    let mut beams = [Beam {
        place_m: Vector3::zeros(),
        direction: Vector3::zeros(),
    }; 3];
    for ((beam, start_m), (name, along)) in beams.iter_mut().zip(starts_m).zip(BEAMS) {
        let table = format!("{TABLE}.{name}");
        let mut place_m = Vector3::from(start_m);
        let mut direction = Vector3::ith(along, 1.0);
        for (axis, letter) in AXES.iter().enumerate().filter(|(axis, _)| *axis != along) {
            let place = document.number(&table, &format!("{letter}_m"), PLACES_M, "m")?;
            place_m[axis] = place.unwrap_or(place_m[axis]);
            let angle = format!("towards_{letter}_rad");
            let angle = document.number(&table, &angle, ANGLES_RAD, "rad")?;
            direction[axis] = libm::tan(angle.unwrap_or(0.0));
        }
        *beam = Beam {
            place_m,
            direction: direction.normalize(),
        };
    }
    let interferometer = Interferometer::new(baseline_m, scale, Some(beams));
    // On the axes it is the baseline, with this sign.
    let determinant_m = -interferometer.beams_per_pose().determinant();
    if determinant_m < DETERMINANT_MIN * baseline_m {
        let problem = "X, Y and Rz do not follow from such beams; correct their places and angles";
        return Err(document.refuse(&document.require(TABLE, "y_baseline_m")?, problem));
    }
    Ok(interferometer)
}

/// x of the Y beams, m: one of them is enough, and both agree with the baseline.
fn y_beams_m(document: &Document<'_>, baseline_m: f64) -> Result<[f64; 2], StageError> {
    let x_m = |beam| document.number(&format!("{TABLE}.{beam}"), "x_m", PLACES_M, "m");
    match (x_m("y1")?, x_m("y2")?) {
        (None, None) => Ok([0.5 * baseline_m, -0.5 * baseline_m]),
        (Some(one), None) => Ok([one, one - baseline_m]),
        (None, Some(two)) => Ok([two + baseline_m, two]),
        (Some(one), Some(two)) if (one - two - baseline_m).abs() <= ROUNDING * baseline_m => {
            Ok([one, two])
        }
        (Some(one), Some(two)) => {
            let problem = format!(
                "y1.x_m - y2.x_m is {} m and y_baseline_m is {baseline_m} m; correct one of them",
                one - two
            );
            let value = document.require(&format!("{TABLE}.y2"), "x_m")?;
            Err(document.refuse(&value, problem))
        }
    }
}

/// Displacements along the beams over their readings.
fn scale(document: &Document<'_>) -> Result<[f64; 3], StageError> {
    let mut scale = [1.0; 3];
    let list = document.get(TABLE, "scale");
    let list = list.iter().flat_map(Value::items);
    for (scale, value) in scale.iter_mut().zip(list) {
        *scale = document.within(&value, SCALES, "m per m")?;
    }
    if document.get(TABLE, "air").is_some() {
        let number =
            |key, range, unit| document.required(&format!("{TABLE}.air"), key, range, unit);
        let index = number("index", (1.0, 1.001), "of vacuum")?;
        let in_air = refractive_index(
            number("temperature_c", (0.0, 60.0), "degC")?,
            number("pressure_pa", (5e4, 1.2e5), "Pa")?,
            number("humidity", (0.0, 1.0), "of saturation")?,
        );
        scale = scale.map(|scale| scale * index / in_air);
    }
    Ok(scale)
}
