//! The independent watchdog. It has an oscillator of its own and, once started, stops only with
//! the power. (The HAL writes the period before it starts the oscillator and does not wait
//! until it is taken over: the first period would be 16 s.)

use crate::board::{INTERNAL_MHZ, PERIOD};
use crate::wait::Stopwatch;
use stm32f4xx_hal::pac::{DBGMCU, IWDG};

/// The watchdog resets this long after it was last fed, ms: ten ticks, and 20 ms at least. That is by the nominal clock of
/// its oscillator, 32 kHz; by its range, 17 to 47 kHz, 20 ms are 13.6 to 37.6 ms.
const PERIOD_MS: u16 = match PERIOD.us() / 100 {
    ms @ 20.. => ms as u16,
    _ => 20,
};

/// While a sector may be erased, which takes 500 ms at most: 2 s by the nominal clock, 1.36 s at
/// least.
const LONG_COUNTS: u16 = 1000;
/// Counts a ms at a divider of 8: 32 kHz / 8 / 1000.
const COUNTS_PER_MS: u16 = 4;
/// Five periods of the slowest oscillator take 0.3 ms; its start-up takes 0.04 ms.
const UPDATE_US: u32 = 1000;

/// The watchdog.
pub struct Watchdog {
    registers: IWDG,
}

impl Watchdog {
    /// Starts it, before the clocks are set up. It stands while a debugger halts the core.
    pub fn start(registers: IWDG, debug: &DBGMCU, stopwatch: &mut Stopwatch) -> Self {
        debug.apb1_fz().modify(|_, w| w.dbg_iwdg_stop().set_bit());
        // From now on 512 ms, the period after a reset.
        registers.kr().write(|w| w.key().start());
        let mut watchdog = Self { registers };
        watchdog.set_period(INTERNAL_MHZ, false, stopwatch);
        watchdog
    }

    /// Sets its period: [`PERIOD_MS`], or long enough for an erase of flash.
    pub fn set_period(&mut self, core_mhz: u32, is_long: bool, stopwatch: &mut Stopwatch) {
        let registers = &self.registers;
        registers.kr().write(|w| w.key().unlock());
        if is_long {
            registers.pr().write(|w| w.pr().divide_by64());
        } else {
            registers.pr().write(|w| w.pr().divide_by8());
        }
        let counts = if is_long {
            LONG_COUNTS
        } else {
            PERIOD_MS * COUNTS_PER_MS - 1
        };
        registers.rlr().write(|w| w.rl().set(counts));
        // If the oscillator does not take them over, there is no watchdog, and nothing more to do.
        stopwatch.until(core_mhz, UPDATE_US, || {
            let busy = registers.sr().read();
            busy.pvu().bit_is_clear() && busy.rvu().bit_is_clear()
        });
        self.feed();
    }

    /// Starts its period anew.
    pub fn feed(&mut self) {
        self.registers.kr().write(|w| w.key().feed());
    }
}
