//! The supply of the chip, by its voltage detector (RM0090 rev. 21, sections 5.2.3, 5.4.1 and 5.4.2).
//! Below 2.7 V flash programmed in words of 32 bits may read right and not be retained (section
//! 3.6.2): the brown-out reset, which is off in new parts, is no proof against it.

use crate::board::INTERNAL_MHZ;
use crate::wait::Stopwatch;
use crate::watchdog::Watchdog;
use stm32f4xx_hal::pac::{PWR, RCC};

/// PLS: 2.9 V, the highest threshold.
const LEVEL: u8 = 0b111;
/// From the detector's start until its output is looked at, us. The sheet gives no time.
const START_US: u32 = 100;

/// Starts the detector, and waits until the supply is sound, however long that takes.
pub fn wait(registers: &PWR, rcc: &RCC, watchdog: &mut Watchdog, stopwatch: &mut Stopwatch) {
    rcc.apb1enr().modify(|_, w| w.pwren().set_bit());
    // A register is to be written two cycles after its clock was switched on (RM0090, section 7.2).
    let _ = rcc.apb1enr().read();
    (registers.cr()).modify(|_, w| w.pls().set(LEVEL).pvde().set_bit());
    stopwatch.until(INTERNAL_MHZ, START_US, || false);
    while is_low() {
        watchdog.feed();
    }
}

/// Whether it is below the threshold now.
pub fn is_low() -> bool {
    // SAFETY: reading this register changes nothing.
    unsafe { (*PWR::PTR).csr().read().pvdo().bit_is_set() }
}
