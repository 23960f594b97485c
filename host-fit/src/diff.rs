//! What changed between two parameter blobs: parameters, and the pose that the same codes give.
//!
//! ```
//! use host_fit::diff::pose_difference;
//! use runtime::ParameterSet;
//!
//! let blob = std::fs::read("../runtime/examples/field.bin")?;
//! let set = ParameterSet::from_flash(&blob)?;
//! let same = serde_json::to_value(pose_difference(&set, &set))?;
//! assert_eq!((&same["poses"], &same["axes"]["rz"]["peak_urad"]), (&15_625.into(), &0.0.into()));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

use crate::report::figure::{Group, Item, bare, group, micro};
use crate::report::parameters::{motion_parameters_in, parameters_in, temperature_parameters_in};
use crate::report::table::Table;
use hallstage_input::axis::{AXES, Axis, sign};
use hallstage_solver::estimator::terms::names;
use nalgebra::{Matrix3, Vector3};
use runtime::matrix::from_rows;
use runtime::{Decode, ParameterSet, PlanarPose, RawFrame};
use serde_json::json;
use std::array::from_fn;
use std::collections::BTreeMap;

/// The grid along each axis, as a share of its range.
const LEVELS: [f64; 5] = [-1.0, -0.5, 0.0, 0.5, 1.0];
/// Steps towards the codes of a pose. Each step reduces the distance to a tenth or less.
const STEPS: u32 = 6;
/// The parameters of both blobs by name, with k and h of the temperatures and A and L of the motion, SI: values `a` and `b`, null where the model has
/// no such term; the change; and `sigma`, the change over the standard error of a difference between independent logs, null
/// unless both `errors` (SI, by name) are known.
pub fn parameter_changes(sets: [&ParameterSet; 2], errors: [&BTreeMap<String, f64>; 2]) -> Group {
    let motion = sets.map(motion_parameters_in);
    let [motion_figures, other] = &motion;
    let motion_figures = if motion_figures.is_empty() {
        other
    } else {
        motion_figures
    }
    .iter();
    let motion_figures: Vec<_> = motion_figures.map(|(name, _)| name.clone()).collect();
    let [in_a, in_b] = [0, 1].map(|k| {
        let mut all = parameters_in(sets[k]);
        all.extend(temperature_parameters_in(sets[k]));
        all.extend(motion[k].iter().cloned());
        all
    });
    let change = |name: String| {
        let [a, b] = [&in_a, &in_b].map(|all| all.get(&name));
        let unit = a.or(b).map_or("", |parameter| parameter.unit);
        let [a, b] = [a, b].map(|parameter| parameter.map(|parameter| parameter.value));
        let change = a.zip(b).map(|(a, b)| b - a);
        let errors = errors[0].get(&name).zip(errors[1].get(&name));
        let sigma = change
            .zip(errors)
            .map(|(change, (a, b))| change / a.hypot(*b));
        let si = |x: Option<f64>| x.map(|x| bare(x, unit));
        let figures = group! {
            "a" => si(a), "b" => si(b), "change" => si(change), "sigma" => sigma, "unit" => json!(unit),
        };
        (name, figures.into())
    };
    let names = names(usize::MAX).into_iter().chain(motion_figures);
    let names = names.filter(|name| in_a.contains_key(name) || in_b.contains_key(name));
    Group(names.map(change).collect())
}

/// The [`parameter_changes`] as a table.
pub fn change_table(changes: &Group) -> Table {
    let mut table = Table::new("parameters", &["a", "b", "change", "sigma"]);
    for (name, item) in &changes.0 {
        if let Item::Group(group) = item {
            table.row(name, group.flat().into_iter().map(|(_, figure)| figure));
        }
    }
    table
}

