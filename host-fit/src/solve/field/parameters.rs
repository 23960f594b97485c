//! The values of the 81 parameters, and the decoder's constants made of them.

use super::terms::{
    CARRY, ETA, LEVER_ARM, PER_PROBE, SHAPE, SHAPES, SLOPES, TERMS, THETA, shape, shape_list,
};
use crate::input::stage::{Range, Stage};
use crate::problem::parameters::Parameters;
use runtime::geometry::{ProbeGeometry, inverse_rows};
use runtime::model::{FieldModel, FieldProbe, Model, Probes, Sensitivity, dot};
use runtime::{ParameterSet, PlanarPose, VerticalPose};
use std::f64::consts::FRAC_PI_2;

/// Where the position of a probe comes from, which its lateral displacement by Rz depends on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ProbePosition {
    /// The vertical terms: phi follows the height at the probe, a (Z + y Rx - x Ry), so that
    /// x = -c/a and y = b/a.
    FromSlopes,
    /// The designed coordinates (x, y), m: a is too small to divide by.
    Designed([f64; 2]),
}

/// A calibration by the field model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FieldParameters {
    /// The values in the order of [`TERMS`] and in its units, of A, B and C.
    pub probes: [[f64; PER_PROBE]; 3],
    /// Where the positions of A, B and C come from.
    pub positions: [ProbePosition; 3],
}

/// Room around the search range of a coordinate in which -c/a and b/a are believed, m.
const POSITION_ROOM_M: f64 = 0.25;

/// PM's row of a probe is that of A and B, which sense Y, turned by this angle, rad.
pub(super) const TURN: [f64; 3] = [0.0, 0.0, -FRAC_PI_2];

impl FieldParameters {
    /// Model (31) as a field model: E = 0, p = 0.
    pub fn of_model_31(parameters: &Parameters, stage: &Stage) -> Self {
        let (geometry, sensitivity) = (parameters.geometry(), parameters.sensitivity());
        let probe = |k: usize| {
            let s = &sensitivity[k];
            let mut values = [0.0; PER_PROBE];
            values[LEVER_ARM] = geometry.lever_arm_m[k];
            values[THETA] = geometry.misalignment_rad[k];
            values[ETA] = s.eta;
            values[SLOPES] = s.per_z_m;
            values[SLOPES + 1] = s.per_rx_rad;
            values[SLOPES + 2] = s.per_ry_rad;
            values
        };
        let probes = [probe(0), probe(1), probe(2)];
        Self {
            probes,
            positions: [0, 1, 2].map(|k| position(&probes[k], stage, k)),
        }
    }

    /// Those that a blob carries; `None` for another model.
    pub fn of_set(set: &ParameterSet, stage: &Stage) -> Option<Self> {
        let probes = values_of(set)?;
        let positions = [0, 1, 2].map(|k| position(&probes[k], stage, k));
        Some(Self { probes, positions })
    }

    /// Lever arms, misalignments and sensitivities: the part that is Model (31).
    pub fn model_31(&self) -> Parameters {
        Parameters::of_model_31(&self.geometry(), &self.probes.map(|p| sensitivity(&p)))
    }

    fn geometry(&self) -> ProbeGeometry<f64> {
        ProbeGeometry {
            lever_arm_m: self.probes.map(|p| p[LEVER_ARM]),
            misalignment_rad: self.probes.map(|p| p[THETA]),
        }
    }

    /// The lateral rows W: displacement across each probe's axis per (m, m, rad) of (X, Y, Rz).
    pub fn lateral_rows(&self) -> [[f64; 3]; 3] {
        [0, 1, 2].map(|k| {
            let p = &self.probes[k];
            let (sin, cos) = libm::sincos(p[THETA] + TURN[k]);
            let [x, y] = match self.positions[k] {
                ProbePosition::FromSlopes => {
                    [-p[SLOPES + 2] / p[SLOPES], p[SLOPES + 1] / p[SLOPES]]
                }
                ProbePosition::Designed(position) => position,
            };
            [-cos, -sin, cos * y - sin * x]
        })
    }

