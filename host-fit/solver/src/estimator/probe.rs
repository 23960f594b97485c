//! What a probe reads by the field model, with its derivatives, in SI.

use super::parameters::{FieldParameters, place};
use super::terms::{CARRY, ETA, LEVER_ARM, PER_PROBE, SHAPE, SHAPE_UNIT_M, SHAPES, SLOPES, THETA};

/// One probe, ready to be evaluated at many poses.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Probe {
    values: [f64; PER_PROBE],
    gain_per_k: [f64; 2],
    sin: f64,
    cos: f64,
    /// Lateral displacement per Rz, m, and its derivatives by theta, a, b, c.
    lateral_arm: f64,
    lateral_arm_by_theta: f64,
    lateral_arm_by_slope: [f64; 3],
}

/// What a probe reads at a pose, and how that changes.
#[derive(Clone, Copy, Debug)]
pub struct Reading {
    /// Displacement at the designed scale, m.
    pub signal_m: f64,
    /// Its derivatives by X, Y (m) and Rz (rad).
    pub by_pose: [f64; 3],
    /// Its derivatives by Z (m), Rx and Ry (rad).
    pub by_vertical: [f64; 3],
    /// Its derivatives by the parameters of the probe, in m and their units.
    pub by_parameter: [f64; PER_PROBE],
}

/// The three probes of a calibration.
pub fn probes(parameters: &FieldParameters) -> [Probe; 3] {
    let axes = parameters.axes().0;
    [0, 1, 2].map(|k| Probe {
        gain_per_k: parameters.gain_per_k[k],
        ..Probe::new(&parameters.probes[k], parameters.places[k], axes[k])
    })
}

impl Probe {
    fn new(values: &[f64; PER_PROBE], designed: [f64; 2], axis: [f64; 2]) -> Self {
        let (sin, cos) = (-axis[0], axis[1]);
        let ([x, y], [[x_by_a, x_by_c], [y_by_a, y_by_b]]) = place(values, designed);
        Self {
            values: *values,
            gain_per_k: [0.0; 2],
            sin,
            cos,
            lateral_arm: cos * y - sin * x,
            lateral_arm_by_theta: -(sin * y) - cos * x,
            lateral_arm_by_slope: [cos * y_by_a - sin * x_by_a, cos * y_by_b, -sin * x_by_c],
        }
    }

    /// The gain at changes of temperature, K, over that which was expected.
    #[inline(always)]
    pub fn gain(&self, temperature_k: [f64; 2]) -> f64 {
        1.0 + (self.gain_per_k[0] * temperature_k[0] + self.gain_per_k[1] * temperature_k[1])
    }

    /// The displacement read at the planar pose `planar` (m, m, rad) and the vertical pose
    /// `vertical` (m, rad, rad), at the designed scale, m.
    #[inline(always)]
    pub fn signal_m(&self, planar: [f64; 3], vertical: [f64; 3]) -> f64 {
        self.read(planar, vertical).signal_m
    }

    /// The reading at the planar pose `planar` (m, m, rad) and the vertical pose
    /// `vertical` (m, rad, rad).
    #[inline(always)]
    pub fn read(&self, planar: [f64; 3], vertical: [f64; 3]) -> Reading {
        let p = &self.values;
        let (sin, cos) = (self.sin, self.cos);
        let [x, y, rz] = planar;
        let [v0, v1, v2] = vertical;
        let along = cos * y - sin * x;
        let across = -(cos * x) - sin * y;
        let u = along + p[LEVER_ARM] * rz;
        let w = across + self.lateral_arm * rz;
        let per_eta = 1.0 / p[ETA];
        let change = (p[SLOPES] * v0 + p[SLOPES + 1] * v1) + p[SLOPES + 2] * v2;
        let phi = p[ETA] + change;
        let z = change * per_eta;
        let carried = (p[CARRY] * v0 + p[CARRY + 1] * v1) + p[CARRY + 2] * v2;

        let (m, [p_u, p_w, p_z]) = shape(p, u / SHAPE_UNIT_M, w / SHAPE_UNIT_M, z);
        let mut own = 0.0;
        for k in 0..SHAPE {
            own += p[SHAPES + k] * m[k];
        }
        let at_probe = (u + carried) + own * SHAPE_UNIT_M;
        let phi_shape = phi * SHAPE_UNIT_M;
        let (by_u, by_w, by_z) = (phi * (1.0 + p_u), phi * p_w, phi_shape * p_z * per_eta);
        let slope = at_probe + by_z;
        let by_arm = by_w * rz;

        let mut by_parameter = [0.0; PER_PROBE];
        by_parameter[LEVER_ARM] = by_u * rz;
        by_parameter[THETA] = by_u * across + by_w * (self.lateral_arm_by_theta * rz - along);
        by_parameter[ETA] = at_probe - by_z * z;
        for (k, v) in vertical.into_iter().enumerate() {
            by_parameter[SLOPES + k] = slope * v + by_arm * self.lateral_arm_by_slope[k];
            by_parameter[CARRY + k] = phi * v;
        }
        for k in 0..SHAPE {
            by_parameter[SHAPES + k] = phi_shape * m[k];
        }
        Reading {
            signal_m: phi * at_probe,
            by_pose: [
                -(by_u * sin) - by_w * cos,
                by_u * cos - by_w * sin,
                by_u * p[LEVER_ARM] + by_w * self.lateral_arm,
            ],
            by_vertical: [0, 1, 2].map(|k| slope * p[SLOPES + k] + phi * p[CARRY + k]),
            by_parameter,
        }
    }
}

