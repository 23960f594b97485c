//! The field model: the signal of a probe that passes beside the middle of its magnet.
//!
//! With u the displacement along a probe's sensing axis, w that across it, V = (Z, Rx, Ry),
//! phi = eta + zr, zr = a Z + b Rx + c Ry and z = zr / eta:
//!
//! s = phi (u + E V + p(u, w, z))
//!
//! E is how far a height change or a tilt carries the probe sideways; p has 18 monomials (see
//! [`Shape`]). E = 0 and p = 0 give Model (31).
//!
//! The decoder takes one step of Newton's method from u = r = s / phi - E V, with the slopes
//! p_u and p_w of p at r: u = r - v, where
//!
//! v = p - (p_u v + p_w W PM^-1 v)
//!
//! is found in two passes from v = p, W being the lateral rows (w = W PM^-1 u); then
//! q = PM^-1 u - zero. It has three divisions and no branch. Its error is a third of the error of
//! two passes of u = r - p(u, w, z). Small terms are summed first: each addition
//! to a displacement of half a millimetre rounds to its last digit.
//!
//! Powers of 1/eta and the unit of the signal (codes on the target) are folded into the
//! constants, so that the tick uses zr and codes directly. The terms of p that depend on the
//! height alone have no slopes and are subtracted from r. At one height the other terms are a
//! polynomial in u and w.

use super::{Model, Sensitivity, apply_gain, dot, dot_less};
use crate::pose::{PlanarPose, VerticalPose};
use crate::real::Real;

/// The field model: phi as in Model (31), and the displacement without the terms E V and
/// p(u, w, z), found by one step of Newton's method.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FieldModel {}

/// The constants of one probe in the field model. On the target the unit of the signal is
/// the code: displacement per code at the designed sensitivity.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(C)]
pub struct FieldProbe<T> {
    /// eta, a, b, c (equation 33).
    pub sensitivity: Sensitivity<T>,
    /// E: displacement of the probe along its axis per m of Z and per rad of Rx, Ry, in the
    /// unit of the signal.
    pub carry: [T; 3],
    /// p.
    pub shape: Shape<T>,
    /// The probe's row of W PM^-1: displacement across its axis per displacement along the axes
    /// of A, B, C. Times PM it is the lateral row (-cos t, -sin t, y cos t - x sin t), with
    /// (x, y) the place of the probe and t the angle of its axis from +Y.
    pub lateral: [T; 3],
}

/// The coefficients of p of one probe, for u, w and p in the unit of the signal and for zr in
/// place of z.
///
/// Where there are two, the first multiplies the monomial that is named and the second the same
/// times zr.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(C)]
pub struct Shape<T> {
    /// uw2, uw2z.
    pub u_w_w: [T; 2],
    /// uw, uwz.
    pub u_w: [T; 2],
    /// uz2, uz3.
    pub u_z_z: [T; 2],
    /// u3, u3z.
    pub u_u_u: [T; 2],
    /// u2, u2z.
    pub u_u: [T; 2],
    /// w2, w2z.
    pub w_w: [T; 2],
    /// wz, wz2.
    pub w_z: [T; 2],
    /// z2, z3.
    pub z_z: [T; 2],
    /// u2w.
    pub u_u_w: T,
    /// w3.
    pub w_w_w: T,
}

impl Model for FieldModel {
    type Probe<T: Real> = FieldProbe<T>;