/// The difference between the poses of two blobs, second less first, by the decoder of the target. The codes cover a grid of
/// poses of the first blob, over the range of calibration that both blobs share. `refused` counts poses that either blob
/// does not decode. `None` where the geometry of the first blob cannot be inverted.
pub fn pose_difference(a: &ParameterSet, b: &ParameterSet) -> Option<Group> {
    let range_of = |set: &ParameterSet| {
        let c = &set.constants;
        [c.calibrated_planar, c.calibrated_vertical].concat()
    };
    let (of_a, of_b) = (range_of(a), range_of(b));
    let range_si: [f64; 6] = from_fn(|k| f64::from(of_a[k].min(of_b[k])));
    // By axis: sum, sum of squares, largest magnitude.
    let mut sums = [[0.0f64; 3]; 6];
    let (mut poses, mut refused) = (0u32, 0u32);
    on_grid(&[a, b], range_si, |read| {
        let Some([from, to]) = read else {
            refused += 1;
            return;
        };
        poses += 1;
        for (axis, [sum, squares, peak]) in sums.iter_mut().enumerate() {
            let difference = to[axis] - from[axis];
            *sum += difference;
            *squares += difference * difference;
            *peak = peak.max(difference.abs());
        }
    })?;
    let n = f64::from(poses.max(1));
    let difference = |(axis, [sum, squares, peak]): (&Axis, [f64; 3])| {
        let micro = |x: f64| micro(axis, x);
        let figures = group! {
            "mean" => micro(sum / n), "rms" => micro((squares / n).sqrt()), "peak" => micro(peak),
        };
        (axis.key.to_owned(), figures.into())
    };
    let range = |(axis, end): (&Axis, f64)| (axis.key.to_owned(), micro(axis, end).into());
    Some(group! {
        "poses" => poses,
        "refused" => refused,
        "range" => Group(AXES.iter().zip(range_si).map(range).collect()),
        "axes" => Group(AXES.iter().zip(sums).map(difference).collect()),
    })
}

/// Calls `take` for each pose of a grid up to these ends: with X, Y, Rz, Z, Rx, Ry as each blob decodes the codes of the first
/// blob there, or with `None` where a blob does not decode them. `None` where the geometry of the first blob cannot be inverted.
pub fn on_grid(
    sets: &[&ParameterSet],
    range_si: [f64; 6],
    mut take: impl FnMut(Option<&[[f64; 6]]>),
) -> Option<()> {
    let codes = Codes::new(sets.first()?)?;
    let decoders: Vec<_> = sets.iter().map(|set| set.decoder()).collect();
    for place in 0..LEVELS.len().pow(6) {
        let level = |axis: usize| LEVELS[place / LEVELS.len().pow(axis as u32) % LEVELS.len()];
        let frame = codes.at(from_fn(|axis| level(axis) * range_si[axis]));
        let read = decoders.iter().map(|decoder| {
            let reading = decoder.decode(&frame, &PlanarPose::ZERO);
            let ([x, y, rz], [z, rx, ry]) =
                (reading.planar()?.to_array(), reading.vertical()?.to_array());
            Some([x, y, rz, z, rx, ry].map(f64::from))
        });
        take(read.collect::<Option<Vec<_>>>().as_deref());
    }
    Some(())
}

/// The answer in one line, from what [`pose_difference`] found.
///
/// # Errors
/// The errors of the serializer.
pub fn answer(difference: &Group) -> Result<String, serde_json::Error> {
    let found = serde_json::to_value(difference)?;
    let differs = |axis: &Axis| {
        let peak = found["axes"][axis.key][format!("peak_{}", axis.micro)].as_f64()?;
        let text = format!("{peak:.2} {} in {}", sign(axis.micro), axis.name);
        (peak > 0.0).then_some(text)
    };
    let axes: Vec<String> = AXES.iter().filter_map(differs).collect();
    Ok(match axes.as_slice() {
        [] => "equal: the same codes give the same poses".to_owned(),
        axes => format!("differs by up to {} in service", axes.join(", ")),
    })
}

/// From poses to codes, by one blob.
struct Codes {
    decoder: runtime::AnyDecoder,
    /// Capacitive codes per Z, Rx, Ry.
    capacitive_per_vertical: Matrix3<f64>,
    /// Hall codes per X, Y, Rz at rest.
    hall_per_planar: Matrix3<f64>,
}