/// The monomials of p at (u, w, z) in the order of the parameters, and the derivatives of p.
#[inline(always)]
fn shape(p: &[f64; PER_PROBE], u: f64, w: f64, z: f64) -> ([f64; SHAPE], [f64; 3]) {
    let (u2, w2, z2) = (u * u, w * w, z * z);
    let (uw, uz, wz) = (u * w, u * z, w * z);
    let monomials = [
        uw,
        uw * w,
        uz * z,
        u2 * u,
        uw * z,
        uw * wz,
        u2 * uz,
        uz * z2,
        w2,
        wz,
        z2,
        u2,
        w2 * z,
        w2 * w,
        wz * z,
        u2 * z,
        u2 * w,
        z2 * z,
    ];
    let [
        c_uw,
        c_uw2,
        c_uz2,
        c_u3,
        c_uwz,
        c_uw2z,
        c_u3z,
        c_uz3,
        c_w2,
        c_wz,
        c_z2,
        c_u2,
        c_w2z,
        c_w3,
        c_wz2,
        c_u2z,
        c_u2w,
        c_z3,
    ] = std::array::from_fn(|k| p[SHAPES + k]);
    let by_u = w * ((c_uw + c_uwz * z) + w * (c_uw2 + c_uw2z * z))
        + z2 * (c_uz2 + c_uz3 * z)
        + u * (3.0 * u * (c_u3 + c_u3z * z) + 2.0 * ((c_u2 + c_u2z * z) + c_u2w * w));
    let by_w = u * ((c_uw + c_uwz * z) + 2.0 * w * (c_uw2 + c_uw2z * z) + c_u2w * u)
        + w * (2.0 * (c_w2 + c_w2z * z) + 3.0 * c_w3 * w)
        + z * (c_wz + c_wz2 * z);
    let by_z = u * (w * (c_uwz + c_uw2z * w) + z * (2.0 * c_uz2 + 3.0 * c_uz3 * z))
        + u2 * (c_u3z * u + c_u2z)
        + w * (c_wz + 2.0 * c_wz2 * z + c_w2z * w)
        + z * (2.0 * c_z2 + 3.0 * c_z3 * z);
    (monomials, [by_u, by_w, by_z])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::estimator::sample_for_tests::parameters;
    use crate::estimator::terms::TERMS;

    const PLANAR: [f64; 3] = [0.31e-3, -0.42e-3, 0.23e-3];
    const VERTICAL: [f64; 3] = [180e-6, -390e-6, 270e-6];

    #[test]
    fn the_derivatives_are_those_of_finite_differences() {
        let mut flat = parameters();
        flat.probes[1][SLOPES] = 2.0;
        for parameters in [parameters(), flat] {
            let read = probes(&parameters).map(|probe| probe.read(PLANAR, VERTICAL));
            for (k, read) in read.iter().enumerate() {
                for axis in 0..3 {
                    let moved = |planar: f64, vertical: f64| {
                        let (mut at_planar, mut at) = (PLANAR, VERTICAL);
                        at_planar[axis] += planar;
                        at[axis] += vertical;
                        probes(&parameters)[k].signal_m(at_planar, at)
                    };
                    let slope = (moved(1e-8, 0.0) - moved(-1e-8, 0.0)) / 2e-8;
                    assert!((slope - read.by_pose[axis]).abs() < 1e-9, "{k} {axis}");
                    let slope = (moved(0.0, 1e-6) - moved(0.0, -1e-6)) / 2e-6;
                    let found = read.by_vertical[axis];
                    let close = (slope - found).abs() < 1e-6 * found.abs();
                    assert!(close, "{k} {axis}: {slope} {found}");
                }
                for (term, &found) in read.by_parameter.iter().enumerate() {
                    let step = 1e-4 * parameters.probes[k][term].abs().max(0.01);
                    let moved = |step: f64| {
                        let mut parameters = parameters;
                        parameters.probes[k][term] += step;
                        probes(&parameters)[k].signal_m(PLANAR, VERTICAL)
                    };
                    let slope = (moved(step) - moved(-step)) / (2.0 * step);
                    let close = (slope - found).abs() < 1e-7 * found.abs() + 1e-13;
                    assert!(close, "{k} {}: {slope} {found}", TERMS[term].name);
                }
            }
        }
    }
}
