//! The values of the 81 parameters, and the decoder's constants made of them.

use super::dynamics::lag_prior;
use super::temperature::Coefficient;
use super::terms::{
    CARRY, COUNT, ETA, LEVER_ARM, PER_PROBE, SHAPE, SHAPE_UNIT_M, SHAPES, SLOPES, TERMS, THETA,
    shape, shape_list,
};
use super::whiten::{ACCELERATIONS, PROBE_LAGS, UNKNOWNS};
use crate::estimator::gauss_newton::Unknowns;
use crate::estimator::paper::Parameters;
use hallstage_input::stage::{Input, Stage};
use nalgebra::{DMatrix, DVector, Matrix3};
use runtime::geometry::{ProbeGeometry, SensingAxes};
use runtime::matrix::{from_rows, inverse, to_rows};
use runtime::model::{FieldModel, FieldProbe, Model, Probes, Sensitivity};
use runtime::{ParameterSet, PlanarPose, VerticalPose};

/// A calibration by the field model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FieldParameters {
    /// The values in the order of [`TERMS`] and in its units, of A, B and C.
    pub probes: [[f64; PER_PROBE]; 3],
    /// k and h of A, B, C beyond what the rows were compensated with, 1/K: see
    /// [`Dataset::compensate`](hallstage_input::dataset::Dataset::compensate).
    pub gain_per_k: [[f64; 2]; 3],
    /// Designed places (x, y) of A, B and C, m.
    pub places: [[f64; 2]; 3],
}

/// Change of a probe's sensitivity with height, as a part of it, 1/m: 215 to 237 in the given logs.
pub const FALL_PER_M: f64 = -226.0;
/// A probe with a smaller change of sensitivity, 1/m, is taken to stand at its designed place.
const SLOPE_MIN: f64 = 5.0;

impl FieldParameters {
    /// Model (31) as a field model: E = 0, p = 0.
    pub fn from_model_31(parameters: &Parameters, stage: &Stage) -> Self {
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
        Self {
            probes: [probe(0), probe(1), probe(2)],
            gain_per_k: [[0.0; 2]; 3],
            places: stage.places_m(),
        }
    }

    /// The stage before its calibration: probes at their designed places over the centre lines of the
    /// magnets, with sensitivities in the middle of the search range.
    pub fn designed(stage: &Stage) -> Self {
        let mut designed = Self::from_model_31(&Parameters::designed(stage), stage);
        let etas = stage.search.get("eta");
        let eta = etas.map_or([1.0; 3], |ranges| ranges.map(|r| 0.5 * (r.low + r.high)));
        for ((probe, eta), [x, y]) in designed.probes.iter_mut().zip(eta).zip(designed.places) {
            // phi follows the height at the probe: Z + y Rx - x Ry.
            let a = FALL_PER_M * eta;
            probe[ETA..CARRY].copy_from_slice(&[eta, a, a * y, -a * x]);
        }
        designed
    }

    /// The parameters with these values: A, then B, then C.
    pub fn from_values(values: &[f64], places: [[f64; 2]; 3]) -> Self {
        let mut probes = [[0.0; PER_PROBE]; 3];
        probes.as_flattened_mut().copy_from_slice(&values[..COUNT]);
        Self {
            probes,
            gain_per_k: [[0.0; 2]; 3],
            places,
        }
    }

    /// The parameters in a blob; `None` for another model.
    pub fn from_set(set: &ParameterSet, stage: &Stage) -> Option<Self> {
        Some(Self {
            probes: values_of(set)?,
            gain_per_k: [[0.0; 2]; 3],
            places: stage.places_m(),
        })
    }

    /// The parameters in a blob, without the drawing: the probes stand where the slopes of their sensitivities say, which the
    /// drawing changes by a part in 2000.
    pub fn from_blob(set: &ParameterSet) -> Option<Self> {
        let probes = values_of(set)?;
        Some(Self {
            probes,
            gain_per_k: [[0.0; 2]; 3],
            places: probes.map(|values| place(&values, [0.0; 2]).0),
        })
    }

    /// Lever arms, misalignments and sensitivities: the part that is Model (31).
    pub fn model_31(&self) -> Parameters {
        Parameters::from_model_31(&self.geometry(), &self.probes.map(|p| sensitivity(&p)))
    }

