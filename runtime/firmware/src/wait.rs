//! Waits that end whatever happens, by the system timer of the core. Only the start-up waits.

use crate::board::CORE_HZ;
use cortex_m::peripheral::SYST;
use cortex_m::peripheral::syst::SystClkSource;
use embedded_hal::delay::DelayNs;

/// The system timer, which nothing else uses.
pub struct Stopwatch {
    timer: SYST,
}

impl Stopwatch {
    /// Takes the timer over.
    pub const fn new(timer: SYST) -> Self {
        Self { timer }
    }

    /// Waits until `ready`, for `limit_us` at most, and says whether it came to pass. The timer
    /// counts to 2^24: 0.1 s at 168 MHz.
    pub fn until(&mut self, core_mhz: u32, limit_us: u32, mut ready: impl FnMut() -> bool) -> bool {
        self.timer.set_clock_source(SystClkSource::Core);
        self.timer.set_reload(core_mhz * limit_us);
        self.timer.clear_current();
        self.timer.enable_counter();
        while !ready() {
            if self.timer.has_wrapped() {
                return ready();
            }
        }
        true
    }
}

/// A pause of the core, by its cycles.
pub struct Pause;

impl DelayNs for Pause {
    fn delay_ns(&mut self, ns: u32) {
        cortex_m::asm::delay(ns.div_ceil(1000) * (CORE_HZ / 1_000_000));
    }
}
