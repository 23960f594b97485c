//! The start-up, in steps that each end whatever happens.
//!
//! The watchdog runs first. The step that runs is noted in RAM that survives a reset: where the
//! HAL waits without end, for the PLL, the watchdog resets, and the next start knows.

use crate::board::{self, INTERNAL_MHZ};
use crate::fault::RETAINED;
use crate::wait::Stopwatch;
use crate::watchdog::Watchdog;
use hal_adapters::can::status::{BoardFacts, bit, board_check};
use stage_node::retained::Step;
use stage_node::start_up::{Before, Cause};
use stm32f4xx_hal::pac::RCC;
use stm32f4xx_hal::prelude::*;
use stm32f4xx_hal::rcc::Rcc;

/// Longest time that the crystal may take: typically 2 ms (DS8626, HSE oscillator characteristics), and 50 ms cold with much
/// load. In steps of less than the shortest period of the watchdog.
const CRYSTAL_STEPS: u32 = 10;
const CRYSTAL_STEP_US: u32 = 5000;

/// The brown-out level in FLASH_OPTCR: 0 is the highest, 2.7 V.
const BROWN_OUT_LEVEL: u32 = 0b11 << 2;

/// Reads and clears the cause of the reset, and evaluates the record of the run before it.
pub fn before(rcc: &RCC) -> Before {
    let flags = rcc.csr().read();
    rcc.csr().modify(|_, w| w.rmvf().set_bit());
    // A brown-out alone leaves PORRSTF clear (RM0090 rev. 18, section 7.3.21): RAM may have kept its record.
    let cause = if flags.porrstf().bit_is_set() {
        Cause::PowerOn
    } else if flags.wdgrstf().bit_is_set() {
        Cause::Watchdog
    } else {
        Cause::Reset
    };
    Before::of_ram(cause, &RETAINED)
}

/// Sets up the clocks: by the crystal, or by the internal oscillator if the crystal does not start, the PLL did not lock
/// to it, or it stopped. Returns whether the crystal runs.
pub fn clocks(
    before: &Before,
    rcc: RCC,
    watchdog: &mut Watchdog,
    stopwatch: &mut Stopwatch,
) -> (Rcc, bool) {
    let failed = before.by_fault && before.record.fault.is_of_the_crystal();
    RETAINED.begin(Step::Clocks);
    let crystal = !failed && {
        rcc.cr().modify(|_, w| w.hseon().set_bit());
        let ready = || rcc.cr().read().hserdy().bit_is_set();
        (0..CRYSTAL_STEPS).any(|_| {
            watchdog.feed();
            stopwatch.until(INTERNAL_MHZ, CRYSTAL_STEP_US, ready)
        })
    };
    if !crystal {
        rcc.cr().modify(|_, w| w.hseon().clear_bit());
        RETAINED.begin(Step::InternalClock);
    }
    let rcc = rcc.freeze(board::clocks(crystal));
    if crystal {
        // If it stops later, the core gets an interrupt.
        rcc.cr().modify(|_, w| w.csson().set_bit());
    }
    (rcc, crystal)
}

/// Board and last fault for the health frames. `checks` are bits of [`board_check`]; the brown-out level of
/// `option_bytes`, the word FLASH_OPTCR, is added.
pub fn board_facts(before: &Before, option_bytes: u32, checks: u32) -> BoardFacts {
    let low = bit(
        board_check::BROWN_OUT_LOW,
        option_bytes & BROWN_OUT_LEVEL != 0,
    );
    let facts = before.record.facts(option_bytes, checks | low);
    crate::log::start(&facts);
    facts
}
