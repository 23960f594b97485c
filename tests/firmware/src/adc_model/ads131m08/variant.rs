//! What the sheet of the ADS131M08 leaves open.

use super::INITIAL_WAIT;

/// Behaviour where the sheet is silent; times in periods of the modulators.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Variant {
    /// From a resynchronisation until the filters take data: none by 8.5.2, 44 by equation 9, 300 by table 8-3.
    pub wait: u64,
    /// From the last sample of a conversion until it is ready: the 44 of equation 9 may lie here.
    pub delay: u64,
    /// A conversion is removed when its frame ends, not when it begins.
    pub late_pop: bool,
}

impl Default for Variant {
    fn default() -> Self {
        Self::ALL[0]
    }
}

impl Variant {
    /// All plausible behaviours, the plainest first.
    pub const ALL: [Self; 8] = {
        let times = [(44, 0), (0, 0), (0, 44), (INITIAL_WAIT, 0)];
        let mut all = [Self {
            wait: 44,
            delay: 0,
            late_pop: false,
        }; 8];
        let mut k = 0;
        while k < 8 {
            let (wait, delay) = times[k / 2];
            all[k] = Self {
                wait,
                delay,
                late_pop: k % 2 == 1,
            };
            k += 1;
        }
        all
    };
}
