//! The frames of one tick, collected: what [`super::receiver`] and [`super::pose`] share.
//!
//! A group is two or three messages that are sent together, each once a tick, with the same
//! counter. The frames of a tick may come in any order. A tick is handed out when it is
//! complete, when a frame of a later tick comes, or when its time is over; frames that are
//! missing then stay missing.

use super::e2e::{Payload, Sequence, Verdict};
use super::notice::{BusFault, BusHealth, Taken, Timing, open};
use super::table::Message;

/// The most messages of a group.
const MESSAGES_MAX: usize = 3;

/// The frames of one tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct GroupTick {
    /// Number of the tick, counted by the receiver.
    pub(super) sequence: u32,
    /// When its first frame came, us.
    pub(super) time_us: u32,
    /// Bit k is set as long as frame k of the group did not come, or was not good.
    missing: u32,
    payloads: [Payload; MESSAGES_MAX],
}

impl GroupTick {
    const EMPTY: Self = Self {
        sequence: 0,
        time_us: 0,
        missing: 0,
        payloads: [Payload { short: 0, long: 0 }; MESSAGES_MAX],
    };

    /// The payload of frame `k`, if it came and was good.
    #[inline(always)]
    pub(super) fn payload(&self, k: usize) -> Option<Payload> {
        let payload = self.payloads.get(k)?;
        (self.missing >> k & 1 == 0).then_some(*payload)
    }
}

/// How long the source has been silent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Silence {
    /// No good frame yet.
    NotYet,
    /// The last good frame came then, us.
    Since(u32),
    /// Too long. Reported once.
    Stale,
}

/// Collects the frames of a group.
#[derive(Clone, Debug)]
pub(super) struct Group {
    timing: Timing,
    /// [`GroupTick::missing`] of a tick without frames.
    all_missing: u32,
    sequences: [Sequence; MESSAGES_MAX],
    is_started: bool,
    newest: u32,
    done: Option<u32>,
    is_open: bool,
    pending: GroupTick,
    /// The last tick that was handed out incomplete.
    over: GroupTick,
    silence: Silence,
    health: BusHealth,
}

/// Whether `limit_us` passed from `then` to `now`; false if the clock stepped back.
#[inline(always)]
const fn is_over(now: u32, then: u32, limit_us: u32) -> bool {
    now.wrapping_sub(then).wrapping_sub(limit_us) as i32 >= 0
}

/// Whether tick `a` comes after tick `b`.
const fn is_after(a: u32, b: u32) -> bool {
    a != b && a.wrapping_sub(b) <= u32::MAX / 2
}

impl Group {
    /// A group of `messages` messages, two or three.
    pub(super) const fn new(messages: usize, timing: Timing) -> Self {
        Self {
            timing,
            all_missing: (1 << messages) - 1,
            sequences: [Sequence::START; MESSAGES_MAX],
            is_started: false,
            newest: 0,
            done: None,
            is_open: false,
            pending: GroupTick::EMPTY,
            over: GroupTick::EMPTY,
            silence: Silence::NotYet,
            health: BusHealth::NONE,
        }
    }

    pub(super) const fn health(&self) -> &BusHealth {
        &self.health
    }

    pub(super) const fn is_stale(&self) -> bool {
        matches!(self.silence, Silence::Stale)
    }

    /// The tick nearest to the newest tick with a number that ends in `counter`.
    #[inline(always)]
    pub(super) const fn nearest(&self, counter: u8) -> u32 {
        if !self.is_started {
            return counter as u32;
        }
        let ahead = (counter as u32).wrapping_sub(self.newest) << 28;
        self.newest.wrapping_add((ahead as i32 >> 28) as u32)
    }

    /// Counts `ticks` ticks that were lost unnoticed.
    pub(super) const fn skip(&mut self, ticks: u32) {
        self.newest = self.newest.wrapping_add(ticks);
    }

