//! Frames of one tick, collected: what [`super::receiver`] and [`super::pose`] share.
//!
//! A group is a set of messages that are sent together, each once a tick, with the same
//! counter. Frames may come in any order within a tick. A tick is handed out as soon as it
//! is complete, when a frame of a later tick comes, or when its time is over; what is
//! missing then is missing.

use super::e2e::{Payload, Sequence, Verdict, unprotect};
use super::notice::{BusFault, BusHealth, Taken, Timing};
use super::table::{FRAME_BYTES, Message};

/// The frames of one tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct GroupTick<const N: usize> {
    /// Number of the tick, counted by the receiver.
    pub(super) sequence: u32,
    /// When its first frame came, us.
    pub(super) time_us: u32,
    /// Bit k is set if frame k of the group came and was good.
    came: u32,
    payloads: [Payload; N],
}

impl<const N: usize> GroupTick<N> {
    const ALL: u32 = (1 << N) - 1;

    /// The payload of frame `k`, if it came and was good.
    #[inline(always)]
    pub(super) fn payload(&self, k: usize) -> Option<Payload> {
        let payload = self.payloads.get(k)?;
        (self.came >> k & 1 == 1).then_some(*payload)
    }

    #[inline(always)]
    const fn is_whole(&self) -> bool {
        self.came == Self::ALL
    }
}

/// How long the source has been silent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Silence {
    /// No good frame yet.
    NotYet,
    /// The last good frame came then, us.
    Since(u32),
    /// Too long: told once.
    Stale,
}

/// Collects the frames of `N` messages.
#[derive(Clone, Debug)]
pub(super) struct Group<const N: usize> {
    timing: Timing,
    sequences: [Sequence; N],
    is_started: bool,
    newest: u32,
    done: Option<u32>,
    is_open: bool,
    pending: GroupTick<N>,
    silence: Silence,
    health: BusHealth,
}

/// Whether `limit_us` passed between `then` and `now`; not if the clock stepped back.
#[inline(always)]
const fn is_over(now: u32, then: u32, limit_us: u32) -> bool {
    now.wrapping_sub(then).wrapping_sub(limit_us) as i32 >= 0
}

/// Whether tick `a` comes after tick `b`.
const fn is_after(a: u32, b: u32) -> bool {
    a != b && a.wrapping_sub(b) <= u32::MAX / 2
}

impl<const N: usize> Group<N> {
    pub(super) const fn new(timing: Timing) -> Self {
        Self {
            timing,
            sequences: [Sequence::START; N],
            is_started: false,
            newest: 0,
            done: None,
            is_open: false,
            pending: GroupTick {
                sequence: 0,
                time_us: 0,
                came: 0,
                payloads: [Payload { short: 0, long: 0 }; N],
            },
            silence: Silence::NotYet,
            health: BusHealth {
                good: 0,
                wrong_length: 0,
                wrong_check: 0,
                repeated: 0,
                wrong_sequence: 0,
                lost: 0,
                late: 0,
                incomplete: 0,
                stale: 0,
            },
        }
    }

    pub(super) const fn health(&self) -> &BusHealth {
        &self.health
    }

    pub(super) const fn is_stale(&self) -> bool {
        matches!(self.silence, Silence::Stale)
    }

    /// The tick whose number ends in `counter` and is nearest to the newest one.
    #[inline(always)]
    pub(super) const fn nearest(&self, counter: u8) -> u32 {
        if !self.is_started {
            return counter as u32;
        }
        let ahead = (counter as u32).wrapping_sub(self.newest) << 28;
        self.newest.wrapping_add((ahead as i32 >> 28) as u32)
    }

    /// Counts `ticks` ticks that no frame told of.
    pub(super) const fn skip(&mut self, ticks: u32) {
        self.newest = self.newest.wrapping_add(ticks);
    }

    /// Notes a fault of the source and returns it.
    pub(super) fn note(&mut self, fault: BusFault) -> BusFault {
        self.health.count(&fault);
        fault
    }

    /// Takes one frame of the group's `k`th message, which is `message`; `make` turns a tick
    /// that is over into what the caller wants of it.
    #[inline(always)]
    pub(super) fn take<T>(
        &mut self,
        k: usize,
        message: Message,
        data: &[u8],
        now_us: u32,
        make: impl Fn(&GroupTick<N>) -> T,
    ) -> Taken<T> {
        let bytes = match data.first_chunk::<FRAME_BYTES>() {
            Some(bytes) if data.len() == FRAME_BYTES => bytes,
            _ => {
                let bytes = data.len() as u8;
                return self.refuse(BusFault::WrongLength { message, bytes });
            }
        };
        let Some((counter, payload)) = unprotect(message.spec().key, bytes) else {
            return self.refuse(BusFault::WrongCheck { message });
        };
        if !self.is_due(k, counter, now_us) {
            return self.take_odd(k, message, (counter, payload), now_us, make);
        }
        self.is_good(now_us);
        if !self.is_open {
            self.newest = self.newest.wrapping_add(1);
            self.open(self.newest, now_us);
        }
        Taken {
            tick: self.fill(k, payload, make),
            fault: None,
        }
    }

