//! Flash of the STM32F405 (RM0090 rev. 21, section 3): the two parameter sectors, which the store
//! reads, programs and erases, and the program's own bytes.

use cortex_m::asm;
use crc::{CRC_32_ISCSI, Crc, NoTable};
use firmware::store::{Flash, FlashFault, SECTOR_BYTES, SECTOR_WORDS, Sector};
use stm32f4xx_hal::pac::FLASH;

unsafe extern "C" {
    static mut _parameter_slot_0: [u8; SECTOR_BYTES];
    static mut _parameter_slot_1: [u8; SECTOR_BYTES];
    static __stext: u8;
    static __erodata: u8;
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

/// CRC-32C of the program's instructions and constants: the same for every stage.
pub fn program_crc() -> u32 {
    let (start, end) = (&raw const __stext, &raw const __erodata);
    // SAFETY: the linker puts `.text` and `.rodata` between these symbols, one after the other,
    // and nothing writes there.
    let program = unsafe { core::slice::from_raw_parts(start, end as usize - start as usize) };
    Crc::<u32, NoTable>::new(&CRC_32_ISCSI).checksum(program)
}

/// The parameter sectors of `memory.x`.
pub struct Sectors {
    registers: FLASH,
}

impl Sectors {
    /// Takes the registers over; FLASH_CR is locked after a reset.
    pub const fn new(registers: FLASH) -> Self {
        Self { registers }
    }

    const fn address(sector: Sector) -> *mut [u8; SECTOR_BYTES] {
        match sector {
            Sector::First => &raw mut _parameter_slot_0,
            Sector::Second => &raw mut _parameter_slot_1,
        }
    }

    /// Opens FLASH_CR, does an operation, and locks it again. The operation gives the number of
    /// looks until it is given up.
    fn operate(&mut self, start: impl FnOnce(&FLASH) -> u32) -> Result<(), FlashFault> {
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
            0 => Ok(()),
            status => Err(FlashFault { status }),
        }
    }
}

impl Flash for Sectors {
    fn bytes(&self, sector: Sector) -> &[u8; SECTOR_BYTES] {
        // SAFETY: the linker's script gives the addresses of two sectors of this length that hold
        // nothing else; they change only in `program` and `erase`, which borrow `self` mutably.
        unsafe { &*Self::address(sector) }
    }

    fn program(&mut self, sector: Sector, word: usize, value: u32) -> Result<(), FlashFault> {
        if word >= SECTOR_WORDS {
            return Err(FlashFault { status: 0 });
        }
        self.operate(|registers| {
            registers
                .cr()
                .modify(|_, w| w.psize().psize32().pg().set_bit());
            // SAFETY: within the sector, which the linker's script aligns to words. A write to
            // flash programs it while PG is set (section 3.6.4).
            unsafe {
                let address = Self::address(sector).cast::<u32>().add(word);
                address.write_volatile(value);
            }
            WORD_LOOKS
        })
    }

    fn erase(&mut self, sector: Sector) -> Result<(), FlashFault> {
        let number = 1 + sector as u8;
        self.operate(|registers| {
            // SAFETY: the numbers of the two sectors, 1 and 2 (table 5).
            registers.cr().modify(|_, w| unsafe {
                w.psize().psize32().ser().set_bit();
                w.snb().bits(number)
            });
            registers.cr().modify(|_, w| w.strt().set_bit());
            SECTOR_LOOKS
        })
    }
}