    #[inline(always)]
    fn planar_pose<T: Real>(
        probes: &[FieldProbe<T>; 3],
        pose_rows: &[[T; 3]; 3],
        signal: [T; 3],
        gain_change: [T; 3],
        vertical: &VerticalPose<T>,
        zero: &PlanarPose<T>,
    ) -> ([T; 3], PlanarPose<T>) {
        let [a, b, c] = probes;
        let change = [
            change_with(&a.sensitivity, vertical),
            change_with(&b.sensitivity, vertical),
            change_with(&c.sensitivity, vertical),
        ];
        let phi = [
            apply_gain(a.sensitivity.eta + change[0], gain_change[0]),
            apply_gain(b.sensitivity.eta + change[1], gain_change[1]),
            apply_gain(c.sensitivity.eta + change[2], gain_change[2]),
        ];
        let r = [
            a.first_displacement(signal[0] / phi[0], change[0], vertical),
            b.first_displacement(signal[1] / phi[1], change[1], vertical),
            c.first_displacement(signal[2] / phi[2], change[2], vertical),
        ];
        let p = [
            a.shape.at(r[0], dot(&a.lateral, r), change[0]),
            b.shape.at(r[1], dot(&b.lateral, r), change[1]),
            c.shape.at(r[2], dot(&c.lateral, r), change[2]),
        ];
        let v = [p[0].value, p[1].value, p[2].value];
        let v = moved(probes, &p, v);
        let v = moved(probes, &p, v);
        let u = [r[0] - v[0], r[1] - v[1], r[2] - v[2]];
        let pose = PlanarPose {
            x_m: dot_less(&pose_rows[0], u, zero.x_m),
            y_m: dot_less(&pose_rows[1], u, zero.y_m),
            rz_rad: dot_less(&pose_rows[2], u, zero.rz_rad),
        };
        (phi, pose)
    }
}

impl<T: Real> FieldProbe<T> {
    /// Each constant as another type of number, rounded to the nearest.
    #[must_use]
    pub fn rounded<U: Real>(&self) -> FieldProbe<U> {
        let round = |x: T| U::from_f64(x.to_f64());
        FieldProbe {
            sensitivity: self.sensitivity.rounded(),
            carry: self.carry.map(round),
            shape: self.shape.map(round),
            lateral: self.lateral.map(round),
        }
    }

    /// r: the displacement along the probe's axis that follows from the signal and the vertical
    /// pose, s / phi - E V, less the terms of p that depend on the height alone.
    #[inline(always)]
    fn first_displacement(&self, ratio: T, zr: T, vertical: &VerticalPose<T>) -> T {
        let [e_z, e_rx, e_ry] = self.carry;
        let carried = (e_z * vertical.z_m + e_rx * vertical.rx_rad) + e_ry * vertical.ry_rad;
        ratio - (carried + self.shape.still(zr))
    }
}

impl FieldProbe<f32> {
    /// Bounds of the slopes of p by u and by w over |u| <= `u`, |w| <= `w`, |zr| <= `zr`: the
    /// slopes of a p without minus signs, at the corner of that box.
    #[inline(never)]
    pub(crate) fn steepest_slopes(&self, u: f32, w: f32, zr: f32) -> [f32; 2] {
        let corner = self.shape.map(f32::abs);
        let Tangent { per_u, per_w, .. } = corner.at(u, w, zr);
        [per_u, per_w]
    }
}

/// zr = a Z + b Rx + c Ry: the change of a probe's sensitivity with the vertical pose.
#[inline(always)]
fn change_with<T: Real>(probe: &Sensitivity<T>, vertical: &VerticalPose<T>) -> T {
    (probe.per_z_m * vertical.z_m + probe.per_rx_rad * vertical.rx_rad)
        + probe.per_ry_rad * vertical.ry_rad
}

/// p at r - v, by its slopes at r: one pass.
#[inline(always)]
fn moved<T: Real>(probes: &[FieldProbe<T>; 3], p: &[Tangent<T>; 3], v: [T; 3]) -> [T; 3] {
    [
        p[0].back(v[0], dot(&probes[0].lateral, v)),
        p[1].back(v[1], dot(&probes[1].lateral, v)),
        p[2].back(v[2], dot(&probes[2].lateral, v)),
    ]
}

/// The terms of p of one probe that depend on u and w, and their slopes there.
#[derive(Clone, Copy)]
struct Tangent<T> {
    value: T,
    per_u: T,
    per_w: T,
}