    /// Notes a fault of the source and returns it.
    #[cold]
    #[inline(never)]
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
        make: impl Fn(&GroupTick) -> T,
    ) -> Taken<T> {
        if let Ok((counter, payload)) = open(message, data)
            && self.follow(k, counter, now_us)
        {
            self.note_good(now_us);
            if !self.is_open {
                self.newest = self.newest.wrapping_add(1);
                self.open(self.newest, now_us);
            }
            let tick = self.fill(k, payload).map(make);
            return Taken { tick, fault: None };
        }
        self.take_odd(k, message, data, now_us).map(make)
    }

    /// Whether a frame is the next one of its message and of a tick that still takes frames; if
    /// so, its counter is noted.
    #[inline(always)]
    fn follow(&mut self, k: usize, counter: u8, now_us: u32) -> bool {
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
    const fn note_good(&mut self, now_us: u32) {
        // Saturates, in fewer instructions than `saturating_add`.
        if let Some(good) = self.health.good.checked_add(1) {
            self.health.good = good;
        }
        self.silence = Silence::Since(now_us);
    }

    /// Takes any other frame: damaged, out of sequence, of another tick or of an expired one.
    #[cold]
    #[inline(never)]
    fn take_odd(
        &mut self,
        k: usize,
        message: Message,
        data: &[u8],
        now_us: u32,
    ) -> Taken<&GroupTick> {
        let (counter, payload) = match open(message, data) {
            Ok(opened) => opened,
            Err(fault) => return self.refuse(fault),
        };
        let Some(sequence) = self.sequences.get_mut(k) else {
            return Taken::NOTHING;
        };
        let verdict = sequence.judge(counter);
        let fault = verdict.fault(message).map(|fault| self.note(fault));
        if !verdict.is_used() {
            return Taken { tick: None, fault };
        }
        self.note_good(now_us);
        let mut tick = self.nearest(counter);
        if self.done.is_some_and(|done| !is_after(tick, done)) {
            if verdict != Verdict::Resumed {
                return self.refuse(BusFault::Late { message });
            }
            // After a break the sender continues with any counter. Numbers of ticks only rise.
            tick = tick.wrapping_add(16);
        }
        let mut ends = false;
        if self.is_open {
            // The counter of an expired tick returns 16 ticks later: such a frame is not its own.
            let expired = is_over(now_us, self.pending.time_us, self.timing.assembly_us);
            let same = self.pending.sequence == tick;
            let older = !same && !is_after(tick, self.pending.sequence);
            if expired || !(same || older) {
                self.hand_out();
                ends = true;
            }
            if older || (same && expired) {
                let fault = Some(self.note(BusFault::Late { message }));
                let tick = ends.then_some(&self.over);
                return Taken { tick, fault };
            }
        }
        self.newest = tick;
        self.is_started = true;
        if !self.is_open {
            self.open(tick, now_us);
        }
        // A group has at least two messages, so a tick that was just opened is not complete, and
        // at most one tick is handed out.
        let tick = if ends {
            self.fill(k, payload);
            Some(&self.over)
        } else {
            self.fill(k, payload)
        };
        Taken { tick, fault }
    }

    #[inline(always)]
    const fn open(&mut self, tick: u32, now_us: u32) {
        self.is_open = true;
        self.pending.sequence = tick;
        self.pending.time_us = now_us;
        self.pending.missing = self.all_missing;
    }

    /// Puts a payload into the open tick, and hands the tick out if that completes it.
    #[inline(always)]
    fn fill(&mut self, k: usize, payload: Payload) -> Option<&GroupTick> {
        if let Some(slot) = self.pending.payloads.get_mut(k) {
            *slot = payload;
        }
        self.pending.missing &= !(1 << k);
        if self.pending.missing != 0 {
            return None;
        }
        self.is_open = false;
        self.done = Some(self.pending.sequence);
        Some(&self.pending)
    }

    fn refuse(&mut self, fault: BusFault) -> Taken<&GroupTick> {
        Taken {
            tick: None,
            fault: Some(self.note(fault)),
        }
    }

    /// Hands out the pending tick, complete or not.
    #[cold]
    fn hand_out(&mut self) {
        self.is_open = false;
        self.done = Some(self.pending.sequence);
        self.health.incomplete = self.health.incomplete.saturating_add(1);
        self.over = self.pending;
    }

    /// Lets time pass: gives an overdue tick, and reports a stale source.
    pub(super) fn poll(&mut self, now_us: u32) -> Taken<&GroupTick> {
        let mut fault = None;
        if let Silence::Since(last) = self.silence
            && is_over(now_us, last, self.timing.stale_us)
        {
            self.silence = Silence::Stale;
            let age_us = now_us.wrapping_sub(last);
            fault = Some(self.note(BusFault::Stale { age_us }));
        }
        let ends = self.is_open && is_over(now_us, self.pending.time_us, self.timing.assembly_us);
        if ends {
            self.hand_out();
        }
        let tick = ends.then_some(&self.over);
        Taken { tick, fault }
    }

    /// When [`Group::poll`] will have something to report if no frame comes before.
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
