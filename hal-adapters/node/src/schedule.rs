//! The absolute schedule: tick n is due n periods after the start, even after late ticks. A deadline of "now and a
//! period" would drift.

use core::num::NonZeroU32;

/// A tick that starts later than this was sampled at the wrong time, us. An interrupt of the
/// controller takes 0.15 ms, and 0.7 ms when it starts the converter again.
pub const LATE_US: u32 = 200;

/// The servo period.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Period {
    us: NonZeroU32,
    ticks_per_s: NonZeroU32,
}

impl Period {
    /// From us: 1000 or more, so that the frames of a tick fit at 1 Mbit/s; 10,000 or less; a divisor of a second.
    pub const fn from_us(us: u32) -> Option<Self> {
        if us < 1000 || us > 10_000 || !1_000_000_u32.is_multiple_of(us) {
            return None;
        }
        match (NonZeroU32::new(us), NonZeroU32::new(1_000_000 / us)) {
            (Some(us), Some(ticks_per_s)) => Some(Self { us, ticks_per_s }),
            _ => None,
        }
    }

    /// In us.
    pub const fn us(self) -> u32 {
        self.us.get()
    }

    /// Ticks of a second.
    pub const fn ticks_per_s(self) -> u32 {
        self.ticks_per_s.get()
    }

    /// Ticks of this time.
    pub fn ticks_in_ms(self, ms: u32) -> u32 {
        ms * 1000 / self.us
    }

    /// Where a tick lies in its second, ms.
    pub fn ms_in_second(self, tick: u32) -> u32 {
        tick % self.ticks_per_s * self.us() / 1000
    }
}

/// One tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Tick {
    /// Its number, wrapping. Numbers of missed ticks are left out.
    pub sequence: u32,
    /// When it was due, us of the timer.
    pub due_us: u32,
    /// When it started, us of the timer.
    pub started_us: u32,
}

/// Gives each tick its number and counts those that were missed.
#[derive(Clone, Copy, Debug)]
pub struct Schedule {
    period: Period,
    due_us: u32,
    sequence: u32,
    /// Ticks that came more than [`LATE_US`] late or not at all. Saturates.
    pub missed: u32,
}

impl Schedule {
    /// A schedule with its first tick one period after `now_us`.
    pub const fn starting(now_us: u32, period: Period) -> Self {
        Self {
            period,
            due_us: now_us.wrapping_add(period.us()),
            sequence: 0,
            missed: 0,
        }
    }

    /// When the next tick is due, us of the timer.
    pub const fn due_us(&self) -> u32 {
        self.due_us
    }

    /// The tick that starts at `now_us`, not before its due time. The ticks of whole periods since then are missed, and
    /// this is the latest tick.
    pub fn start_tick(&mut self, now_us: u32) -> Tick {
        let skipped = now_us.wrapping_sub(self.due_us) / self.period.us;
        let due_us = (self.due_us).wrapping_add(skipped.wrapping_mul(self.period.us()));
        let late = now_us.wrapping_sub(due_us) > LATE_US;
        let sequence = self.sequence.wrapping_add(skipped);
        self.missed = (self.missed.saturating_add(skipped)).saturating_add(late.into());
        self.due_us = due_us.wrapping_add(self.period.us());
        self.sequence = sequence.wrapping_add(1);
        Tick {
            sequence,
            due_us,
            started_us: now_us,
        }
    }

    /// Whether a tick that is done at `now_us` was done before the next one was due.
    pub const fn is_kept(&self, tick: &Tick, now_us: u32) -> bool {
        now_us.wrapping_sub(tick.due_us) < self.period.us()
    }
}