impl<T: Real> Shape<T> {
    /// `f` of each coefficient.
    #[must_use]
    pub fn map<U>(&self, f: impl Fn(T) -> U) -> Shape<U> {
        let pair = |[constant, slope]: [T; 2]| [f(constant), f(slope)];
        Shape {
            u_w_w: pair(self.u_w_w),
            u_w: pair(self.u_w),
            u_z_z: pair(self.u_z_z),
            u_u_u: pair(self.u_u_u),
            u_u: pair(self.u_u),
            w_w: pair(self.w_w),
            w_z: pair(self.w_z),
            z_z: pair(self.z_z),
            u_u_w: f(self.u_u_w),
            w_w_w: f(self.w_w_w),
        }
    }

    /// The terms that depend on the height alone.
    #[inline(always)]
    fn still(&self, zr: T) -> T {
        (zr * zr) * line(self.z_z, zr)
    }

    /// The others, u x(u, w) + w y(w), and their slopes: x + u x_u and y + w y_w + u x_w.
    ///
    /// The value is taken from the slopes: else a compiler would form these where they are
    /// used, and until then keep all that they are made of.
    #[inline(always)]
    fn at(&self, u: T, w: T, zr: T) -> Tangent<T> {
        let uuu = u * line(self.u_u_u, zr);
        let uww = w * line(self.u_w_w, zr);
        let www = w * self.w_w_w;
        let uu = (line(self.u_u, zr) + w * self.u_u_w) + uuu;
        let uw = line(self.u_w, zr) + uww;
        let ww = line(self.w_w, zr) + www;
        let x = ((zr * zr) * line(self.u_z_z, zr) + w * uw) + u * uu;
        let x_u = uu + uuu;
        let x_w = (uw + uww) + u * self.u_u_w;
        let y = zr * line(self.w_z, zr) + w * ww;
        let y_w = ww + www;
        let per_u = x + u * x_u;
        let per_w = (y + w * y_w) + u * x_w;
        Tangent {
            value: u * (per_u - u * x_u) + w * ((per_w - w * y_w) - u * x_w),
            per_u,
            per_w,
        }
    }
}

/// A coefficient with its change with zr.
#[inline(always)]
fn line<T: Real>([constant, slope]: [T; 2], zr: T) -> T {
    constant + slope * zr
}

