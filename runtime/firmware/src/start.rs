//! The start-up, in steps that each end whatever happens.
//!
//! The watchdog runs first. The step that runs is noted in RAM that survives a reset: where the
//! HAL waits without end, for the PLL, the watchdog resets, and the next start knows.

use crate::board::{self, INTERNAL_MHZ};
use crate::fault;
use crate::wait::Stopwatch;
use firmware::node::Node;
use firmware::retained::{Blamed, FaultKind, KeptZero, Retained, Step};
use firmware::store::Check;
use hal_adapters::can::status::{BoardFacts, board_check as check};
use runtime::PlanarPose;
use stm32f4xx_hal::pac::{FLASH, RCC};
use stm32f4xx_hal::prelude::*;
use stm32f4xx_hal::rcc::Rcc;

/// Longest time that the crystal may take, us: typically 2 ms (DS8626, HSE oscillator
/// characteristics), and less than the shortest period of the watchdog.
const CRYSTAL_US: u32 = 8000;

/// What the start-up found.
pub struct Found {
    /// Which lines to the converter are pulled up.
    pub pulled_up: board::PulledUp,
    /// Whether the core runs by the crystal.
    pub crystal: bool,
    /// Whether the CAN controller could be set up.
    pub can_started: bool,
    /// Whether a zero deviation was lost.
    pub zero_lost: bool,
}

/// FLASH_OPTCR as it was read.
#[derive(Clone, Copy)]
pub struct OptionBytes {
    word: u32,
    brown_out_low: bool,
}

impl OptionBytes {
    /// Reads it.
    pub fn read(flash: &FLASH) -> Self {
        let options = flash.optcr().read();
        Self {
            word: options.bits(),
            // 0 is the highest level, 2.7 V.
            brown_out_low: options.bor_lev().bits() != 0,
        }
    }
}

/// What was before this start.
pub struct Before {
    /// Whether the watchdog caused this start.
    pub watchdog: bool,
    /// Whether the watchdog or the program itself did, on a fault.
    pub by_fault: bool,
    /// The parameters that made the program fault twice in a row.
    pub blames: Option<Blamed>,
    /// The record that survived; after power-on an empty one.
    record: Retained,
}

impl Before {
    /// Reads and clears the cause of the reset, and notes a reset by the watchdog.
    pub fn take(rcc: &RCC) -> Self {
        let cause = rcc.csr().read();
        rcc.csr().modify(|_, w| w.rmvf().set_bit());
        let power_on = cause.borrstf().bit_is_set() || cause.porrstf().bit_is_set();
        let watchdog = cause.wdgrstf().bit_is_set();
        let mut record = if power_on {
            Retained::default()
        } else {
            fault::retained().unwrap_or_else(Retained::damaged)
        };
        if watchdog {
            record.note(FaultKind::Watchdog, 0, 0);
        }
        let by_fault = core::mem::take(&mut record.crashed);
        let blames = record.blames();
        fault::retain(&record);
        Self {
            watchdog,
            by_fault,
            blames,
            record,
        }
    }

    /// Sets up the clocks: by the crystal, or by the internal oscillator if the crystal does not
    /// start, the PLL did not lock to it, or it stopped. Says whether it is the crystal.
    pub fn clocks(&self, rcc: RCC, stopwatch: &mut Stopwatch) -> (Rcc, bool) {
        let failed = self.by_fault && self.record.fault.is_of_the_crystal();
        fault::begin(Step::Clocks);
        let crystal = !failed && {
            rcc.cr().modify(|_, w| w.hseon().set_bit());
            let ready = || rcc.cr().read().hserdy().bit_is_set();
            stopwatch.until(INTERNAL_MHZ, CRYSTAL_US, ready)
        };
        if !crystal {
            rcc.cr().modify(|_, w| w.hseon().clear_bit());
            fault::begin(Step::InternalClock);
        }
        let rcc = rcc.freeze(board::clocks(crystal));
        if crystal {
            // If it stops later, the core gets an interrupt.
            rcc.cr().modify(|_, w| w.csson().set_bit());
        }
        (rcc, crystal)
    }

    /// What the health frames tell of the board and of the last fault.
    pub fn board_facts(&self, options: OptionBytes, found: &Found) -> BoardFacts {
        let on = |bit, is| if is { bit } else { 0 };
        BoardFacts {
            last_fault: self.record.fault.kind_and_step,
            fault_address: self.record.fault.address,
            fault_detail: self.record.fault.detail,
            faults: self.record.faults,
            option_bytes: options.word,
            board_checks: on(check::NO_PULL_UP_ON_SELECT, !found.pulled_up.select)
                | on(check::NO_PULL_UP_ON_CONTROL, !found.pulled_up.control)
                | on(check::BROWN_OUT_LOW, options.brown_out_low)
                | on(check::INTERNAL_OSCILLATOR, !found.crystal)
                | on(check::CAN_NOT_STARTED, !found.can_started)
                | on(check::ZERO_LOST, found.zero_lost),
        }
    }

    /// What blobs are checked for at start-up; a fault in a check is blamed on its blob.
    pub const fn check(&self, serial: Option<&'static str>) -> Check {
        let suspect = match self.blames {
            Some(Blamed::Blob { crc }) => Some(crc),
            _ => None,
        };
        Check {
            serial,
            suspect,
            note: |crc| fault::update(|record| record.checked_blob = crc.unwrap_or(0)),
        }
    }

    /// Restores the zero deviation if it was measured with the blob of this CRC. Says whether one
    /// may have been lost.
    pub fn restore_zero(&self, node: &mut Node<'_>, blob: u32) -> bool {
        let KeptZero { blob: of, zero } = self.record.zero;
        if of == blob {
            node.restore_zero(zero);
        }
        node.zero() != zero
    }
}

/// Keeps the zero deviation where a reset leaves it alone.
pub struct ZeroKeeper {
    kept: KeptZero,
}

impl ZeroKeeper {
    /// Keeps zero deviations of the blob of this CRC; without one, what was kept stays for a
    /// later start.
    pub fn new(blob: Option<u32>, zero: PlanarPose<f32>) -> Self {
        let kept = KeptZero {
            blob: blob.unwrap_or_default(),
            zero,
        };
        if blob.is_some() {
            fault::update(|record| record.zero = kept);
        }
        Self { kept }
    }

    /// Keeps `zero`, if it is another.
    pub fn keep(&mut self, zero: PlanarPose<f32>) {
        if self.kept.zero != zero {
            self.kept.zero = zero;
            fault::update(|record| record.zero = self.kept);
        }
    }
}
