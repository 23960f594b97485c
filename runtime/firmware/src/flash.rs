//! Flash of the STM32F405 (RM0090 rev. 21, section 3): the two parameter sectors, and the program's own
//! bytes.

use crate::supply;
use cortex_m::asm;
use embedded_storage::nor_flash::{
    ErrorType, MultiwriteNorFlash, NorFlash, NorFlashErrorKind, ReadNorFlash, check_erase,
    check_read, check_write,
};
use stage_node::store::{SLOTS, Slots};
use stm32f4xx_hal::pac::FLASH;

/// Bytes of sectors 0 to 3 (table 5).
const SECTOR_BYTES: usize = 16 << 10;
const BYTES: usize = SLOTS * SECTOR_BYTES;

unsafe extern "C" {
    static mut _parameter_slot_0: [u8; BYTES];
}

/// Start of the flash.
const FIRST: u32 = 0x0800_0000;

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
pub struct Sectors(FLASH);

/// The parameter slots. FLASH_CR is locked after a reset.
pub const fn slots(registers: FLASH) -> Slots<Sectors> {
    Slots {
        flash: Sectors(registers),
        first: 0,
        supply_is_low: supply::is_low,
    }
}

const fn address(offset: u32) -> *mut u8 {
    (&raw mut _parameter_slot_0)
        .cast::<u8>()
        .wrapping_add(offset as usize)
}

impl Sectors {
    /// Opens FLASH_CR, does an operation that ends within this number of looks, and locks it again. The operation sets PSIZE to x32,
    /// which needs at least 2.7 V (table 13).
    fn operate(&mut self, looks: u32, start: impl FnOnce(&FLASH)) -> Result<(), NorFlashErrorKind> {
        let Self(registers) = self;
        if registers.cr().read().lock().bit_is_set() {
            for key in KEYS {
                // SAFETY: any word may be written; these two open FLASH_CR.
                registers.keyr().write(|w| unsafe { w.bits(key) });
            }
        }
        // SAFETY: bits that are cleared by writing 1.
        registers.sr().write(|w| unsafe { w.bits(END | ERRORS) });
        start(registers);
        // Reads come after the operation.
        asm::dsb();
        let mut statuses = (0..looks).map(|_| registers.sr().read().bits());
        let ended = statuses.find(|status| status & BUSY == 0);
        registers.cr().modify(|_, w| {
            w.pg().clear_bit().ser().clear_bit();
            w.lock().set_bit()
        });
        // A write to flash changes the data cache, and an erase does not (section 3.6.4); bytes are to be
        // read back from flash. The cache is reset only while it is off (section 3.5.2).
        registers.acr().modify(|_, w| w.dcen().clear_bit());
        registers.acr().modify(|_, w| w.dcrst().set_bit());
        registers.acr().modify(|_, w| w.dcrst().clear_bit());
        registers.acr().modify(|_, w| w.dcen().set_bit());
        match ended {
            Some(status) if status & ERRORS == 0 => Ok(()),
            _ => Err(NorFlashErrorKind::Other),
        }
    }
}

impl ErrorType for Sectors {
    type Error = NorFlashErrorKind;
}

impl ReadNorFlash for Sectors {
    const READ_SIZE: usize = 1;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), NorFlashErrorKind> {
        check_read(self, offset, bytes.len())?;
        for (byte, at) in bytes.iter_mut().zip(offset..) {
            // SAFETY: within the sectors of the linker's script, which hold nothing else.
            *byte = unsafe { address(at).read_volatile() };
        }
        Ok(())
    }

    fn capacity(&self) -> usize {
        BYTES
    }
}

impl NorFlash for Sectors {
    const WRITE_SIZE: usize = 4;
    const ERASE_SIZE: usize = SECTOR_BYTES;

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), NorFlashErrorKind> {
        check_write(self, offset, bytes.len())?;
        let (words, _) = bytes.as_chunks();
        for (word, at) in words.iter().zip((offset..).step_by(4)) {
            self.operate(WORD_LOOKS, |registers| {
                (registers.cr()).modify(|_, w| w.psize().psize32().pg().set_bit());
                // SAFETY: within the sectors, which the linker's script aligns to words. A write to flash
                // programs it while PG is set (section 3.6.4).
                unsafe { (address(at).cast::<u32>()).write_volatile(u32::from_le_bytes(*word)) };
            })?;
        }
        Ok(())
    }

    fn erase(&mut self, from: u32, to: u32) -> Result<(), NorFlashErrorKind> {
        check_erase(self, from, to)?;
        for offset in (from..to).step_by(SECTOR_BYTES) {
            let sector = (address(offset) as u32 - FIRST) / SECTOR_BYTES as u32;
            self.operate(SECTOR_LOOKS, |registers| {
                // SAFETY: the number of a sector, 1 to 3: `memory.x` links with no other slots.
                registers.cr().modify(|_, w| unsafe {
                    w.psize().psize32().ser().set_bit();
                    w.snb().bits(sector as u8)
                });
                registers.cr().modify(|_, w| w.strt().set_bit());
            })?;
        }
        Ok(())
    }
}

/// A word may be programmed again as long as bits only fall (section 3.6.4).
impl MultiwriteNorFlash for Sectors {}
