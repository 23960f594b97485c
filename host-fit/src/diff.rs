//! What changed between two parameter blobs: parameters, and the pose that the same codes give.

use crate::report::parameters::{Parameter, parameters_in};
use nalgebra::Matrix3;
use runtime::{ParameterSet, PlanarPose, RawFrame};
use std::collections::BTreeMap;

/// Places of each axis at which poses are compared, in parts of its range.
const LEVELS: [f64; 5] = [-1.0, -0.5, 0.0, 0.5, 1.0];
/// Steps towards the codes of a pose: each leaves a tenth of the way or less.
const STEPS: u32 = 6;

/// One parameter of either blob.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ParameterChange {
    /// SI unit.
    pub unit: &'static str,
    /// Its value in the first blob; `None` where the model has no such term.
    pub a: Option<f64>,
    /// In the second.
    pub b: Option<f64>,
    /// The change over the standard error of a difference of independent logs; `None` unless both
    /// standard errors are known.
    pub sigma: Option<f64>,
}

/// The second blob's pose less the first one's, one axis.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct AxisDifference {
    /// m or rad.
    pub mean: f64,
    /// Root of the mean square, m or rad.
    pub rms: f64,
    /// Largest magnitude, m or rad.
    pub peak: f64,
}

/// What two blobs make of the same codes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PoseDifference {
    /// Largest magnitudes of X, Y, Rz, Z, Rx, Ry (m, m, rad, m, rad, rad) for which both are calibrated.
    pub range: [f64; 6],
    /// Poses of a grid over it that both decode.
    pub poses: usize,
    /// Poses of it whose codes one of them refuses.
    pub refused: usize,
    /// By axis: X, Y, Rz, Z, Rx, Ry.
    pub axes: [AxisDifference; 6],
}

/// The parameters of both blobs by name, with their standard errors (SI) where they are known.
pub fn parameter_changes(
    [a, b]: [&ParameterSet; 2],
    errors: [&BTreeMap<String, f64>; 2],
) -> BTreeMap<String, ParameterChange> {
    let mut changes = BTreeMap::new();
    let (in_a, in_b) = (parameters_in(a), parameters_in(b));
    for (name, Parameter { unit, .. }) in in_a.iter().chain(&in_b) {
        let value = |of: &BTreeMap<String, Parameter>| of.get(name).map(|p| p.value);
        let (a, b) = (value(&in_a), value(&in_b));
        let sigma = || {
            let [of_a, of_b] = [errors[0].get(name)?, errors[1].get(name)?];
            Some((b? - a?) / (of_a * of_a + of_b * of_b).sqrt())
        };
        let sigma = sigma();
        changes.insert(name.clone(), ParameterChange { unit, a, b, sigma });
    }
    changes
}