    /// What gains of A, B, C, as parts, add to each parameter: eta, a, b and c are scaled alike.
    pub fn gain_change(&self, parts: [f64; 3]) -> [f64; COUNT] {
        std::array::from_fn(|k| {
            let (probe, term) = (k / PER_PROBE, k % PER_PROBE);
            match (ETA..CARRY).contains(&term) {
                true => parts[probe] * self.probes[probe][term],
                false => 0.0,
            }
        })
    }

    /// The sensing axes of A, B, C.
    pub fn axes(&self) -> SensingAxes<f64> {
        SensingAxes::at(self.probes.map(|p| p[THETA]))
    }

    fn geometry(&self) -> ProbeGeometry<f64> {
        ProbeGeometry {
            lever_arm_m: self.probes.map(|p| p[LEVER_ARM]),
            misalignment_rad: self.probes.map(|p| p[THETA]),
        }
    }

    /// The lateral rows W: displacement across each probe's axis per (m, m, rad) of (X, Y, Rz).
    pub fn lateral(&self) -> Matrix3<f64> {
        let axes = self.axes();
        from_rows(&[0, 1, 2].map(|k| {
            let p = &self.probes[k];
            let (along, across) = (axes.0[k], axes.across()[k]);
            let [x, y] = place(p, self.places[k]).0;
            [across[0], across[1], along[0] * x + along[1] * y]
        }))
    }