    /// The decoder's constants for signals in units of `m_per_unit`: m for signals in m, m per
    /// code for codes. `None` where PM is singular.
    pub fn constants(&self, m_per_unit: f64) -> Option<FieldConstants> {
        let inverse = inverse_rows(&self.geometry().plane_rows())?;
        let column = |k: usize| [inverse[0][k], inverse[1][k], inverse[2][k]];
        let lateral = self.lateral_rows();
        let probe = |k: usize| {
            let values = &self.probes[k];
            let scale = shape_scale(values[ETA], m_per_unit);
            let scaled = std::array::from_fn(|place| values[SHAPES + place] * scale[place]);
            FieldProbe {
                sensitivity: sensitivity(values),
                carry: [0, 1, 2].map(|j| values[CARRY + j] / m_per_unit),
                shape: shape(scaled),
                lateral: [0, 1, 2].map(|j| dot(&lateral[k], column(j))),
            }
        };
        Some(FieldConstants {
            probes: [probe(0), probe(1), probe(2)],
            pose_rows: inverse.map(|row| row.map(|x| x * m_per_unit)),
        })
    }
}

/// What the decoder of the field model reads, besides the codes' scales and limits.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FieldConstants {
    /// The probes A, B, C.
    pub probes: [FieldProbe<f64>; 3],
    /// Rows X, Y, Rz of PM^-1, per unit of the signal.
    pub pose_rows: [[f64; 3]; 3],
}

impl FieldConstants {
    /// The planar pose of three signals at a vertical pose, nothing taken off and nothing checked.
    pub fn decode(&self, signal: [f64; 3], vertical: &VerticalPose<f64>) -> PlanarPose<f64> {
        let zero = PlanarPose::ZERO;
        FieldModel::planar_pose(&self.probes, &self.pose_rows, signal, vertical, &zero).1
    }
}

/// The values of the parameters that a blob carries, in the order of [`TERMS`] and its units, of
/// A, B and C; `None` for another model.
pub fn values_of(set: &ParameterSet) -> Option<[[f64; PER_PROBE]; 3]> {
    let Probes::Field(probes) = set.probes.rounded::<f64>() else {
        return None;
    };
    let m_per_code = f64::from(set.hall.m_per_code);
    let of_probe = |k: usize| {
        let FieldProbe {
            sensitivity: s,
            carry,
            shape,
            ..
        } = &probes[k];
        let mut values = [0.0; PER_PROBE];
        values[LEVER_ARM] = set.geometry.lever_arm_m[k].into();
        values[THETA] = set.geometry.misalignment_rad[k].into();
        values[ETA] = s.eta;
        values[SLOPES..CARRY].copy_from_slice(&[s.per_z_m, s.per_rx_rad, s.per_ry_rad]);
        values[CARRY..SHAPES].copy_from_slice(&carry.map(|e| e * m_per_code));
        let scale = shape_scale(s.eta, m_per_code);
        for (place, scaled) in shape_list(shape).into_iter().enumerate() {
            values[SHAPES + place] = scaled / scale[place];
        }
        values
    };
    Some([of_probe(0), of_probe(1), of_probe(2)])
}

fn sensitivity(values: &[f64; PER_PROBE]) -> Sensitivity<f64> {
    Sensitivity {
        eta: values[ETA],
        per_z_m: values[SLOPES],
        per_rx_rad: values[SLOPES + 1],
        per_ry_rad: values[SLOPES + 2],
    }
}

/// The decoder's coefficients of p over those in mm: for u, w and p in units of `m_per_unit` and
/// for zr = eta z in place of z.
fn shape_scale(eta: f64, m_per_unit: f64) -> [f64; SHAPE] {
    let mm_per_unit = m_per_unit * 1e3;
    std::array::from_fn(|place| {
        let [u, w, z] = TERMS[SHAPES + place].powers.map(i32::from);
        powi(mm_per_unit, u + w) / mm_per_unit * powi(1.0 / eta, z)
    })
}

/// x^n, n >= 0, by plain products: `f64::powi` may round differently from build to build.
fn powi(x: f64, n: i32) -> f64 {
    (0..n).fold(1.0, |power, _| power * x)
}

