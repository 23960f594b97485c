//! Flash of the STM32F405 (RM0090 rev. 21, section 3): the two parameter sectors, and the program's own
//! bytes.

use crate::supply::Supply;
use cortex_m::asm;
use hal_adapters::can::update::NotWritten;
use stage_node::store::{Flash, SLOT_BYTES, SLOTS};
use stm32f4xx_hal::pac::FLASH;

const BYTES: usize = SLOTS * SLOT_BYTES as usize;

unsafe extern "C" {
    static mut _parameter_slot_0: [u8; BYTES];
}

/// Start of the flash. Sectors 0 to 3 have the bytes of a slot each (table 5).
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
    fn operate(&mut self, start: impl FnOnce(&FLASH) -> u32) -> Result<(), NotWritten> {
        if self.supply.is_low() {
            return Err(NotWritten::SupplyLow);
        }
        let registers = &self.registers;
        if registers.cr().read().lock().bit_is_set() {
            for key in KEYS {
                // SAFETY: any word may be written; these two open FLASH_CR.
                registers.keyr().write(|w| unsafe { w.bits(key) });
            }
        }
        // SAFETY: bits that are cleared by writing 1.
        registers.sr().write(|w| unsafe { w.bits(END | ERRORS) });
        let mut looks = start(registers);
        // Reads come after the operation.
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
        // A write to flash changes the data cache, and an erase does not (section 3.6.4); bytes are to be
        // read back from flash. The cache is reset only while it is off (section 3.5.2).
        registers.acr().modify(|_, w| w.dcen().clear_bit());
        registers.acr().modify(|_, w| w.dcrst().set_bit());
        registers.acr().modify(|_, w| w.dcrst().clear_bit());
        registers.acr().modify(|_, w| w.dcen().set_bit());
        match status & (BUSY | ERRORS) {
            // The operation may not last.
            0 if self.supply.is_low() => Err(NotWritten::SupplyLow),
            0 => Ok(()),
            _ => Err(NotWritten::Failed),
        }
    }
}

/// Whether bytes lie within the sectors.
const fn is_inside(offset: u32, bytes: usize) -> bool {
    offset as usize + bytes <= BYTES
}

impl Flash for Sectors {
    fn read(&self, offset: u32, bytes: &mut [u8]) {
        if is_inside(offset, bytes.len()) {
            for (k, byte) in bytes.iter_mut().enumerate() {
                // SAFETY: within the sectors of the linker's script, which hold nothing else.
                *byte = unsafe { Self::address(offset).add(k).read_volatile() };
            }
        }
    }

    fn program(&mut self, offset: u32, word: [u8; 4]) -> Result<(), NotWritten> {
        if !offset.is_multiple_of(4) || !is_inside(offset, 4) {
            return Err(NotWritten::Failed);
        }
        self.operate(|registers| {
            (registers.cr()).modify(|_, w| w.psize().psize32().pg().set_bit());
            let address = Self::address(offset).cast::<u32>();
            // SAFETY: within the sectors, which the linker's script aligns to words. A write to flash
            // programs it while PG is set (section 3.6.4).
            unsafe { address.write_volatile(u32::from_le_bytes(word)) };
            WORD_LOOKS
        })
    }

    fn erase(&mut self, slot: u8) -> Result<(), NotWritten> {
        let start = Self::address(u32::from(slot & 1) * SLOT_BYTES) as u32;
        let sector = (start - FIRST) / SLOT_BYTES;
        self.operate(|registers| {
            // SAFETY: the number of a sector, 1 to 3: `memory.x` links with no other slots.
            registers.cr().modify(|_, w| unsafe {
                w.psize().psize32().ser().set_bit();
                w.snb().bits(sector as u8)
            });
            registers.cr().modify(|_, w| w.strt().set_bit());
            SECTOR_LOOKS
        })
    }
}
