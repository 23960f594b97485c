//! Which blob is used, and which one before it.

use super::blobs::{Stored, plain, plain_by_age, stored, unusable};
use super::journal::{self, Place};
use super::{Check, Flash, Rejected, Sector, Store};
use runtime::blob::{BlobError, MAGIC};

impl Store {
    /// Looks at the sectors as they are and writes nothing: [`Store::begin`] then refuses.
    #[inline(never)]
    pub fn read(flash: &impl Flash, check: impl Into<Check>) -> Self {
        let mut store = Self {
            check: check.into(),
            newest: None,
            previous: None,
            passed_over: None,
            rejected: None,
            latest: 0,
            active: Sector::Second,
            writable: false,
            fault: None,
        };
        let highest = journal::highest_committed(flash, None);
        if let Some(place) = highest {
            (store.latest, store.active) = (place.sequence, place.sector());
        }
        let mut place = highest;
        for _ in 0..journal::UNITS {
            let Some((found, view)) = place.and_then(|at| Some((at, journal::view(flash, at)?)))
            else {
                break;
            };
            // In place of a suspect, nothing that was passed over before it.
            if store.check.suspect.is_some()
                && journal::is_passed_over(flash, found.sequence, view.blob())
            {
                place = journal::highest_committed(flash, place);
                continue;
            }
            let Some(error) = unusable(&view, &store.check) else {
                store.active = found.sector();
                store.passed_over = view.passed_over();
                store.newest = stored(flash, found);
                store.previous = store.before(flash, found);
                return store;
            };
            store.reject(found.sequence, found.sector(), error);
            place = journal::highest_committed(flash, place);
        }
        for sector in Sector::ALL {
            if let Some(Err(error)) = plain(flash, sector, &store.check) {
                store.reject(0, sector, error);
            }
        }
        let [newest, other] = plain_by_age(flash, &store.check);
        if let Some(newest) = newest {
            store.active = newest.sector;
            store.previous = other.filter(|other| other.blob(flash) != newest.blob(flash));
        }
        store.newest = newest;
        store
    }

    fn reject(&mut self, sequence: u32, sector: Sector, error: BlobError) {
        self.rejected.get_or_insert(Rejected {
            sequence,
            sector,
            error,
        });
    }

    /// The latest good blob before the record `newest` that differs from its blob and was not
    /// passed over. Looks at every record: for the start-up, which has the time.
    #[inline(never)]
    pub(super) fn before(&self, flash: &impl Flash, newest: Place) -> Option<Stored> {
        let blob = stored(flash, newest)?.blob(flash);
        let mut bound = newest;
        for _ in 0..journal::UNITS {
            let Some(place) = journal::highest_committed(flash, Some(bound)) else {
                break;
            };
            bound = place;
            // What was passed over is not even read.
            let good = stored(flash, place).filter(|other| {
                other.blob(flash) != blob
                    && !journal::is_passed_over(flash, place.sequence, other.blob(flash))
                    && journal::view(flash, place)
                        .is_some_and(|view| unusable(&view, &self.check).is_none())
            });
            if good.is_some() {
                return good;
            }
        }
        let plain = plain_by_age(flash, &self.check);
        plain
            .into_iter()
            .flatten()
            .find(|plain| plain.blob(flash) != blob)
    }

    /// The sectors that a start may erase, in the order in which it tries.
    pub(super) fn spares(&self, flash: &impl Flash) -> [Option<Sector>; 2] {
        if self.newest.is_some() {
            return [Some(self.active.other()), None];
        }
        let holds_no_blob = |sector: &Sector| !flash.bytes(*sector).starts_with(&MAGIC);
        if self.latest > 0 {
            return [Some(self.active.other()).filter(holds_no_blob), None];
        }
        let is_erased = |sector| flash.bytes(sector).iter().all(|byte| *byte == 0xff);
        let mut order = Sector::ALL;
        if !is_erased(Sector::First) && is_erased(Sector::Second) {
            order.reverse();
        }
        order.map(|sector| Some(sector).filter(holds_no_blob))
    }
}
