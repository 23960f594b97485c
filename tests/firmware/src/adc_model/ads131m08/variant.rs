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
        Self {
            wait: 44,
            delay: 0,
            late_pop: false,
        }
    }
}

impl Variant {
    /// All plausible behaviours, the plainest first.
    pub fn all() -> impl Iterator<Item = Self> {
        let times = [(44, 0), (0, 0), (0, 44), (INITIAL_WAIT, 0)].into_iter();
        times.flat_map(|(wait, delay)| {
            [false, true].map(|late_pop| Self {
                wait,
                delay,
                late_pop,
            })
        })
    }
}
