//! The absolute schedule: tick n is due n periods after the start, even after late ticks. A deadline of "now and a
//! period" would drift.

/// The servo period, us: `STAGE_PERIOD_US` in the environment of the build, or 2000. At least 1 ms, so that the frames of a
/// tick fit at 1 Mbit/s; at most 10 ms, half of the watchdog's period; a divisor of a second.
pub const PERIOD_US: u32 = match option_env!("STAGE_PERIOD_US") {
    Some(digits) => match u32::from_str_radix(digits, 10) {
        Ok(us) => us,
        Err(_) => 0,
    },
    None => 2000,
};
const _: () = assert!(
    PERIOD_US >= 1000 && PERIOD_US <= 10_000 && 1_000_000 % PERIOD_US == 0,
    "STAGE_PERIOD_US is to be 1000 to 10000, and a divisor of 1000000"
);

/// Ticks of a second.
pub const TICKS_PER_S: u32 = 1_000_000 / PERIOD_US;

/// A tick that starts later than this was sampled at the wrong time, us. An interrupt of this
/// program takes 0.15 ms, and 0.7 ms when it starts the converter again.
pub const LATE_US: u32 = 200;

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
    due_us: u32,
    sequence: u32,
    missed: u32,
}

impl Schedule {
    /// A schedule with its first tick one period after `now_us`.
    pub const fn starting(now_us: u32) -> Self {
        Self {
            due_us: now_us.wrapping_add(PERIOD_US),
            sequence: 0,
            missed: 0,
        }
    }

    /// When the next tick is due, us of the timer.
    pub const fn due_us(&self) -> u32 {
        self.due_us
    }

    /// Ticks that came more than [`LATE_US`] late or not at all. Saturates.
    pub const fn missed(&self) -> u32 {
        self.missed
    }

    /// The tick that starts at `now_us`, not before its due time. The ticks of whole periods since then are missed, and
    /// this is the latest tick.
    pub const fn start_tick(&mut self, now_us: u32) -> Tick {
        let skipped = now_us.wrapping_sub(self.due_us) / PERIOD_US;
        let due_us = self.due_us.wrapping_add(skipped.wrapping_mul(PERIOD_US));
        let late = now_us.wrapping_sub(due_us) > LATE_US;
        let sequence = self.sequence.wrapping_add(skipped);
        self.missed = self
            .missed
            .saturating_add(skipped)
            .saturating_add(late as u32);
        self.due_us = due_us.wrapping_add(PERIOD_US);
        self.sequence = sequence.wrapping_add(1);
        Tick {
            sequence,
            due_us,
            started_us: now_us,
        }
    }
}

impl Tick {
    /// Whether the tick that is done at `now_us` was done before the next one was due.
    pub const fn on_schedule(&self, now_us: u32) -> bool {
        now_us.wrapping_sub(self.due_us) < PERIOD_US
    }
}
