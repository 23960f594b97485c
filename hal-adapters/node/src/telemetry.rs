//! The static `STAGE` for a debugger. State, faults and the other counters are in the status and health
//! frames.
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
    /// Overrun ticks; ticks without codes; starts of the converter; frames handed to a mailbox; frames discarded
    /// because newer ones followed; received frames without room; ticks with changed settings of the FPU.
    counters: [AtomicU32; 7],
}

/// The last pose and the counters. The name is the symbol's, so that any debugger finds it.
// SAFETY: no other symbol of this program has this name.
#[unsafe(no_mangle)]
pub static STAGE: Telemetry = Telemetry {
    updates: AtomicU32::new(0),
    sequence: AtomicU32::new(0),
    time_us: AtomicU32::new(0),
    status: AtomicU32::new(0),
    pose: [const { AtomicU32::new(0) }; 6],
    counters: [const { AtomicU32::new(0) }; 7],
};

impl Telemetry {
    /// Notes the reading of a tick, its number and its start in us.
    pub fn put(&self, sequence: u32, time_us: u32, reading: &Reading, counters: [u32; 7]) {
        let count_update = || {
            let updates = self.updates.load(Relaxed).wrapping_add(1);
            self.updates.store(updates, Relaxed);
        };
        count_update();
        compiler_fence(Release);
        self.sequence.store(sequence, Relaxed);
        self.time_us.store(time_us, Relaxed);
        self.status.store(reading.status.bits(), Relaxed);
        let (p, v) = (reading.pose.planar, reading.pose.vertical);
        let pose = [p.x_m, p.y_m, p.rz_rad, v.z_m, v.rx_rad, v.ry_rad];
        for (to, from) in self.pose.iter().zip(pose) {
            to.store(from.to_bits(), Relaxed);
        }
        for (to, from) in self.counters.iter().zip(counters) {
            to.store(from, Relaxed);
        }
        compiler_fence(Release);
        count_update();
    }
}