/// The position by the vertical terms where that lies near the search range of the probe's
/// coordinates, else the designed one.
fn position(values: &[f64; PER_PROBE], stage: &Stage, probe: usize) -> ProbePosition {
    let (designed, ranges) = (&stage.designed, &stage.search.h_m);
    let negative = |range: Range| Range {
        low: -range.high,
        high: -range.low,
    };
    let ([x, y], in_x, in_y) = match probe {
        0 => ([designed.h1x_m, designed.h1y_m], ranges.h1x_m, ranges.h1y_m),
        1 => (
            [-designed.h2x_m, designed.h2y_m],
            negative(ranges.h2x_m),
            ranges.h2y_m,
        ),
        _ => ([designed.h3x_m, designed.h3y_m], ranges.h3x_m, ranges.h3y_m),
    };
    let [a, b, c] = [values[SLOPES], values[SLOPES + 1], values[SLOPES + 2]];
    let near = |value: f64, range: Range| {
        range.low - POSITION_ROOM_M <= value && value <= range.high + POSITION_ROOM_M
    };
    if near(-c / a, in_x) && near(b / a, in_y) {
        ProbePosition::FromSlopes
    } else {
        ProbePosition::Designed([x, y])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::problem::parameters;
    use crate::solve::field::probe::probes;
    use crate::solve::field::sample::{M_PER_CODE, parameters as sample, stage};
    use proptest::prelude::*;

    #[test]
    fn a_slope_too_small_to_divide_by_leaves_a_probe_at_its_designed_place() {
        let stage = stage();
        let mut model_31 = sample().model_31();
        let positions = |p: &Parameters| FieldParameters::of_model_31(p, &stage).positions;
        assert_eq!(positions(&model_31), [ProbePosition::FromSlopes; 3]);
        for slopes in [[0.0, 0.0, 0.0], [0.0, -70.0, 15.0], [-20.0, -70.0, 15.0]] {
            for (k, slope) in slopes.into_iter().enumerate() {
                model_31.values[parameters::SLOPES + 3 * k + 1] = slope;
            }
            let [from_a, from_b, _] = positions(&model_31);
            assert_eq!(from_a, ProbePosition::FromSlopes);
            assert_eq!(from_b, ProbePosition::Designed([-0.1975, 0.42]));
        }
    }

    fn nano(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
        [0, 1, 2].map(|k| (a[k] - b[k]).abs() * 1e9)
    }

    proptest! {
        /// Within what the decoder's one step leaves; and the target's words within 0.25 nm and
        /// 0.7 nrad of the same step in `f64`.
        #[test]
        fn the_decoder_undoes_the_forward_model(
            q in prop::array::uniform3(-5e-4..5e-4f64),
            v in prop::array::uniform3(-1.0..1.0f64),
        ) {
            let parameters = sample();
            let q = [q[0], q[1], 0.6 * q[2]];
            let v = [250e-6 * v[0], 500e-6 * v[1], 500e-6 * v[2]];
            let constants = parameters.constants(M_PER_CODE).expect("sound");
            let probes = probes(&parameters);
            let signal = [0, 1, 2].map(|k| {
                probes[k].signal_mm(q.map(|x| x * 1e3), v) * 1e-3 / M_PER_CODE
            });
            let exact = constants.decode(signal, &VerticalPose::from_array(v)).to_array();
            let [x, y, rz] = nano(exact, q);
            prop_assert!(x < 10.0 && y < 10.0 && rz < 15.0, "{x} {y} {rz}");

            let code = signal.map(f64::round);
            let word = |x: f64| x as f32;
            let (_, words) = FieldModel::planar_pose(
                &constants.probes.map(|probe| probe.rounded()),
                &constants.pose_rows.map(|row| row.map(word)),
                code.map(word),
                &VerticalPose::from_array(v.map(word)),
                &PlanarPose::ZERO,
            );
            let exact = constants.decode(code, &VerticalPose::from_array(v)).to_array();
            let [x, y, rz] = nano(words.to_array().map(f64::from), exact);
            prop_assert!(x < 0.25 && y < 0.25 && rz < 0.7, "{x} {y} {rz}");
        }
    }
}
