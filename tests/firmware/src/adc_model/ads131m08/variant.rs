//! Behaviour of the ADS131M08 where its sheet is silent.

use super::INITIAL_WAIT;

/// The conversion that a full store loses when a third one ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Store {
    /// The third.
    KeepsOldest,
    /// The first.
    KeepsNewest,
    /// The second.
    ReplacesLast,
}

/// A behaviour.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Variant {
    /// The loss of a full store.
    pub store: Store,
    /// A conversion is removed when its frame ends, not when it begins.
    pub late_pop: bool,
    /// Unsettled conversions are held back.
    pub gated: bool,
    /// From a resynchronisation until the filters take data, in periods of the modulators.
    pub wait: u64,
}

impl Variant {
    /// The plainest reading of the sheet.
    pub const PLAIN: Self = Self {
        store: Store::KeepsOldest,
        late_pop: false,
        gated: false,
        wait: 44,
    };

    /// All plausible behaviours: 44 is the offset in table 8-3 and equation 9, 300 the wait after
    /// a reset.
    pub fn all() -> impl Iterator<Item = Self> {
        let stores = [Store::KeepsOldest, Store::KeepsNewest, Store::ReplacesLast];
        stores.into_iter().flat_map(|store| {
            [false, true].into_iter().flat_map(move |late_pop| {
                [false, true].into_iter().flat_map(move |gated| {
                    [0, 44, INITIAL_WAIT].into_iter().map(move |wait| Self {
                        store,
                        late_pop,
                        gated,
                        wait,
                    })
                })
            })
        })
    }
}