impl Codes {
    fn new(set: &ParameterSet) -> Option<Self> {
        let eta = hallstage_solver::estimator::paper::Parameters::from_set(set).eta();
        let m_per_code = f64::from(set.hall.m_per_code);
        let vertical_per_code = from_rows(&set.constants.vertical_per_code).map(f64::from);
        let eta = Matrix3::from_diagonal(&Vector3::from(eta));
        Some(Self {
            decoder: set.decoder(),
            capacitive_per_vertical: vertical_per_code.try_inverse()?,
            hall_per_planar: eta * set.plane.map(f64::from) / m_per_code,
        })
    }

    /// The frame that reads about this pose.
    fn at(&self, pose: [f64; 6]) -> RawFrame {
        let codes = |per: &Matrix3<f64>, by: [f64; 3]| {
            let codes: [f64; 3] = (per * Vector3::from(by)).into();
            codes
        };
        let rounded = |codes: [f64; 3]| codes.map(|code| code.round() as i32);
        let [x, y, rz, z, rx, ry] = pose;
        let mut hall = [0.0; 3];
        let mut frame = RawFrame::new(
            [0; 3],
            rounded(codes(&self.capacitive_per_vertical, [z, rx, ry])),
            0,
            0,
        );
        for _ in 0..STEPS {
            let reading = self.decoder.decode(&frame, &PlanarPose::ZERO);
            let Some(read) = reading.planar() else { break };
            let read = read.to_array().map(f64::from);
            let step = codes(
                &self.hall_per_planar,
                [x - read[0], y - read[1], rz - read[2]],
            );
            hall = [0, 1, 2].map(|k| hall[k] + step[k]);
            frame.hall = rounded(hall);
        }
        frame
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_answer_is_equal_or_the_largest_difference_of_each_axis_that_differs() {
        let [a, _] = sets();
        let answered = |b: &ParameterSet| {
            let difference = pose_difference(&a, b).expect("a geometry");
            answer(&difference).expect("JSON")
        };
        let mut b = a.clone();
        b.serial = "another".try_into().expect("short");
        assert!(answered(&b).starts_with("equal"));
        // X is 0.1 % longer.
        let of_x = &mut b.constants.planar_per_code[0];
        of_x.iter_mut().for_each(|x| *x *= 1.001);
        let text = answered(&b);
        assert!(
            text.starts_with("differs by up to 0.") && text.ends_with("µm in X in service"),
            "{text}"
        );
    }

    const BLOBS: [&[u8]; 2] = [
        include_bytes!("../../runtime/examples/stage.bin"),
        include_bytes!("../../runtime/examples/field.bin"),
    ];

    fn sets() -> [ParameterSet; 2] {
        BLOBS.map(|bytes| ParameterSet::from_bytes(bytes).expect("sound"))
    }

    /// The grid is reached: the Hall scale a thousandth larger moves its corners by a thousandth.
    #[test]
    fn a_larger_scale_moves_every_pose_in_proportion() {
        for a in sets() {
            let mut b = a.clone();
            for row in &mut b.constants.planar_per_code {
                row.iter_mut().for_each(|x| *x *= 1.001);
            }
            let found = serde_json::to_value(pose_difference(&a, &b)).expect("JSON");
            for Axis {
                key: name,
                micro: unit,
                ..
            } in AXES
            {
                let figure = |what: &str| {
                    let figure = &found["axes"][name][format!("{what}_{unit}")];
                    figure.as_f64().expect("a figure")
                };
                let is_planar = ["x", "y", "rz"].contains(&name);
                let range = &found["range"][format!("{name}_{unit}")];
                let moved = if is_planar {
                    1e-3 * range.as_f64().expect("a range")
                } else {
                    0.0
                };
                // Levels 0, 1/2, 1 of both signs: the root of (2 + 1/2) / 5.
                for (what, expected) in [
                    ("peak", moved),
                    ("rms", 0.5f64.sqrt() * moved),
                    ("mean", 0.0),
                ] {
                    let off = (figure(what) - expected).abs();
                    assert!(
                        off <= 0.02 * moved,
                        "{name} {what}: {} {expected}",
                        figure(what)
                    );
                }
            }
        }
    }
}
