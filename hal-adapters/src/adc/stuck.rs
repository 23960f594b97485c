//! Codes that never change. A converter can freeze and still send valid frames. Noise tells a
//! stage at rest from a frozen converter: 0.5 um of Hall noise are eight codes of 16 bits, so
//! all six codes of a working stage repeat once in about half a million periods.

use super::AdcError;
use runtime::RawFrame;

/// So many periods without any change are a fault. Noise alone does it once in 10^45 periods.
pub const STUCK_PERIODS: u8 = 8;

/// Watches successive frames.
#[derive(Clone, Copy, Debug, Default)]
pub struct StuckWatch {
    last: Option<([i32; 3], [i32; 3])>,
    unchanged: u8,
}

impl StuckWatch {
    /// A watch that has seen no frame.
    pub const NEW: Self = Self {
        last: None,
        unchanged: 0,
    };

    /// Passes the frame on.
    ///
    /// # Errors
    /// [`AdcError::Stuck`] from the [`STUCK_PERIODS`]th repetition in a row until a code changes.
    pub fn pass<B>(&mut self, frame: RawFrame) -> Result<RawFrame, AdcError<B>> {
        let codes = (frame.hall, frame.capacitive);
        self.unchanged = if self.last == Some(codes) {
            self.unchanged.saturating_add(1)
        } else {
            0
        };
        self.last = Some(codes);
        if self.unchanged >= STUCK_PERIODS {
            let periods = self.unchanged;
            return Err(AdcError::Stuck { periods });
        }
        Ok(frame)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_that_stay_the_same_are_a_fault_until_one_moves() {
        let mut watch = StuckWatch::NEW;
        let frame = |code, sequence| RawFrame {
            hall: [1, 2, code],
            capacitive: [3, 4, 5],
            sequence,
            time_us: 0,
        };
        for k in 0..=u32::from(STUCK_PERIODS) + 300 {
            let passed = watch.pass::<()>(frame(7, k));
            assert_eq!(passed.is_ok(), k < u32::from(STUCK_PERIODS), "{k}");
        }
        assert_eq!(watch.pass::<()>(frame(8, 0)), Ok(frame(8, 0)));
        assert_eq!(watch.pass::<()>(frame(8, 1)), Ok(frame(8, 1)));
    }
}