    /// The decoder's constants for signals in units of `m_per_unit`: m for signals in m, m per
    /// code for codes. `None` where PM is singular.
    pub fn constants(&self, m_per_unit: f64) -> Option<FieldConstants> {
        let plane_inverse = inverse(&self.geometry().plane())?;
        let lateral = to_rows(&(self.lateral() * plane_inverse));
        let probe = |k: usize| {
            let values = &self.probes[k];
            let scale = shape_scale(values[ETA], m_per_unit);
            let scaled = std::array::from_fn(|place| values[SHAPES + place] * scale[place]);
            FieldProbe {
                sensitivity: sensitivity(values),
                carry: [0, 1, 2].map(|j| values[CARRY + j] / m_per_unit),
                shape: shape(scaled),
                lateral: lateral[k],
            }
        };
        Some(FieldConstants {
            probes: [probe(0), probe(1), probe(2)],
            pose_rows: to_rows(&(plane_inverse * m_per_unit)),
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
    /// The planar pose of three signals at a vertical pose and T0, nothing taken off and nothing
    /// checked.
    pub fn decode(&self, signal: [f64; 3], vertical: &VerticalPose<f64>) -> PlanarPose<f64> {
        let (at_t0, zero) = ([0.0; 3], PlanarPose::ZERO);
        FieldModel::planar_pose(
            &self.probes,
            &self.pose_rows,
            signal,
            at_t0,
            vertical,
            &zero,
        )
        .1
    }
}

/// The values of the parameters that a blob carries, in the order of [`TERMS`] and its units, of
/// A, B and C; `None` for another model.
pub fn values_of(set: &ParameterSet) -> Option<[[f64; PER_PROBE]; 3]> {
    let Probes::Field(probes) = set.probes.rounded::<f64>() else {
        return None;
    };
    let m_per_code = f64::from(set.hall.m_per_code);
    let probe_values = |k: usize| {
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
    Some([probe_values(0), probe_values(1), probe_values(2)])
}

fn sensitivity(values: &[f64; PER_PROBE]) -> Sensitivity<f64> {
    Sensitivity {
        eta: values[ETA],
        per_z_m: values[SLOPES],
        per_rx_rad: values[SLOPES + 1],
        per_ry_rad: values[SLOPES + 2],
    }
}

/// Factors from the coefficients of p in mm to the decoder's coefficients, for u, w and p in units of `m_per_unit`
/// and for zr = eta z in place of z.
fn shape_scale(eta: f64, m_per_unit: f64) -> [f64; SHAPE] {
    let per_unit = m_per_unit / SHAPE_UNIT_M;
    std::array::from_fn(|place| {
        let [u, w, z] = TERMS[SHAPES + place].powers.map(i32::from);
        powi(per_unit, u + w) / per_unit * powi(1.0 / eta, z)
    })
}

/// x^n, n >= 0, by plain products: `f64::powi` may round differently from build to build.
fn powi(x: f64, n: i32) -> f64 {
    (0..n).fold(1.0, |power, _| power * x)
}

/// Where a probe stands, (x, y), m, and the derivatives of x by (a, c) and of y by (a, b). The
/// vertical terms determine it: phi follows the height at the probe, a (Z + y Rx - x Ry), so that x = -c/a
/// and y = b/a; where a is small the drawing does.
pub fn place(values: &[f64; PER_PROBE], designed: [f64; 2]) -> ([f64; 2], [[f64; 2]; 2]) {
    let [a, b, c] = [values[SLOPES], values[SLOPES + 1], values[SLOPES + 2]];
    let least = SLOPE_MIN * SLOPE_MIN;
    let share = 1.0 / (a * a + least);
    let [x, y] = [
        (least * designed[0] - a * c) * share,
        (least * designed[1] + a * b) * share,
    ];
    let by = |by_a: f64, at: f64| (by_a - 2.0 * a * at) * share;
    ([x, y], [[by(-c, x), -a * share], [by(b, y), a * share]])
}

/// How far a probe stands from its designed place along X and Y, standard deviation, m.
pub fn place_m(stage: &Stage) -> f64 {
    stage.uncertainty.known(Input::ProbePlaces)
}

/// Standard deviation of a temperature coefficient (1/K) or a change by acceleration (m per m/s2) that stays at its prior.
pub const HELD: f64 = 1e-12;

/// All unknowns with their prior. Standard deviations: `place_m` of the places of the probes, `temperature` of k and h,
/// `acceleration` of the changes by acceleration.
pub fn unknowns(
    (places, place_m): (&[[f64; 2]; 3], f64),
    temperature: [f64; 2],
    acceleration: f64,
) -> Unknowns {
    let mut prior = DMatrix::zeros(UNKNOWNS, UNKNOWNS);
    for (probe, [x, y]) in places.iter().enumerate() {
        let own = probe * PER_PROBE;
        for (k, term) in TERMS.iter().enumerate() {
            if let Some(deviation) = term.prior {
                prior[(own + k, own + k)] = 1.0 / (deviation * deviation);
            }
        }
        // b - a y and c + a x are zero, each as well as the place is known.
        let weight = 1.0 / (place_m * FALL_PER_M * place_m * FALL_PER_M);
        let a = own + SLOPES;
        for (slope, per_a) in [(a + 1, -y), (a + 2, *x)] {
            prior[(slope, slope)] += weight;
            prior[(slope, a)] += weight * per_a;
            prior[(a, slope)] += weight * per_a;
            prior[(a, a)] += weight * per_a * per_a;
        }
    }
    for of in Coefficient::ALL {
        let deviation = temperature[of.sensor];
        prior[(of.row(), of.row())] = 1.0 / (deviation * deviation);
    }
    (prior.fixed_view_mut::<2, 2>(PROBE_LAGS, PROBE_LAGS)).copy_from(&lag_prior().inverse());
    for k in ACCELERATIONS..UNKNOWNS {
        prior[(k, k)] = 1.0 / (acceleration * acceleration);
    }
    Unknowns {
        origin: DVector::zeros(UNKNOWNS),
        basis: DMatrix::identity(UNKNOWNS, UNKNOWNS),
        prior,
        ranges: Vec::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::estimator::probe::probes;
    use crate::estimator::sample_for_tests::{M_PER_CODE, parameters as sample};
    use proptest::prelude::*;

    #[test]
    fn a_probe_stands_where_its_slopes_say_and_where_the_drawing_says_if_they_say_nothing() {
        let mut values = sample().probes[1];
        let designed = [-0.1975, 0.42];
        let [a, b, c] = [values[SLOPES], values[SLOPES + 1], values[SLOPES + 2]];
        let [x, y] = place(&values, designed).0;
        assert!(
            (x + c / a).abs() < 1e-3 && (y - b / a).abs() < 1e-3,
            "{x} {y}"
        );
        values[SLOPES] = 0.0;
        assert_eq!(place(&values, designed).0, designed);
    }

    fn nano(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
        [0, 1, 2].map(|k| (a[k] - b[k]).abs() * 1e9)
    }

    proptest! {
        /// Within what the decoder's one step leaves.
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
            let signal = probes.map(|probe| probe.signal_m(q, v) / M_PER_CODE);
            let exact = constants.decode(signal, &VerticalPose::from_array(v)).to_array();
            let [x, y, rz] = nano(exact, q);
            prop_assert!(x < 10.0 && y < 10.0 && rz < 15.0, "{x} {y} {rz}");

        }
    }
}
