//! What a debugger reads while the program runs: the static `STAGE`, by its symbol. State, faults and
//! the other counters are in the status and health frames.
//!
//! In gdb: `print STAGE`. `STAGE.pose` holds the decoder's words unchanged: the bits of six
//! `float`s, X, Y, Rz, Z, Rx, Ry in m and rad. `updates` is odd while the words change and even
//! when they belong together.

use core::sync::atomic::{AtomicU32, Ordering::Relaxed, Ordering::Release, compiler_fence};
use runtime::Reading;

/// The words of `STAGE`.
#[derive(Debug)]
#[repr(C)]
pub struct Telemetry {
    updates: AtomicU32,
    sequence: AtomicU32,
    time_us: AtomicU32,
    status: AtomicU32,
    pose: [AtomicU32; 6],
    /// See [`Ended::counters`].
    counters: [AtomicU32; 7],
    /// Time that the last tick took from its start to its end, and the longest, us.
    last_us: AtomicU32,
    longest_us: AtomicU32,
}

#[allow(clippy::declare_interior_mutable_const)] // only to fill arrays
const ZERO: AtomicU32 = AtomicU32::new(0);

/// The last pose and the counters. The name is the symbol's, so that any debugger finds it.
// SAFETY: no other symbol of this program has this name.
#[unsafe(no_mangle)]
pub static STAGE: Telemetry = Telemetry {
    updates: ZERO,
    sequence: ZERO,
    time_us: ZERO,
    status: ZERO,
    pose: [ZERO; 6],
    counters: [ZERO; 7],
    last_us: ZERO,
    longest_us: ZERO,
};

/// The result of a tick.
#[derive(Clone, Copy, Debug)]
pub struct Ended {
    /// Number of the tick.
    pub sequence: u32,
    /// When it started, us.
    pub time_us: u32,
    /// What it read.
    pub reading: Reading,
    /// Ticks that were not done before the next one was due; ticks without codes, and how often the
    /// converter was started; frames handed to a mailbox, those discarded because newer ones followed,
    /// and times that a received one found no room; ticks in which the FPU's settings had been changed.
    pub counters: [u32; 7],
}

impl Telemetry {
    /// Notes a tick.
    pub fn put(&self, ended: &Ended) {
        self.updates
            .store(self.updates.load(Relaxed).wrapping_add(1), Relaxed);
        compiler_fence(Release);
        self.sequence.store(ended.sequence, Relaxed);
        self.time_us.store(ended.time_us, Relaxed);
        self.status.store(ended.reading.status.bits(), Relaxed);
        let (p, v) = (ended.reading.pose.planar, ended.reading.pose.vertical);
        let pose = [p.x_m, p.y_m, p.rz_rad, v.z_m, v.rx_rad, v.ry_rad];
        for (to, from) in self.pose.iter().zip(pose) {
            to.store(from.to_bits(), Relaxed);
        }
        for (to, from) in self.counters.iter().zip(ended.counters) {
            to.store(from, Relaxed);
        }
        compiler_fence(Release);
        self.updates
            .store(self.updates.load(Relaxed).wrapping_add(1), Relaxed);
    }

    /// Notes how long a tick took.
    pub fn put_duration(&self, us: u32) {
        self.last_us.store(us, Relaxed);
        if us > self.longest_us.load(Relaxed) {
            self.longest_us.store(us, Relaxed);
        }
    }
}
