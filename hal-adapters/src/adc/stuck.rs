//! Codes that never change: a converter, or one of its channels, can freeze and still send valid
//! frames, and an amplifier can stop. The noise of a stage at rest rules that out.
//!
//! Each sensor is watched by itself. Its limit follows from the chance that noise alone repeats a
//! code while the stage is at rest for a year, 1.6e10 periods:
//!
//! | sensor | noise at rest, in the logs of three stages | repetitions, longest run in 171,000 rows | limit | false alarms a year, all three sensors |
//! |---|---|---|---|---|
//! | Hall probe | 12 codes of 16 bits | 2.4 %, 3 | 8 periods, 16 ms | 0.02 |
//! | gap | 0.83 codes of 16 bits | 34 %, 14 | 32 periods, 64 ms | 0.1 |
//!
//! 7 and 30 periods would do with exactly this noise; the limits allow for 35 % and 7 % less of it.
//! Codes of 24 bits repeat far less; the limits are the same. A code at a rail does not count as a
//! repetition: the decoder's window refuses that sensor at once, and the others can still be good.

use super::AdcError;
use runtime::RawFrame;

/// Repetitions of the code of a Hall probe that are a fault.
pub const HALL_PERIODS: u8 = 8;
/// Repetitions of the code of a gap that are a fault.
pub const GAP_PERIODS: u8 = 32;

/// Watches successive frames.
#[derive(Clone, Copy, Debug)]
pub struct StuckWatch {
    /// The code at the upper rail; the lower one is its complement.
    rail: i32,
    last: [i32; 6],
    unchanged: [u8; 6],
}

impl StuckWatch {
    /// A watch over codes of `code_bits`, 2 to 32, before its first frame.
    pub const fn new(code_bits: u32) -> Self {
        let rail = i32::MAX >> (32 - code_bits);
        Self {
            rail,
            // No repetition: rails do not count.
            last: [rail; 6],
            unchanged: [0; 6],
        }
    }

    /// Passes the frame on.
    ///
    /// # Errors
    /// [`AdcError::Stuck`] from the [`HALL_PERIODS`]th or [`GAP_PERIODS`]th repetition in a row of
    /// a sensor's code until it changes.
    pub fn pass<B>(&mut self, frame: RawFrame) -> Result<RawFrame, AdcError<B>> {
        let ([a, b, c], [d, e, f]) = (frame.hall, frame.capacitive);
        let codes = [a, b, c, d, e, f];
        for ((unchanged, last), code) in self.unchanged.iter_mut().zip(self.last).zip(codes) {
            let at_rail = code == self.rail || code == !self.rail;
            *unchanged = if code == last && !at_rail {
                unchanged.saturating_add(1)
            } else {
                0
            };
        }
        self.last = codes;
        for (channel, periods) in (0u8..).zip(self.unchanged) {
            let limit = if channel < 3 {
                HALL_PERIODS
            } else {
                GAP_PERIODS
            };
            if periods >= limit {
                return Err(AdcError::Stuck { channel, periods });
            }
        }
        Ok(frame)
    }
}

#[cfg(test)]
mod tests {
    extern crate std;

    use super::*;
    use std::vec::Vec;

    /// Runs of `periods` repetitions a year by normal noise of three sensors at rest. Their mean is in the middle of a code,
    /// where codes repeat most.
    fn false_alarms_a_year(deviation_codes: f64, periods: u8) -> f64 {
        const STEPS: i32 = 100;
        let density = |x: f64| {
            let z = x / deviation_codes;
            (-z * z / 2.0).exp() / (deviation_codes * std::f64::consts::TAU.sqrt())
        };
        let chance = |code: i32| {
            let at = |k: i32| f64::from(code) - 0.5 + (f64::from(k) + 0.5) / f64::from(STEPS);
            (0..STEPS).map(|k| density(at(k))).sum::<f64>() / f64::from(STEPS)
        };
        let chances: Vec<_> = (-100..=100).map(chance).collect();
        let run = |q: &f64| q.powi(i32::from(periods) + 1) * (1.0 - q);
        3.0 * 500.0 * 3600.0 * 24.0 * 365.0 * chances.iter().map(run).sum::<f64>()
    }

    #[test]
    fn noise_alone_is_a_fault_less_than_once_a_year() {
        let (hall, gap) = (12.0, 0.83);
        for (deviation, limit, least) in [(hall, HALL_PERIODS, 7), (gap, GAP_PERIODS, 30)] {
            let noted = if deviation == hall { 0.02 } else { 0.1 };
            let found = false_alarms_a_year(deviation, limit);
            assert!((found / noted - 1.0).abs() < 0.3, "{found}");
            assert!(false_alarms_a_year(deviation, least) < 1.0);
            assert!(false_alarms_a_year(deviation, least - 1) > 1.0);
            let quieter = deviation * if deviation == hall { 0.65 } else { 0.93 };
            let found = false_alarms_a_year(quieter, limit);
            assert!(found < 1.0, "{found}");
        }
    }

    fn frame(codes: [i32; 6], sequence: u32) -> RawFrame {
        let [a, b, c, d, e, f] = codes;
        RawFrame::new([a, b, c], [d, e, f], sequence, 0)
    }

    /// A frame of changing codes, but `channel` stays at `code`.
    fn only(channel: usize, code: i32, k: u32) -> RawFrame {
        let mut codes = [k as i32; 6];
        codes[channel] = code;
        frame(codes, k)
    }

    #[test]
    fn a_sensor_whose_codes_stay_the_same_is_a_fault_until_one_moves() {
        for channel in 0..6 {
            let mut watch = StuckWatch::new(16);
            let limit = u32::from(if channel < 3 {
                HALL_PERIODS
            } else {
                GAP_PERIODS
            });
            for k in 0..limit + 300 {
                let passed = watch.pass::<()>(only(channel, 7777, k));
                assert_eq!(passed.is_ok(), k < limit, "{channel} {k}");
                if let Err(AdcError::Stuck { channel: found, .. }) = passed {
                    assert_eq!(usize::from(found), channel);
                }
            }
            let moved = only(channel, 7778, 1);
            assert_eq!(watch.pass::<()>(moved), Ok(moved));
        }
    }

    #[test]
    fn a_sensor_at_a_rail_is_left_to_the_window_of_the_decoder() {
        for (bits, rails) in [(16, [-32_768, 32_767]), (24, [-8_388_608, 8_388_607])] {
            for rail in rails {
                let mut watch = StuckWatch::new(bits);
                assert!((0..300).all(|k| watch.pass::<()>(only(1, rail, k)).is_ok()));
                let inside = rail + if rail > 0 { -1 } else { 1 };
                assert!((0..300).any(|k| watch.pass::<()>(only(1, inside, k)).is_err()));
            }
        }
    }
}