/// What both make of the codes of a grid of poses, by the decoder that runs on the target. The codes
/// are those at which the first blob reads nearly the poses of the grid. `None` where the geometry
/// of the first cannot be inverted.
pub fn pose_difference(a: &ParameterSet, b: &ParameterSet) -> Option<PoseDifference> {
    let range_of = |set: &ParameterSet| {
        let c = &set.constants;
        let words = c.calibrated_planar.iter().chain(&c.calibrated_vertical);
        words.map(|&word| f64::from(word)).collect::<Vec<_>>()
    };
    let (of_a, of_b) = (range_of(a), range_of(b));
    let range: [f64; 6] = std::array::from_fn(|k| of_a[k].min(of_b[k]));
    let codes = Codes::new(a)?;
    let (decoder_a, decoder_b) = (a.decoder(), b.decoder());
    let mut sums = [[0.0f64; 2]; 6];
    let mut peaks = [0.0f64; 6];
    let (mut poses, mut refused) = (0, 0);
    for place in 0..LEVELS.len().pow(6) {
        let level = |axis: usize| LEVELS[place / LEVELS.len().pow(axis as u32) % LEVELS.len()];
        let pose: [f64; 6] = std::array::from_fn(|axis| level(axis) * range[axis]);
        let frame = codes.at(pose);
        let read = |decoder: &runtime::AnyDecoder| {
            let reading = decoder.decode(&frame, &PlanarPose::ZERO);
            let planar = reading.planar()?.to_array().map(f64::from);
            let vertical = reading.vertical()?.to_array().map(f64::from);
            let both = planar.into_iter().chain(vertical);
            Some(both.collect::<Vec<_>>())
        };
        let (Some(from), Some(to)) = (read(&decoder_a), read(&decoder_b)) else {
            refused += 1;
            continue;
        };
        poses += 1;
        for axis in 0..6 {
            let difference = to[axis] - from[axis];
            sums[axis][0] += difference;
            sums[axis][1] += difference * difference;
            peaks[axis] = peaks[axis].max(difference.abs());
        }
    }
    let n = f64::from(u32::try_from(poses.max(1)).unwrap_or(u32::MAX));
    Some(PoseDifference {
        range,
        poses,
        refused,
        axes: std::array::from_fn(|axis| AxisDifference {
            mean: sums[axis][0] / n,
            rms: (sums[axis][1] / n).sqrt(),
            peak: peaks[axis],
        }),
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
        let of_words = |rows: &[[f32; 3]; 3]| Matrix3::from_fn(|i, k| f64::from(rows[i][k]));
        let eta = crate::problem::parameters::Parameters::of_set(set).eta();
        let m_per_code = f64::from(set.hall.m_per_code);
        let plane = of_words(&set.plane);
        Some(Self {
            decoder: set.decoder(),
            capacitive_per_vertical: of_words(&set.constants.vertical_per_code).try_inverse()?,
            hall_per_planar: Matrix3::from_fn(|i, k| plane[(i, k)] * eta[i] / m_per_code),
        })
    }

    /// The frame that reads about this pose.
    fn at(&self, pose: [f64; 6]) -> RawFrame {
        let codes = |per: &Matrix3<f64>, by: [f64; 3]| {
            let codes = per * nalgebra::Vector3::from(by);
            [0, 1, 2].map(|k| codes[k])
        };
        let rounded = |codes: [f64; 3]| codes.map(|code| code.round() as i32);
        let [x, y, rz, z, rx, ry] = pose;
        let mut hall = [0.0; 3];
        let mut frame = RawFrame {
            hall: [0; 3],
            capacitive: rounded(codes(&self.capacitive_per_vertical, [z, rx, ry])),
            sequence: 0,
            time_us: 0,
        };
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

    const BLOB: &[u8] = include_bytes!("../../runtime/examples/stage.bin");
    const FIELD: &[u8] = include_bytes!("../../runtime/examples/field.bin");

    fn set(bytes: &[u8]) -> ParameterSet {
        ParameterSet::from_bytes(bytes).expect("sound")
    }

    #[test]
    fn a_blob_does_not_differ_from_itself() {
        for bytes in [BLOB, FIELD] {
            let set = set(bytes);
            let same = pose_difference(&set, &set).expect("invertible");
            assert_eq!((same.poses, same.refused), (15_625, 0));
            assert_eq!(same.axes, [AxisDifference::default(); 6]);
            let none = BTreeMap::new();
            let changes = parameter_changes([&set, &set], [&none, &none]);
            assert!(changes.values().all(|c| c.a.is_some() && c.a == c.b));
        }
    }

    /// The grid is reached: the Hall scale a thousandth larger moves its corners by a thousandth.
    #[test]
    fn a_larger_scale_moves_every_pose_in_proportion() {
        for bytes in [BLOB, FIELD] {
            let a = set(bytes);
            let mut b = a.clone();
            for row in &mut b.constants.planar_per_code {
                row.iter_mut().for_each(|x| *x *= 1.001);
            }
            let found = pose_difference(&a, &b).expect("invertible");
            for axis in 0..3 {
                let AxisDifference { mean, rms, peak } = found.axes[axis];
                let expected = 1e-3 * found.range[axis];
                assert!(
                    (peak / expected - 1.0).abs() < 0.02,
                    "{axis}: {peak:e} {expected:e}"
                );
                // Levels 0, 1/2, 1 of both signs: the root of (2 + 1/2) / 5.
                assert!(
                    (rms / expected - 0.5f64.sqrt()).abs() < 0.02,
                    "{axis}: {rms:e}"
                );
                assert!(mean.abs() < 0.02 * expected, "{axis}: {mean:e}");
            }
            assert_eq!(found.axes[3..], [AxisDifference::default(); 3]);
        }
    }
}
