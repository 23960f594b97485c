//! Flash of the STM32F405 (RM0090 rev. 21, section 3): the two parameter sectors, and the program's own
//! bytes.

use crate::supply::Supply;
use cortex_m::asm;
use embedded_storage::nor_flash::{
    ErrorType, NorFlash, ReadNorFlash, check_erase, check_read, check_write,
};
use firmware::store::{FlashFault, SLOT_BYTES, SLOTS};
use stm32f4xx_hal::pac::FLASH;

const BYTES: usize = SLOTS * SLOT_BYTES as usize;

unsafe extern "C" {
    static mut _parameter_slot_0: [u8; BYTES];
}

/// The keys that open FLASH_CR, one after the other (section 3.6.1).
const KEYS: [u32; 2] = [0x4567_0123, 0xcdef_89ab];
/// Bits of FLASH_SR: end of operation; errors; busy (section 3.9.4). The first two are cleared by
/// writing 1.
const END: u32 = 1;
const ERRORS: u32 = 0b1111_0010;
const BUSY: u32 = 1 << 16;
/// Looks at FLASH_SR until an operation is given up. The core stands while the flash is busy,
/// because the program lies in it; if it did not, a look would take four cycles at least: 0.2 ms
/// for a word, which takes 0.1 ms at most, and 1 s for a sector of 16 KiB, which takes 0.5 s at
/// most with words of 32 bits (DS8626, flash memory programming).
const WORD_LOOKS: u32 = 10_000;
const SECTOR_LOOKS: u32 = 42_000_000;

/// The parameter sectors of `memory.x`: offset 0 is the start of slot 0, which slot 1 follows.
pub struct Sectors {
    registers: FLASH,
    /// Looked at before and after each operation.
    pub supply: Supply,
}

impl Sectors {
    /// Takes the registers over; FLASH_CR is locked after a reset.
    pub const fn new(registers: FLASH, supply: Supply) -> Self {
        Self { registers, supply }
    }

    const fn address(offset: u32) -> *mut u8 {
        (&raw mut _parameter_slot_0)
            .cast::<u8>()
            .wrapping_add(offset as usize)
    }

    /// Opens FLASH_CR, does an operation, and locks it again. The operation gives the number of
    /// looks until it is given up. It sets PSIZE to x32, which needs at least 2.7 V (table 13).
    fn operate(&mut self, start: impl FnOnce(&FLASH) -> u32) -> Result<(), FlashFault> {
        if self.supply.is_low() {
            return Err(FlashFault::SupplyLow);
        }
        let registers = &self.registers;
        if registers.cr().read().lock().bit_is_set() {
            // SAFETY: any word may be written; these two open FLASH_CR.
            KEYS.into_iter().for_each(|key| {
                registers.keyr().write(|w| unsafe { w.bits(key) });
            });
        }
        // SAFETY: bits that are cleared by writing 1.
        registers.sr().write(|w| unsafe { w.bits(END | ERRORS) });
        let mut looks = start(registers);
        // What is read afterwards must be read afterwards.
        asm::dsb();
        let mut status = registers.sr().read().bits();
        while status & BUSY != 0 && looks > 0 {
            status = registers.sr().read().bits();
            looks -= 1;
        }
        registers.cr().modify(|_, w| {
            w.pg().clear_bit().ser().clear_bit();
            w.lock().set_bit()
        });
        // A write to flash changes the data cache as well, and an erase does not (section 3.6.4):
        // what is read back is to come from flash. The cache is reset only while it is off
        // (section 3.5.2).
        registers.acr().modify(|_, w| w.dcen().clear_bit());
        registers.acr().modify(|_, w| w.dcrst().set_bit());
        registers.acr().modify(|_, w| w.dcrst().clear_bit());
        registers.acr().modify(|_, w| w.dcen().set_bit());
        match status & (BUSY | ERRORS) {
            // What was done meanwhile may not last.
            0 if self.supply.is_low() => Err(FlashFault::SupplyLow),
            0 => Ok(()),
            status => Err(FlashFault::Reported { status }),
        }
    }
}

impl ErrorType for Sectors {
    type Error = FlashFault;
}

impl ReadNorFlash for Sectors {
    const READ_SIZE: usize = 1;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), FlashFault> {
        check_read(self, offset, bytes.len()).map_err(FlashFault::Argument)?;
        for (k, byte) in bytes.iter_mut().enumerate() {
            // SAFETY: within the sectors of the linker's script, which hold nothing else.
            *byte = unsafe { Self::address(offset).add(k).read_volatile() };
        }
        Ok(())
    }

    fn capacity(&self) -> usize {
        BYTES
    }
}

impl NorFlash for Sectors {
    const WRITE_SIZE: usize = 4;
    const ERASE_SIZE: usize = SLOT_BYTES as usize;

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), FlashFault> {
        check_write(self, offset, bytes.len()).map_err(FlashFault::Argument)?;
        for (word, offset) in bytes.as_chunks().0.iter().zip((offset..).step_by(4)) {
            self.operate(|registers| {
                (registers.cr()).modify(|_, w| w.psize().psize32().pg().set_bit());
                let address = Self::address(offset).cast::<u32>();
                // SAFETY: within the sectors, which the linker's script aligns to words. A write
                // to flash programs it while PG is set (section 3.6.4).
                unsafe { address.write_volatile(u32::from_le_bytes(*word)) };
                WORD_LOOKS
            })?;
        }
        Ok(())
    }

    fn erase(&mut self, from: u32, to: u32) -> Result<(), FlashFault> {
        check_erase(self, from, to).map_err(FlashFault::Argument)?;
        for slot in from / SLOT_BYTES..to / SLOT_BYTES {
            self.operate(|registers| {
                // SAFETY: the numbers of the two sectors, 1 and 2 (table 5).
                registers.cr().modify(|_, w| unsafe {
                    w.psize().psize32().ser().set_bit();
                    w.snb().bits(1 + slot as u8)
                });
                registers.cr().modify(|_, w| w.strt().set_bit());
                SECTOR_LOOKS
            })?;
        }
        Ok(())
    }
}
