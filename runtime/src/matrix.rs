//! The inverse of a 3 x 3 matrix, in the order of operations that the constants of a blob have.
//!
//! Off the tick a matrix is a [`Matrix3`]. The tick and the blob have its rows, as arrays.

use crate::real::Real;
use nalgebra::{Matrix3, Vector3};

/// The matrix with these rows.
#[inline(never)]
pub fn from_rows<T: Real>(rows: &[[T; 3]; 3]) -> Matrix3<T> {
    Matrix3::from(*rows).transpose()
}

/// The rows of a matrix.
#[inline(never)]
pub fn to_rows<T: Real>(matrix: &Matrix3<T>) -> [[T; 3]; 3] {
    matrix.transpose().into()
}

/// The inverse of a matrix and its determinant. Where that is zero, the inverse is not finite.
///
/// With the rows a, b, c: the columns of the inverse are b x c, c x a and a x b over the
/// determinant a . (b x c). `Matrix3::try_inverse` divides where this multiplies by the
/// reciprocal, so its last digits differ.
#[inline(always)]
pub fn inverse_and_determinant<T: Real>(matrix: &Matrix3<T>) -> (Matrix3<T>, T) {
    let m = matrix;
    let a = Vector3::new(m.m11, m.m12, m.m13);
    let b = Vector3::new(m.m21, m.m22, m.m23);
    let c = Vector3::new(m.m31, m.m32, m.m33);
    let columns = [b.cross(&c), c.cross(&a), a.cross(&b)];
    let determinant = a.dot(&columns[0]);
    let adjugate = Matrix3::from_columns(&columns);
    (adjugate * (T::ONE / determinant), determinant)
}

/// The inverse of a matrix; `None` when the determinant is zero, subnormal (as `f32`) or not
/// finite.
#[cfg(feature = "host")]
pub fn inverse<T: Real>(matrix: &Matrix3<T>) -> Option<Matrix3<T>> {
    let (inverse, determinant) = inverse_and_determinant(matrix);
    let size = determinant.to_f64().abs();
    (size.is_finite() && size > f64::from(f32::MIN_POSITIVE)).then_some(inverse)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn inverse_times_matrix_is_identity(
            rows in prop::array::uniform3(prop::array::uniform3(-1.0..1.0f64)),
        ) {
            let matrix = from_rows(&rows) + Matrix3::from_diagonal_element(3.0);
            let product = inverse(&matrix).expect("a dominant diagonal") * matrix;
            prop_assert!((product - Matrix3::identity()).amax() < 1e-14);
        }
    }

    #[test]
    fn a_singular_matrix_has_no_inverse() {
        let singular = from_rows(&[[1.0f64, 2.0, 3.0], [2.0, 4.0, 6.0], [0.0, 1.0, 0.0]]);
        assert_eq!(inverse(&singular), None);
        assert_eq!(inverse(&Matrix3::repeat(f32::NAN)), None);
    }
}
