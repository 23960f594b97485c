//! How the sensitivity follows temperature: one factor for each probe, in every model.
//!
//! M is the temperature of the magnets' mount and H the temperature of the stage body at the Hall
//! elements. dM and dH are their distances from T0, the temperature of the calibration:
//!
//! G_i = 1 + k_i dM + h_i dH, and phi_i becomes G_i phi_i.
//!
//! Magnets lose about 0.11 % of their field per kelvin, and Hall elements have a gain of their
//! own. Frames carry temperatures in m degC: dM and dH are differences of whole numbers, and at
//! dM = dH = 0 the factor is exactly 1.

use crate::real::Real;

/// k, h and T0 of a stage.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(C)]
pub struct Temperature<T> {
    /// (k, h) of the probes A, B, C: change of G with dM and dH, 1/mK.
    pub per_mk: [[T; 2]; 3],
    /// T0 of mount and body, m degC.
    pub zero_mc: [i32; 2],
    /// Largest |dM| and |dH| that is plausible, mK; 0 where the stage has no such sensor.
    pub reach_mk: [u32; 2],
}

impl<T: Real> Temperature<T> {
    /// A stage without sensors: G = 1.
    pub const NONE: Self = Self {
        per_mk: [[T::ZERO; 2]; 3],
        zero_mc: [0; 2],
        reach_mk: [0; 2],
    };

    /// Default of `reach_mk`: three times the warming of a stage in service. Farther off a linear
    /// gain no longer holds, and a sensor is more likely broken.
    pub const REACH_MK: u32 = 30_000;

    /// Whether the stage has a sensor.
    #[inline(always)]
    pub const fn is_used(&self) -> bool {
        self.reach_mk[0] | self.reach_mk[1] != 0
    }

    /// dM and dH, mK: both 0 if one is missing or implausible; and all ones if one is, else 0. Of a
    /// sensor that the stage lacks it is any number.
    #[inline(always)]
    pub(crate) fn changes_mk(&self, temperature_mc: [i32; 2]) -> ([i32; 2], u32) {
        let mount = temperature_mc[0].wrapping_sub(self.zero_mc[0]);
        let body = temperature_mc[1].wrapping_sub(self.zero_mc[1]);
        let bad = beyond(mount, self.reach_mk[0]) | beyond(body, self.reach_mk[1]);
        ([mount & !bad, body & !bad], bad.cast_unsigned())
    }

    /// Whether each sensor that the stage has reads a temperature that may be true, m degC.
    pub fn is_plausible(&self, temperature_mc: [i32; 2]) -> bool {
        self.changes_mk(temperature_mc).1 == 0
    }

    /// dM and dH in K, as [`Temperature::gain_at`] takes them; 0 of a sensor that the stage lacks.
    pub fn changes_k(&self, temperature_mc: [i32; 2]) -> [f64; 2] {
        let changes_mk = self.changes_mk(temperature_mc).0;
        [0, 1].map(|sensor| match self.reach_mk[sensor] {
            0 => 0.0,
            _ => f64::from(changes_mk[sensor]) * 1e-3,
        })
    }

    /// G - 1 of the probes A, B, C at dM and dH, mK.
    #[inline(always)]
    pub(crate) fn gain_change(&self, [mount, body]: [T; 2]) -> [T; 3] {
        let [a, b, c] = &self.per_mk;
        let of = |[k, h]: &[T; 2]| *k * mount + *h * body;
        [of(a), of(b), of(c)]
    }

    /// G of the probes A, B, C at temperatures of mount and body, m degC; a missing or implausible
    /// one counts as T0.
    pub fn gain_at(&self, temperature_mc: [i32; 2]) -> [T; 3] {
        let changes_mk = self.changes_mk(temperature_mc).0;
        let change = self.gain_change(changes_mk.map(T::from_code));
        change.map(|change| T::ONE + change)
    }

    /// Each coefficient as another type of number, rounded to the nearest.
    #[must_use]
    pub fn rounded<U: Real>(&self) -> Temperature<U> {
        Temperature {
            per_mk: self.per_mk.map(|row| row.map(|x| U::from_f64(x.to_f64()))),
            zero_mc: self.zero_mc,
            reach_mk: self.reach_mk,
        }
    }
}

/// All ones if a change lies beyond -reach..reach, mK, else 0: the borrow of one subtraction. The compiler
/// turns a mask from a comparison into a choice between numbers, and the tick has no registers left for it.
/// For a reach of 0 the limit wraps to the largest number, which nothing is beyond.
#[inline(always)]
const fn beyond(change_mk: i32, reach_mk: u32) -> i32 {
    // |change|, or one less if it is negative.
    let size = (change_mk ^ change_mk >> 31).cast_unsigned();
    ((reach_mk.wrapping_sub(1) as u64).wrapping_sub(size as u64) >> 32) as i32
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::MISSING_CODE;

    const STAGE: Temperature<f32> = Temperature {
        per_mk: [[-1.2e-6, 1e-8], [-1.1e-6, 2e-8], [-1.3e-6, 3e-8]],
        zero_mc: [20_000, 21_000],
        reach_mk: [30_000, 30_000],
    };

    #[test]
    fn a_temperature_that_is_missing_or_beyond_reach_counts_as_no_change_and_is_reported() {
        for (mount, change, fault) in [
            (20_000, 0, false),
            (25_000, 5_000, false),
            (-10_000, -30_000, false),
            (-10_001, 0, true),
            (49_999, 29_999, false),
            (50_000, 0, true),
            (i32::MAX, 0, true),
            (MISSING_CODE, 0, true),
        ] {
            let body = if fault { 0 } else { 100 };
            let bad = u32::from(fault).wrapping_neg();
            assert_eq!(STAGE.changes_mk([mount, 21_100]), ([change, body], bad));
        }
    }

    #[test]
    fn a_sensor_that_the_stage_lacks_is_never_missed() {
        for code in [0, 5, MISSING_CODE, i32::MAX, -1] {
            let none = Temperature::<f32>::NONE;
            assert_eq!(none.changes_mk([code; 2]).1, 0);
            assert_eq!(none.changes_k([code; 2]), [0.0; 2]);
            assert_eq!(none.gain_at([code; 2]), [1.0; 3]);
        }
    }

    #[test]
    fn the_gain_is_one_at_t0_and_follows_both_temperatures() {
        assert_eq!(STAGE.gain_at([20_000, 21_000]), [1.0; 3]);
        let [a, ..] = STAGE.gain_at([25_000, 19_000]);
        assert!((a - (1.0 - 0.006 - 2e-5)).abs() < 1e-7, "{a}");
    }
}
