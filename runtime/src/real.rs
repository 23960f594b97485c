//! The operations that a number must have to run the model.
//!
//! Only the core operators, which IEEE 754 rounds the same everywhere, and sine and
//! cosine from `libm`, which has the same code on every machine. There is no fused
//! multiply-add and no function with a backend that a feature could switch: so the target's
//! words equal the host's.

use nalgebra::{Field, Scalar};

/// One floating-point number: `f32` on the target, `f64` on the host.
pub trait Real: Field + Scalar + Copy + PartialOrd + Send + Sync {
    /// Zero.
    const ZERO: Self;
    /// One.
    const ONE: Self;
    /// The nearest number of this type to `value`.
    fn from_f64(value: f64) -> Self;
    /// The nearest number to an ADC code (exact for codes of up to 24 bits).
    fn from_code(code: i32) -> Self;
    /// This number as `f64`, exactly.
    fn to_f64(self) -> f64;
    /// Sine and cosine of an angle in rad, by `libm`.
    fn sin_cos(self) -> (Self, Self);
}

impl Real for f32 {
    const ZERO: Self = 0.0;
    const ONE: Self = 1.0;
    #[inline(always)]
    fn from_f64(value: f64) -> Self {
        value as f32
    }
    #[inline(always)]
    fn from_code(code: i32) -> Self {
        code as f32
    }
    #[inline(always)]
    fn to_f64(self) -> f64 {
        f64::from(self)
    }
    fn sin_cos(self) -> (Self, Self) {
        libm::sincosf(self)
    }
}

impl Real for f64 {
    const ZERO: Self = 0.0;
    const ONE: Self = 1.0;
    #[inline(always)]
    fn from_f64(value: f64) -> Self {
        value
    }
    #[inline(always)]
    fn from_code(code: i32) -> Self {
        f64::from(code)
    }
    #[inline(always)]
    fn to_f64(self) -> f64 {
        self
    }
    fn sin_cos(self) -> (Self, Self) {
        libm::sincos(self)
    }
}
