//! Flash of the STM32F405 where the program writes it: the registers of RM0090 section 3 before sectors 1 and 2 of
//! [`tests::flash_model`]. FLASH_CR opens by two keys. While the flash is busy the core stands, because the program
//! lies in it.

use ::tests::flash_model::{Cut, FlashModel as Sectors};
use embedded_storage::nor_flash::ReadNorFlash;
use std::collections::VecDeque;

/// Start of sector 1.
pub const FIRST: u32 = 0x0800_4000;
/// Bytes of both sectors.
pub const BYTES: usize = 2 * SECTOR as usize;
const SECTOR: u32 = 16 << 10;

/// The longest times with words of 32 bits (DS8626, flash memory programming).
const WORD_NS: u64 = 100_000;
const ERASE_NS: u64 = 500_000_000;

/// Registers, from the start of the flash interface.
const KEYR: usize = 0x04;
const SR: usize = 0x0c;
const CR: usize = 0x10;
const KEYS: [u32; 2] = [0x4567_0123, 0xcdef_89ab];
/// Bits of CR.
const PG: u32 = 1;
const SER: u32 = 1 << 1;
const STRT: u32 = 1 << 16;
const LOCK: u32 = 1 << 31;
const WORDS: u32 = 0b10 << 8;
/// Bits of SR: end of operation, write protection, parallelism, sequence.
const PROTECTED: u32 = 1 << 4;
const PARALLELISM: u32 = 1 << 6;
const SEQUENCE: u32 = 1 << 7;
const BUSY: u32 = 1 << 16;

/// A cut of the power.
#[derive(Clone, Copy, Debug)]
pub struct PowerCut {
    /// In which operation, counted from 0: from now on, or since the cut before.
    pub at: usize,
    /// Where in it.
    pub place: Cut,
    /// The course of chance.
    pub seed: u64,
}

/// The two sectors and the registers.
pub struct FlashModel {
    /// What the sectors hold, and what goes wrong with them.
    pub sectors: Sectors,
    /// Sectors erased.
    pub erases: u64,
    /// Where the power fails after the next loss of it.
    cuts: VecDeque<PowerCut>,
    control: u32,
    status: u32,
    keys: usize,
    /// A wrong key keeps FLASH_CR locked until the next reset.
    shut: bool,
    busy_until_ns: u64,
}

impl Default for FlashModel {
    fn default() -> Self {
        Self {
            sectors: Sectors::erased(),
            erases: 0,
            cuts: VecDeque::new(),
            control: LOCK,
            status: 0,
            keys: 0,
            shut: false,
            busy_until_ns: 0,
        }
    }
}

impl FlashModel {
    /// Cuts the power, one time after the other.
    pub fn cut_at(&mut self, cuts: &[PowerCut]) {
        self.cuts = cuts.iter().copied().collect();
        self.next_cut();
    }

    fn next_cut(&mut self) {
        if let Some(PowerCut { at, place, seed }) = self.cuts.pop_front() {
            self.sectors.seed(seed);
            self.sectors.cut_at(at, place);
        }
    }

    /// The power comes back.
    pub fn power_on(&mut self) {
        self.sectors.power_on();
        self.next_cut();
    }

    /// The registers as after a reset.
    pub const fn reset(&mut self) {
        (self.control, self.status) = (LOCK, 0);
        (self.keys, self.shut, self.busy_until_ns) = (0, false, 0);
    }

    /// A register. The core stands until the flash is no longer busy.
    pub fn read_register(&mut self, offset: usize, now_ns: &mut u64) -> u32 {
        *now_ns = self.busy_until_ns.max(*now_ns);
        match offset {
            SR => self.status & !BUSY,
            CR => self.control,
            _ => 0,
        }
    }

    /// Writes a register.
    pub fn write_register(&mut self, offset: usize, value: u32, now_ns: u64) {
        match offset {
            KEYR => {
                self.shut |= KEYS.get(self.keys) != Some(&value);
                self.keys += 1;
                if self.keys == KEYS.len() && !self.shut {
                    self.control &= !LOCK;
                }
            }
            SR => self.status &= !value,
            CR if self.control & LOCK == 0 => {
                self.control = value & !STRT;
                self.keys = if value & LOCK == 0 { self.keys } else { 0 };
                if value & (STRT | SER) == STRT | SER {
                    self.erase(value >> 3 & 0xf, now_ns);
                }
            }
            _ => {}
        }
    }

    /// Reads 1 to 8 bytes, lowest first.
    pub fn read(&mut self, offset: usize, bytes: usize) -> u64 {
        let mut read = [0; 8];
        let whole = self.sectors.read(offset as u32, &mut read[..bytes]);
        whole.expect("within the sectors");
        u64::from_le_bytes(read)
    }

    /// A write of the core to a sector.
    pub fn write(&mut self, offset: usize, bytes: usize, value: u32, now_ns: u64) {
        self.status |= match self.control & (LOCK | PG | 0b11 << 8) {
            state if state & PG == 0 => SEQUENCE,
            state if state != PG | WORDS || bytes != 4 => PARALLELISM,
            _ => match self.sectors.program(offset as u32, value.to_le_bytes()) {
                Ok(()) => 0,
                Err(_) => PROTECTED,
            },
        };
        self.busy_until_ns = now_ns + WORD_NS;
    }

    fn erase(&mut self, sector: u32, now_ns: u64) {
        // The program may erase only its own sectors.
        let is_own = matches!(sector, 1 | 2) && self.control & (0b11 << 8) == WORDS;
        if !is_own || self.sectors.erase(sector as u8 - 1).is_err() {
            self.status |= PROTECTED;
        }
        self.erases += u64::from(is_own);
        self.busy_until_ns = now_ns + ERASE_NS;
    }
}
