//! Whether this machine computes as the calibration was judged: a check for start-up.
//!
//! Host and target give the same words because both round to nearest and keep subnormal
//! numbers. A floating-point unit can be set otherwise (FPSCR bits FZ and RMode on a Cortex-M,
//! MXCSR on x86), by start-up code or a library; the words would then differ in silence.

use core::hint::black_box;

/// How floating-point arithmetic is set wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum ArithmeticFault {
    /// Subnormal numbers become zero.
    #[error("subnormal numbers become zero: clear FZ of FPSCR")]
    SubnormalsLost,
    /// Results are not rounded to the nearest number.
    #[error("results are not rounded to nearest: clear RMode of FPSCR")]
    RoundingChanged,
}

/// Checks by a few sums and products that arithmetic is set as after a reset. Call it once,
/// before the first tick, in the context that ticks.
///
/// # Errors
/// [`ArithmeticFault`]: don't move the stage by poses of this machine.
pub fn check() -> Result<(), ArithmeticFault> {
    let half_smallest = black_box(f32::MIN_POSITIVE) * black_box(0.5);
    let subnormal = black_box(f32::from_bits(3)) + black_box(f32::from_bits(4));
    if half_smallest.to_bits() != 1 << 22 || subnormal.to_bits() != 7 {
        return Err(ArithmeticFault::SubnormalsLost);
    }
    // A quarter and three quarters of the last digit of 1, on both sides of zero: each other
    // way of rounding moves at least one of them.
    let digit = f32::EPSILON;
    for (addend, want) in [(0.25 * digit, 1.0), (0.75 * digit, 1.0 + digit)] {
        let up = black_box(1.0) + black_box(addend);
        let down = black_box(-1.0) - black_box(addend);
        if up.to_bits() != f32::to_bits(want) || down.to_bits() != f32::to_bits(-want) {
            return Err(ArithmeticFault::RoundingChanged);
        }
    }
    Ok(())
}
