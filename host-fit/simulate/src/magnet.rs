//! Field of a uniformly magnetised cuboid, in closed form.
//!
//! A cuboid with the magnetisation M carries the surface charge M . n on its faces. The field of a
//! charged rectangle has one logarithm or arctangent for each corner (textbook result). With mu0 M = J
//! the field outside is B = N J, where
//!
//! ```text
//! X = x -+ a, Y = y -+ b, Z = z -+ c, R = |(X, Y, Z)|: from each of the 8 corners, sign + - ..
//! N_xx = -1/(4 pi) sum sign atan(Y Z / (X R))       N_xy = 1/(4 pi) sum sign ln(R + Z)
//! ```
//!
//! and the other entries follow by cyclic exchange of x, y, z. N is symmetric, and its trace is zero
//! outside the magnet.

use nalgebra::{Matrix3, Vector3};
use std::f64::consts::PI;

/// A cuboid with its edges along x, y, z and its centre at the origin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cuboid {
    /// Half the lengths of its edges, m.
    pub half_m: Vector3<f64>,
    /// Remanence J = mu0 M, in any unit. The field has the same unit.
    pub remanence: Vector3<f64>,
}

impl Cuboid {
    /// Flux density at a point outside the magnet, in the unit of the remanence.
    pub fn field(&self, at_m: Vector3<f64>) -> Vector3<f64> {
        shape_tensor(self.half_m, at_m) * self.remanence
    }
}

/// The matrix N of the module documentation.
fn shape_tensor(half_m: Vector3<f64>, at_m: Vector3<f64>) -> Matrix3<f64> {
    let mut diagonal = [0.0; 3];
    // One logarithm of the product over the eight corners, with signs as powers.
    let mut products = [1.0; 3];
    for corner in 0..8 {
        let mut sign = 1.0;
        let mut d = [0.0; 3];
        for axis in 0..3 {
            let positive = corner >> axis & 1 == 0;
            sign = if positive { sign } else { -sign };
            let half = half_m[axis];
            d[axis] = at_m[axis] + if positive { half } else { -half };
        }
        let [x, y, z] = d;
        let r = libm::sqrt((x * x + y * y) + z * z);
        let faces = [(y * z) / (x * r), (z * x) / (y * r), (x * y) / (z * r)];
        for axis in 0..3 {
            diagonal[axis] -= sign * libm::atan(faces[axis]);
            if sign > 0.0 {
                products[axis] *= r + d[axis];
            } else {
                products[axis] /= r + d[axis];
            }
        }
    }
    let scale = 1.0 / (4.0 * PI);
    let [xx, yy, zz] = diagonal.map(|sum| scale * sum);
    let [yz, zx, xy] = products.map(|product| scale * libm::log(product));
    Matrix3::new(xx, xy, zx, xy, yy, yz, zx, yz, zz)
}

#[cfg(test)]
mod tests {
    use super::*;

    const MAGNET: Cuboid = Cuboid {
        half_m: Vector3::new(6.35e-3, 3.2e-3, 3.2e-3),
        remanence: Vector3::new(0.9, -0.3, 0.2),
    };
    const POINTS: [Vector3<f64>; 4] = [
        Vector3::new(0.4e-3, 0.3e-3, 8.0e-3),
        Vector3::new(-3.0e-3, 2.0e-3, 7.5e-3),
        Vector3::new(2.0e-3, -9.0e-3, -1.0e-3),
        Vector3::new(-11.0e-3, -5.0e-3, -6.0e-3),
    ];

    fn assert_near(have: Vector3<f64>, want: Vector3<f64>, relative: f64) {
        assert!(
            (have - want).amax() <= relative * want.amax(),
            "{have}, not {want}"
        );
    }

    #[test]
    fn far_away_it_is_the_field_of_a_dipole_on_every_side() {
        let j = MAGNET.remanence;
        let moment = 8.0 * MAGNET.half_m.product() / (4.0 * PI);
        for side in 0..8 {
            let sign = |axis: usize| if side >> axis & 1 == 0 { 1.0 } else { -1.0 };
            let at = Vector3::new(0.31 * sign(0), 0.52 * sign(1), 0.43 * sign(2));
            let (r, to) = (at.norm(), at.normalize());
            let dipole = (to * (3.0 * to.dot(&j)) - j) * (moment / r.powi(3));
            assert_near(MAGNET.field(at), dipole, 1e-3);
        }
    }

    #[test]
    fn it_is_the_field_of_the_charges_on_the_faces() {
        const CELLS: usize = 200;
        for at in POINTS {
            let mut sum = Vector3::zeros();
            for (axis, side) in (0..3).flat_map(|axis| [(axis, 1.0), (axis, -1.0)]) {
                let (p, q) = ((axis + 1) % 3, (axis + 2) % 3);
                let middle = |cell: usize| (2 * cell + 1) as f64 / CELLS as f64 - 1.0;
                let area = 4.0 * MAGNET.half_m[p] * MAGNET.half_m[q] / (CELLS * CELLS) as f64;
                let charge = side * MAGNET.remanence[axis] * area / (4.0 * PI);
                for (i, k) in (0..CELLS).flat_map(|i| (0..CELLS).map(move |k| (i, k))) {
                    let mut d = at;
                    d[axis] -= side * MAGNET.half_m[axis];
                    d[p] -= middle(i) * MAGNET.half_m[p];
                    d[q] -= middle(k) * MAGNET.half_m[q];
                    sum += d * (charge / d.norm().powi(3));
                }
            }
            assert_near(MAGNET.field(at), sum, 2e-4);
        }
    }
}