    /// Whether a counter is the one that is due, of a tick that can be taken; if so it is
    /// noted. Anything else is left to [`Group::take_odd`].
    #[inline(always)]
    fn is_due(&mut self, k: usize, counter: u8, now_us: u32) -> bool {
        let tick = if self.is_open {
            if is_over(now_us, self.pending.time_us, self.timing.assembly_us) {
                return false;
            }
            self.pending.sequence
        } else {
            self.newest.wrapping_add(1)
        };
        let fits = tick & 0xf == u32::from(counter);
        fits && self.sequences.get_mut(k).is_some_and(|s| s.follow(counter))
    }

    /// Notes that a good frame came.
    #[inline(always)]
    const fn is_good(&mut self, now_us: u32) {
        // As a saturating addition, without writing what stays.
        if let Some(good) = self.health.good.checked_add(1) {
            self.health.good = good;
        }
        self.silence = Silence::Since(now_us);
    }

    /// A frame whose check held, but which is not the one that is due.
    #[cold]
    #[inline(never)]
    fn take_odd<T>(
        &mut self,
        k: usize,
        message: Message,
        (counter, payload): (u8, Payload),
        now_us: u32,
        make: impl Fn(&GroupTick<N>) -> T,
    ) -> Taken<T> {
        let Some(sequence) = self.sequences.get_mut(k) else {
            return Taken::NOTHING;
        };
        let verdict = sequence.judge(counter);
        let fault = match verdict {
            Verdict::Repeated => return self.refuse(BusFault::Repeated { message }),
            Verdict::WrongSequence { ahead } => {
                return self.refuse(BusFault::WrongSequence { message, ahead });
            }
            Verdict::Lost { frames } => Some(self.note(BusFault::Lost { message, frames })),
            Verdict::First | Verdict::Next | Verdict::Resumed => None,
        };
        self.is_good(now_us);
        let mut tick = self.nearest(counter);
        if self.done.is_some_and(|done| !is_after(tick, done)) {
            if verdict != Verdict::Resumed {
                return self.refuse(BusFault::Late { message });
            }
            // After a break the sender goes on from anywhere: on with the numbers, never back.
            tick = tick.wrapping_add(16);
        }
        let mut over = None;
        if self.is_open {
            // A tick whose time is over takes no more frames: 16 ticks on, its counter returns.
            let expired = is_over(now_us, self.pending.time_us, self.timing.assembly_us);
            let same = self.pending.sequence == tick;
            let older = !same && !is_after(tick, self.pending.sequence);
            if expired || !(same || older) {
                over = self.hand_out(&make);
            }
            if older || (same && expired) {
                let fault = Some(self.note(BusFault::Late { message }));
                return Taken { tick: over, fault };
            }
        }
        self.newest = tick;
        self.is_started = true;
        if !self.is_open {
            self.open(tick, now_us);
        }
        // A group has two messages at least, so a tick that was just opened is not whole.
        let whole = self.fill(k, payload, make);
        Taken {
            tick: over.or(whole),
            fault,
        }
    }

    #[inline(always)]
    const fn open(&mut self, tick: u32, now_us: u32) {
        self.is_open = true;
        self.pending.sequence = tick;
        self.pending.time_us = now_us;
        self.pending.came = 0;
    }

    /// Puts a payload into the open tick, and hands the tick out if it is whole by it.
    #[inline(always)]
    fn fill<T>(
        &mut self,
        k: usize,
        payload: Payload,
        make: impl Fn(&GroupTick<N>) -> T,
    ) -> Option<T> {
        if let Some(slot) = self.pending.payloads.get_mut(k) {
            *slot = payload;
        }
        self.pending.came |= 1 << k;
        if !self.pending.is_whole() {
            return None;
        }
        self.is_open = false;
        self.done = Some(self.pending.sequence);
        Some(make(&self.pending))
    }

    #[cold]
    #[inline(never)]
    fn refuse<T>(&mut self, fault: BusFault) -> Taken<T> {
        Taken {
            tick: None,
            fault: Some(self.note(fault)),
        }
    }

    /// Hands out the pending tick, whole or not.
    #[cold]
    fn hand_out<T>(&mut self, make: impl Fn(&GroupTick<N>) -> T) -> Option<T> {
        self.is_open = false;
        self.done = Some(self.pending.sequence);
        self.health.incomplete = self.health.incomplete.saturating_add(1);
        Some(make(&self.pending))
    }

    /// What the passing of time gives: a tick whose time is over, a source that is stale.
    pub(super) fn poll<T>(&mut self, now_us: u32, make: impl Fn(&GroupTick<N>) -> T) -> Taken<T> {
        let mut taken = Taken::NOTHING;
        if self.is_open && is_over(now_us, self.pending.time_us, self.timing.assembly_us) {
            taken.tick = self.hand_out(make);
        }
        if let Silence::Since(last) = self.silence
            && is_over(now_us, last, self.timing.stale_us)
        {
            self.silence = Silence::Stale;
            let age_us = now_us.wrapping_sub(last);
            taken.fault = Some(self.note(BusFault::Stale { age_us }));
        }
        taken
    }

    /// When [`Group::poll`] has something to say at the latest, if no frame comes.
    pub(super) fn deadline_us(&self) -> Option<u32> {
        if self.is_open {
            return Some(self.pending.time_us.wrapping_add(self.timing.assembly_us));
        }
        match self.silence {
            Silence::Since(last) => Some(last.wrapping_add(self.timing.stale_us)),
            Silence::NotYet | Silence::Stale => None,
        }
    }
}
