//! Which conversion a frame carries, by the times of conversions and frames alone.
//!
//! The part stores two conversions and hands out the older first. The sheet does not say which conversion a full store
//! loses, nor whether a frame removes its conversion when it begins or when it ends. So after a loss both stored
//! conversions count as unknown, and a conversion that ends during a frame is only followed if the store had room for
//! it either way.

use super::Frame;

/// Difference of two times of one event at most, us: a clock of 1 us, an edge and a frame by different hardware.
const MARGIN_US: u32 = 3;
/// A sample takes no longer, us.
const LONGEST_US: u32 = 1_000_000;
/// Conversions that the part stores.
const ROOM: u32 = 2;

/// Conversion `n` ends `n` periods after the edge.
#[derive(Clone, Copy, Debug)]
pub(super) struct Conversions {
    edge_us: u32,
    period_ns: u32,
    /// Number of the next conversion that ends.
    next: u32,
    /// Stored conversions that are not known.
    unknown: u32,
    /// Stored conversions that are known, behind the unknown ones: the last ones before `next`.
    known: u32,
    /// Whether an event was not followed: no frame carries a known conversion any more.
    pub(super) is_lost: bool,
}

impl Conversions {
    /// At the edge of conversion 0. The store has been full.
    pub(super) const fn after(edge_us: u32, period_ns: u32) -> Self {
        Self {
            edge_us,
            period_ns,
            next: 1,
            unknown: ROOM,
            known: 0,
            is_lost: false,
        }
    }

    /// Without an edge no conversion is known.
    pub(super) const LOST: Self = Self {
        is_lost: true,
        ..Self::after(0, 0)
    };

    /// When a conversion ends, us.
    pub(super) const fn end_us(&self, number: u32) -> u32 {
        let after_us = number.wrapping_mul(self.period_ns) / 1000;
        self.edge_us.wrapping_add(after_us)
    }

    /// Until when a frame of `frame_us` that would begin at `now_us` has to wait, because a conversion would end during it
    /// while the store is full.
    pub(super) fn wait_until_us(&mut self, now_us: u32, frame_us: u32) -> Option<u32> {
        self.store_until(now_us.wrapping_sub(MARGIN_US));
        let to_us = now_us.wrapping_add(frame_us);
        let meets = !self.is_lost
            && self.is_full()
            && self.has_ended(self.next, to_us.wrapping_add(MARGIN_US));
        meets.then(|| self.end_us(self.next).wrapping_add(MARGIN_US))
    }

    /// The conversion that a frame carries, if it is known. `is_ready`: the frame says that it
    /// carries one.
    pub(super) fn read(&mut self, frame: &Frame, is_ready: bool) -> Option<u32> {
        let (from_us, to_us) = (frame.from_us, frame.to_us);
        self.store_until(from_us.wrapping_sub(MARGIN_US));
        let latest_us = to_us.wrapping_add(MARGIN_US);
        let is_empty = self.unknown + self.known == 0;
        self.is_lost |= self.has_ended(self.next, latest_us) && self.is_full()
            || self.has_ended(self.next + 1, latest_us)
            || !is_ready && !is_empty;
        if self.is_lost || !is_ready {
            return None;
        }
        if is_empty {
            // It has just ended.
            self.is_lost = !self.has_ended(self.next, from_us.wrapping_add(MARGIN_US));
            self.next += 1;
            return (!self.is_lost).then_some(self.next - 1);
        }
        if self.unknown > 0 {
            self.unknown -= 1;
            return None;
        }
        self.known -= 1;
        Some(self.next - self.known - 1)
    }

    const fn is_full(&self) -> bool {
        self.unknown + self.known >= ROOM
    }

    const fn has_ended(&self, number: u32, us: u32) -> bool {
        us.wrapping_sub(self.end_us(number)) as i32 >= 0
    }

    /// Stores the conversions that have ended by then.
    fn store_until(&mut self, us: u32) {
        let since_us = (us.wrapping_sub(self.edge_us) as i32).max(0) as u32;
        // Numbers and times stay within their words.
        self.is_lost |= since_us > LONGEST_US;
        while !self.is_lost && self.has_ended(self.next, us) {
            if self.is_full() {
                (self.unknown, self.known) = (ROOM, 0);
            } else {
                self.known += 1;
            }
            self.next += 1;
        }
    }
}
