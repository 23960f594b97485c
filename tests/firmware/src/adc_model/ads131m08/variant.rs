//! What the sheet of the ADS131M08 leaves open.

use super::INITIAL_WAIT;

/// What the store does with a third conversion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Store {
    /// It is lost.
    KeepsOldest,
    /// The first one is lost.
    KeepsNewest,
    /// The second one is lost.
    ReplacesLast,
}

/// What the data sheet leaves open.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Variant {
    /// What a full store does.
    pub store: Store,
    /// A conversion leaves the store when its frame ends, and not when it begins.
    pub late_pop: bool,
    /// Conversions that are not settled are held back.
    pub gated: bool,
    /// From a resynchronisation until the filters take data, in periods of the modulators.
    pub wait: u64,
}

impl Variant {
    /// What the text of the sheet says most plainly.
    pub const PLAIN: Self = Self {
        store: Store::KeepsOldest,
        late_pop: false,
        gated: false,
        wait: 44,
    };

    /// All that are plausible: 44 is the offset in table 8-3 and equation 9, 300 the wait after
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
