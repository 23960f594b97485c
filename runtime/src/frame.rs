//! One servo period's codes as the converters gave them, and what makes a code bad.

use serde::{Deserialize, Serialize};

/// In place of a code that could not be read. No converter gives it, and it lies below
/// every window of accepted codes, so a missing code is never decoded.
pub const MISSING_CODE: i32 = i32::MIN;

/// The largest magnitude of a code that the decoder accepts: 24 bits, signed, which `f32`
/// still holds exactly.
pub const CODE_MAGNITUDE_MAX: i32 = 1 << 23;

/// The codes of one servo period. Time and sequence arrive as data: the runtime reads
/// no clock.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[repr(C)]
pub struct RawFrame {
    /// Hall codes of the probes A, B, C.
    pub hall: [i32; 3],
    /// Capacitive codes of the gaps 1, 2, 3.
    pub capacitive: [i32; 3],
    /// Number of the servo period, wrapping.
    pub sequence: u32,
    /// When the codes were sampled, in us, wrapping (after 71 minutes).
    pub time_us: u32,
    /// Temperature of the magnets' mount and of the stage body at the Hall elements, in m degC,
    /// held from the last measurement; a missing code where there is none.
    pub temperature_mc: [i32; 2],
}

impl RawFrame {
    /// A frame without temperatures.
    #[inline(always)]
    pub const fn new(hall: [i32; 3], capacitive: [i32; 3], sequence: u32, time_us: u32) -> Self {
        Self {
            hall,
            capacitive,
            sequence,
            time_us,
            temperature_mc: [MISSING_CODE; 2],
        }
    }

    /// The same frame with the temperatures of mount and body, m degC.
    #[inline(always)]
    #[must_use]
    pub const fn with_temperature_mc(self, temperature_mc: [i32; 2]) -> Self {
        Self {
            temperature_mc,
            ..self
        }
    }
}

/// The codes that a sensor can plausibly give: both ends belong to it.
///
/// The narrowest sensible window leaves out the converter's two end codes, since a
/// saturated converter gives an end code for every larger signal.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[repr(C)]
pub struct CodeWindow {
    /// Smallest accepted code.
    pub low: i32,
    /// Largest accepted code.
    pub high: i32,
}

impl CodeWindow {
    /// All codes strictly between the converter's end codes, or `None` unless
    /// `-2^23 <= code_min < code_max - 1` and `code_max <= 2^23`.
    pub const fn between_rails(code_min: i32, code_max: i32) -> Option<Self> {
        if code_min < -CODE_MAGNITUDE_MAX
            || code_max > CODE_MAGNITUDE_MAX
            || code_min >= code_max - 1
        {
            return None;
        }
        Some(Self {
            low: code_min + 1,
            high: code_max - 1,
        })
    }

    /// Whether the window holds at least one code and only codes of up to 24 bits.
    pub const fn is_sound(&self) -> bool {
        -CODE_MAGNITUDE_MAX <= self.low && self.low <= self.high && self.high <= CODE_MAGNITUDE_MAX
    }

    /// How far the window's largest code lies above its smallest.
    pub const fn span(&self) -> u32 {
        self.high.wrapping_sub(self.low) as u32
    }

    /// Whether the code lies in the window: one subtraction and one comparison.
    #[inline(always)]
    pub const fn contains(&self, code: i32) -> bool {
        code.wrapping_sub(self.low) as u32 <= self.span()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const WINDOW: CodeWindow = CodeWindow {
        low: -32767,
        high: 32766,
    };

    #[test]
    fn the_rails_of_a_converter_lie_outside_its_window() {
        assert_eq!(CodeWindow::between_rails(-32768, 32767), Some(WINDOW));
        for (code, inside) in [
            (-32768, false),
            (-32767, true),
            (0, true),
            (32766, true),
            (32767, false),
            (i32::MAX, false),
            (MISSING_CODE, false),
        ] {
            assert_eq!(WINDOW.contains(code), inside, "{code}");
        }
    }

    #[test]
    fn a_window_beyond_24_bits_or_without_codes_is_refused() {
        assert_eq!(CodeWindow::between_rails(0, 1), None);
        assert_eq!(CodeWindow::between_rails(5, -5), None);
        assert_eq!(CodeWindow::between_rails(0, CODE_MAGNITUDE_MAX + 1), None);
        assert!(!CodeWindow { low: 3, high: 2 }.is_sound());
    }
}
