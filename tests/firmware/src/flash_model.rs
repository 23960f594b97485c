//! Flash of the STM32F405 where the program writes it: sectors 1 and 2, from RM0090 section 3.
//! FLASH_CR opens by two keys; a word is programmed by letting bits fall, and only the erase of
//! a sector raises them. While the flash is busy the core stands, because the program lies in
//! it. A power cut in an operation leaves random bits between what was and what was to be.

use ::tests::flash_model::{Cut, Words};
use std::collections::VecDeque;

/// Start of sector 1.
pub const FIRST: u32 = 0x0800_4000;
/// Bytes of both sectors.
pub const BYTES: usize = 2 * SECTOR;
const SECTOR: usize = 16 << 10;

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
    pub at: u64,
    /// Where in it.
    pub place: Cut,
    /// The course of chance.
    pub seed: u32,
}

/// What an operation that fails tells.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Failing {
    /// An error in FLASH_SR.
    Reported,
    /// Nothing.
    Silent,
}

/// The two sectors and the registers.
pub struct FlashModel {
    /// What the sectors hold.
    pub bytes: Vec<u8>,
    /// Operations so far: words programmed and sectors erased.
    pub operations: u64,
    /// Sectors erased.
    pub erases: u64,
    /// Where the power fails.
    cuts: VecDeque<PowerCut>,
    /// Operations before those that the next of them counts.
    counted: u64,
    /// Whether it has failed.
    pub power_lost: bool,
    /// From which operation on nothing changes any more, and how the program can know.
    pub fails: Option<(u64, Failing)>,
    control: u32,
    status: u32,
    keys: usize,
    /// A wrong key keeps FLASH_CR locked until the next reset.
    shut: bool,
    busy_until_ns: u64,
}

impl FlashModel {
    /// Erased sectors.
    pub fn new() -> Self {
        Self {
            bytes: vec![0xff; BYTES],
            operations: 0,
            erases: 0,
            cuts: VecDeque::new(),
            counted: 0,
            power_lost: false,
            fails: None,
            control: LOCK,
            status: 0,
            keys: 0,
            shut: false,
            busy_until_ns: 0,
        }
    }

    /// Cuts the power, one time after the other.
    pub fn cut_at(&mut self, cuts: &[PowerCut]) {
        self.cuts = cuts.iter().copied().collect();
        self.counted = self.operations;
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

    /// Reads so many bytes, lowest first.
    pub fn read(&self, offset: usize, bytes: usize) -> u64 {
        let read = self.bytes.get(offset..offset + bytes).unwrap_or_default();
        read.iter()
            .rev()
            .fold(0, |word, byte| word << 8 | u64::from(*byte))
    }

    /// A write of the core to a sector.
    pub fn write(&mut self, offset: usize, bytes: usize, value: u32, now_ns: u64) {
        let state = self.control & (LOCK | PG | 0b11 << 8);
        if state != PG | WORDS || bytes != 4 || !offset.is_multiple_of(4) {
            self.status |= if state & PG == 0 {
                SEQUENCE
            } else {
                PARALLELISM
            };
            return;
        }
        let wanted = |old: u8, k: usize| old & (value >> (8 * (k % 4))) as u8;
        self.operate(offset, 4, wanted);
        self.busy_until_ns = now_ns + WORD_NS;
    }

    fn erase(&mut self, sector: u32, now_ns: u64) {
        // Of the other sectors none is the program's to erase.
        if !matches!(sector, 1 | 2) || self.control & (0b11 << 8) != WORDS {
            self.status |= PROTECTED;
            return;
        }
        self.operate((sector as usize - 1) * SECTOR, SECTOR, |_, _| 0xff);
        self.erases += 1;
        self.busy_until_ns = now_ns + ERASE_NS;
    }

    fn operate(&mut self, offset: usize, bytes: usize, wanted: impl Fn(u8, usize) -> u8) {
        let number = self.operations;
        self.operations += 1;
        if let Some((from, failing)) = self.fails
            && number >= from
        {
            self.status |= if failing == Failing::Reported {
                PROTECTED
            } else {
                0
            };
            return;
        }
        let counted = number - self.counted;
        let cut = self.cuts.pop_front_if(|cut| cut.at == counted);
        if cut.is_some() {
            self.power_lost = true;
            self.counted = self.operations;
        }
        let mut chance = Words(cut.map_or(0, |cut| cut.seed.into()));
        for k in offset..offset + bytes {
            let (old, new) = (self.bytes[k], wanted(self.bytes[k], k - offset));
            let done = match cut.map(|cut| cut.place) {
                Some(Cut::Before) => 0,
                Some(Cut::Inside) => chance.draw() as u8,
                Some(Cut::After) | None => 0xff,
            };
            self.bytes[k] = old & !done | new & done;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const WORD: u32 = WORDS | PG;

    fn open(flash: &mut FlashModel) {
        KEYS.iter()
            .for_each(|key| flash.write_register(KEYR, *key, 0));
    }

    #[test]
    fn a_locked_flash_takes_nothing() {
        let mut flash = FlashModel::new();
        flash.write_register(CR, WORD, 0);
        flash.write(0, 4, 0, 0);
        assert_eq!(flash.read(0, 4), 0xffff_ffff);
        assert_eq!(flash.read_register(SR, &mut 0), SEQUENCE);
        flash.write_register(KEYR, 1, 0);
        open(&mut flash);
        flash.write_register(CR, WORD, 0);
        flash.write(0, 4, 0, 0);
        assert_eq!(flash.read(0, 4), 0xffff_ffff);
    }

    #[test]
    fn bits_fall_until_the_sector_is_erased_and_the_core_stands_meanwhile() {
        let (mut flash, mut now_ns) = (FlashModel::new(), 0);
        open(&mut flash);
        flash.write_register(CR, WORD, 0);
        flash.write(8, 4, 0x00ff_00ff, 0);
        flash.write(8, 4, 0x0f0f_0f0f, 0);
        assert_eq!(flash.read(8, 4), 0x000f_000f);
        assert_eq!(flash.read_register(SR, &mut now_ns), 0);
        assert_eq!(now_ns, WORD_NS);
        flash.write_register(CR, WORDS | SER | 1 << 3, now_ns);
        flash.write_register(CR, WORDS | SER | 1 << 3 | STRT, now_ns);
        assert_eq!(flash.read(8, 4), 0xffff_ffff);
        assert_eq!(flash.read_register(SR, &mut now_ns), 0);
        assert_eq!(now_ns, WORD_NS + ERASE_NS);
    }

    #[test]
    fn a_cut_leaves_bits_between() {
        let mut between = 0;
        for seed in 1..64 {
            let mut flash = FlashModel::new();
            open(&mut flash);
            flash.write_register(CR, WORD, 0);
            let (at, place) = (0, Cut::Inside);
            flash.cut_at(&[PowerCut { at, place, seed }]);
            flash.write(0, 4, 0xffff_0000, 0);
            assert!(flash.power_lost);
            assert_eq!(flash.read(2, 2), 0xffff);
            between += u32::from(!matches!(flash.read(0, 2), 0 | 0xffff));
        }
        assert!(between > 50, "{between}");
    }
}