impl<T: Real> Tangent<T> {
    /// The value, (v, w) back from the place.
    #[inline(always)]
    fn back(&self, v: T, w: T) -> T {
        (self.value - self.per_u * v) - self.per_w * w
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::matrix::{from_rows, inverse};
    use crate::model::{LinearModel, Probes};
    use crate::sample;
    use nalgebra::Vector3;
    use proptest::prelude::*;

    /// s = phi (u + E V + p(u, w, z)) with p written as its monomials.
    fn signal(probe: &FieldProbe<f64>, u: f64, w: f64, vertical: &VerticalPose<f64>) -> f64 {
        let VerticalPose {
            z_m,
            rx_rad,
            ry_rad,
        } = *vertical;
        let Sensitivity {
            eta,
            per_z_m,
            per_rx_rad,
            per_ry_rad,
        } = probe.sensitivity;
        let zr = per_z_m * z_m + per_rx_rad * rx_rad + per_ry_rad * ry_rad;
        let carried = probe.carry[0] * z_m + probe.carry[1] * rx_rad + probe.carry[2] * ry_rad;
        let p = &probe.shape;
        let pairs = [
            (p.u_w_w, u * w * w),
            (p.u_w, u * w),
            (p.u_z_z, u * zr * zr),
            (p.u_u_u, u * u * u),
            (p.u_u, u * u),
            (p.w_w, w * w),
            (p.w_z, w * zr),
            (p.z_z, zr * zr),
        ];
        let mut shape = p.u_u_w * u * u * w + p.w_w_w * w * w * w;
        for ([plain, with_height], monomial) in pairs {
            shape += plain * monomial + with_height * monomial * zr;
        }
        (eta + zr) * (u + carried + shape)
    }

    /// The signals of the sample at a pose, decoded: phi and the pose.
    fn decoded(q: [f64; 3], v: [f64; 3]) -> ([f64; 3], [f64; 3]) {
        let vertical = VerticalPose::from_array([250e-6 * v[0], 5e-4 * v[1], 5e-4 * v[2]]);
        let calibration = sample::field_calibration();
        let rows = calibration
            .constants()
            .expect("a sound stage")
            .planar_per_code;
        let plane = inverse(&from_rows(&rows)).expect("a sound stage");
        let Probes::Field(probes) = calibration.probes else {
            panic!("another model")
        };
        let u: [f64; 3] = (plane * Vector3::from(q)).into();
        let s = [0, 1, 2].map(|k| signal(&probes[k], u[k], dot(&probes[k].lateral, u), &vertical));
        let zero = PlanarPose::ZERO;
        let (phi, back) = FieldModel::planar_pose(&probes, &rows, s, [0.0; 3], &vertical, &zero);
        (phi, back.to_array())
    }

    proptest! {
        /// Within the error of one step, where p is a third of its prior: 10 nm and 15 nrad.
        #[test]
        fn the_decoder_undoes_the_forward_model(
            q in prop::array::uniform3(-5e-4..5e-4f64),
            v in prop::array::uniform3(-1.0..1.0f64),
        ) {
            let q = [q[0], q[1], 0.6 * q[2]];
            let (phi, back) = decoded(q, v);
            prop_assert!(phi.iter().all(|phi| (0.5..1.1).contains(phi)), "{phi:?}");
            for ((have, want), most) in back.into_iter().zip(q).zip([10e-9, 10e-9, 15e-9]) {
                prop_assert!((have - want).abs() < most, "{have:e} {want:e}");
            }
        }

        #[test]
        fn the_slopes_of_p_are_those_of_its_value(
            at in prop::array::uniform3(-1.0..1.0f64),
            pairs in prop::array::uniform8(prop::array::uniform2(-1.0..1.0f64)),
            plain in prop::array::uniform2(-1.0..1.0f64),
        ) {
            let [u_w_w, u_w, u_z_z, u_u_u, u_u, w_w, w_z, z_z] = pairs;
            let [u_u_w, w_w_w] = plain;
            let shape = Shape { u_w_w, u_w, u_z_z, u_u_u, u_u, w_w, w_z, z_z, u_u_w, w_w_w };
            let ([u, w, zr], h) = (at, 1e-4);
            let p = |u, w| shape.at(u, w, zr).value;
            let Tangent { per_u, per_w, .. } = shape.at(u, w, zr);
            // The central difference of a cubic errs by h^2 times its third coefficient.
            prop_assert!((per_u - (p(u + h, w) - p(u - h, w)) / (2.0 * h)).abs() < 1e-7);
            prop_assert!((per_w - (p(u, w + h) - p(u, w - h)) / (2.0 * h)).abs() < 1e-7);
        }

        /// Terms of zero add nothing: the poses equal Model (31) at the same phi.
        #[test]
        fn without_its_terms_the_field_model_is_model_31(
            s in prop::array::uniform3(-8000.0..8000.0f32),
            v in prop::array::uniform3(-5e-4..5e-4f32),
        ) {
            let set = sample::field_parameters();
            let Probes::Field(mut probes) = set.probes else { panic!("another model") };
            for probe in &mut probes {
                probe.carry = [0.0; 3];
                probe.shape = Shape::default();
            }
            let vertical = VerticalPose::from_array(v);
            let (rows, zero) = (&set.constants.planar_per_code, PlanarPose::ZERO);
            let (phi, pose) = FieldModel::planar_pose(&probes, rows, s, [0.0; 3], &vertical, &zero);
            prop_assert_eq!(pose, crate::model::planar_pose(rows, s, phi, &zero));
            let linear = probes.map(|probe| probe.sensitivity);
            let (of_31, _) = LinearModel::planar_pose(&linear, rows, s, [0.0; 3], &vertical, &zero);
            for (phi, of_31) in phi.into_iter().zip(of_31) {
                prop_assert!((phi - of_31).abs() < 1e-6);
            }
        }
    }
}
