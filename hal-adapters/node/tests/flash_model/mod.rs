//! A model of two sectors of NOR flash and of cuts of the power, written from documents of flash, not from the store.
//!
//! - Programming lets bits fall, a word at a time, also in a word that is not blank (RM0090 rev. 21, section
//!   3.6.4). Only the erase of a whole sector raises bits (3.6.3).
//! - After a reset in an operation, contents are not guaranteed (3.6). In a word that was being programmed, each
//!   bit that should fall has fallen or not.
//! - An interrupted erase ends in any mixture of raised, unchanged and fallen bits: NOR flash is programmed to 0
//!   before it is erased (the Linux change "UBI: fix NOR flash recovery", for a Spansion S29GL512N).
//! - Such bits stay, or read anew after each start (the "unstable bits" of UBIFS), until they are programmed to 0
//!   or erased to the end. Programming again the bits that were to fall makes them fall for good.
//!
//! Not modelled: wear beyond a stuck word, disturbed neighbours, and bits that change without a cut.

extern crate std;

use super::Slots;
use embedded_storage::nor_flash::{
    ErrorType, MultiwriteNorFlash, NorFlash, NorFlashErrorKind, ReadNorFlash,
};
use std::vec;
use std::vec::Vec;

/// Bytes of a sector.
const SECTOR: usize = 16 << 10;
const BYTES: usize = 2 * SECTOR;

/// The place of a cut in an operation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cut {
    /// Before any change.
    Before,
    /// Some bits have changed.
    Inside,
    /// The operation is complete, but its end is not reported.
    After,
}

impl Cut {
    /// All places.
    pub const ALL: [Self; 3] = [Self::Before, Self::Inside, Self::After];
}

/// Random words by a seed (SplitMix64, Steele et al. 2014).
#[derive(Clone, Debug, Default)]
pub struct Words(
    /// The seed.
    pub u64,
);

impl Words {
    /// The next word.
    pub fn draw(&mut self) -> u32 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 32) as u32
    }

    /// The next number from 0 to `n` - 1.
    ///
    /// # Panics
    /// If `n` is 0.
    pub fn below(&mut self, n: u32) -> u32 {
        self.draw() % n
    }

    /// A word; each bit is 1 with the probability `eighths` / 8.
    fn biased(&mut self, eighths: u32) -> u32 {
        if eighths >= 8 {
            return u32::MAX;
        }
        (0..3).fold(0, |word, digit| match eighths >> digit & 1 {
            1 => word | self.draw(),
            _ => word & self.draw(),
        })
    }
}

/// Bits that were not programmed or erased to their end.
#[derive(Clone, Debug)]
struct Weak {
    word: usize,
    bits: u32,
    /// They read as 1 with this probability.
    eighths: u32,
}

/// Two sectors of flash.
#[derive(Clone, Debug)]
pub struct FlashModel {
    bytes: Vec<u8>,
    weak: Vec<Weak>,
    words: Words,
    /// Whether weak bits read anew after each start.
    unstable: bool,
    /// Operations since the last start.
    pub operations: usize,
    cut: Option<(usize, Cut)>,
    off: bool,
    /// An operation that reports an error, and is done all the same.
    pub reports: Option<usize>,
    /// A word, of both sectors, that neither programming nor an erase changes, without an error.
    pub stuck: Option<usize>,
}

const OFF: NorFlashErrorKind = NorFlashErrorKind::Other;

impl FlashModel {
    /// Both sectors erased.
    #[must_use]
    pub fn erased() -> Self {
        Self {
            bytes: vec![0xff; BYTES],
            weak: Vec::new(),
            words: Words(0),
            unstable: false,
            operations: 0,
            cut: None,
            off: false,
            reports: None,
            stuck: None,
        }
    }

    /// Writes a slot like a probe.
    ///
    /// # Panics
    /// If they are longer than a sector.
    pub fn load(&mut self, slot: u8, contents: &[u8]) {
        let at = usize::from(slot) * SECTOR;
        let bytes = &mut self.bytes[at..at + SECTOR];
        bytes.fill(0xff);
        bytes[..contents.len()].copy_from_slice(contents);
    }

    /// Another course of chance; with odd seeds weak bits read anew after each start.
    pub fn seed(&mut self, seed: u64) {
        self.words = Words(seed);
        self.unstable = seed % 2 == 1;
    }

    /// Cuts the power at this operation from now on, counted from 0.
    pub fn cut_at(&mut self, operation: usize, cut: Cut) {
        self.operations = 0;
        self.cut = Some((operation, cut));
    }

    /// The power comes back.
    pub fn power_on(&mut self) {
        (self.off, self.cut, self.operations) = (false, None, 0);
        if self.unstable {
            for index in 0..self.weak.len() {
                let weak = self.weak[index].clone();
                let drawn = self.words.biased(weak.eighths) & weak.bits;
                let word = self.word(weak.word) & !weak.bits | drawn;
                self.put(weak.word, word);
            }
        }
    }

    /// Whether the power has failed since the last start.
    pub const fn is_off(&self) -> bool {
        self.off
    }

    fn word(&self, word: usize) -> u32 {
        let bytes = &self.bytes[4 * word..4 * word + 4];
        u32::from_le_bytes(bytes.try_into().expect("four"))
    }

    fn put(&mut self, word: usize, value: u32) {
        if self.stuck != Some(word) {
            self.bytes[4 * word..4 * word + 4].copy_from_slice(&value.to_le_bytes());
        }
    }

    /// The cut of this operation.
    fn next(&mut self) -> Result<Option<Cut>, NorFlashErrorKind> {
        if self.off {
            return Err(OFF);
        }
        let operation = self.operations;
        self.operations += 1;
        let cut = (self.cut)
            .filter(|&(at, _)| at == operation)
            .map(|(_, cut)| cut);
        self.off = cut.is_some();
        Ok(cut)
    }

    fn end(&self, cut: Option<Cut>) -> Result<(), NorFlashErrorKind> {
        if cut.is_some() || self.reports == Some(self.operations - 1) {
            return Err(OFF);
        }
        Ok(())
    }

    /// Programs a word.
    ///
    /// # Errors
    /// A reported error, or the power is off.
    ///
    /// # Panics
    /// If `offset` is no address of a word.
    pub fn program(&mut self, offset: u32, value: [u8; 4]) -> Result<(), NorFlashErrorKind> {
        assert_eq!(offset % 4, 0, "an address of a word");
        let (word, value) = (offset as usize / 4, u32::from_le_bytes(value));
        let cut = self.next()?;
        let old = self.word(word);
        let bits = old & !value;
        match cut {
            Some(Cut::Before) => {}
            Some(Cut::Inside) => {
                let eighths = self.words.below(9);
                let risen = self.words.biased(eighths) & bits;
                self.put(word, old & !bits | risen);
                self.weak.push(Weak {
                    word,
                    bits,
                    eighths,
                });
            }
            Some(Cut::After) | None => {
                self.put(word, old & value);
                // Bits that are driven to 0, weak bits too, are 0 for good.
                for weak in self.weak.iter_mut().filter(|weak| weak.word == word) {
                    weak.bits &= value;
                }
            }
        }
        self.end(cut)
    }

    /// Erases a sector.
    ///
    /// # Errors
    /// As [`FlashModel::program`].
    pub fn erase(&mut self, slot: u8) -> Result<(), NorFlashErrorKind> {
        const WORDS: usize = SECTOR / 4;
        let from = usize::from(slot) * WORDS;
        let cut = self.next()?;
        if cut == Some(Cut::Before) {
            return self.end(cut);
        }
        self.weak
            .retain(|weak| !(from..from + WORDS).contains(&weak.word));
        // The progress of the erase: bits fall first, in part of the sector, then all rise.
        let (eighths, falls) = (self.words.below(9), self.words.below(3) == 0);
        for word in from..from + WORDS {
            if cut != Some(Cut::Inside) {
                self.put(word, u32::MAX);
                continue;
            }
            let (drawn, old) = (self.words.biased(eighths), self.word(word));
            self.put(word, if falls { old & drawn } else { old | drawn });
            let weak_eighths = if self.unstable {
                self.words.below(9)
            } else {
                0
            };
            self.weak.push(Weak {
                word,
                bits: u32::MAX,
                eighths: weak_eighths,
            });
        }
        self.end(cut)
    }
}

impl ErrorType for FlashModel {
    type Error = NorFlashErrorKind;
}

impl ReadNorFlash for FlashModel {
    const READ_SIZE: usize = 1;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), NorFlashErrorKind> {
        bytes.copy_from_slice(&self.bytes[offset as usize..][..bytes.len()]);
        Ok(())
    }

    fn capacity(&self) -> usize {
        BYTES
    }
}

impl NorFlash for FlashModel {
    const WRITE_SIZE: usize = 4;
    const ERASE_SIZE: usize = SECTOR;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), NorFlashErrorKind> {
        assert_eq!(to - from, SECTOR as u32, "a sector");
        Self::erase(self, (from / SECTOR as u32) as u8)
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), NorFlashErrorKind> {
        self.program(offset, bytes.try_into().expect("a word"))
    }
}

impl MultiwriteNorFlash for FlashModel {}

/// Both sectors as slots, with a sound supply.
pub const fn slots<F>(flash: F) -> Slots<F> {
    Slots {
        flash,
        first: 0,
        supply_is_low: || false,
    }
}

#[test]
fn a_cut_leaves_bits_between_and_lets_nothing_follow() {
    let wrote = 0x00ff_f00f_u32;
    let mut seen = [false; 3];
    for seed in 0..64 {
        let mut flash = FlashModel::erased();
        flash.seed(seed);
        flash.cut_at(1, Cut::Inside);
        assert_eq!(flash.program(0, wrote.to_le_bytes()), Ok(()));
        assert_eq!(flash.program(4, wrote.to_le_bytes()), Err(OFF));
        assert_eq!(flash.program(8, wrote.to_le_bytes()), Err(OFF));
        assert_eq!(flash.erase(0), Err(OFF));
        let torn = flash.word(1);
        assert_eq!((flash.word(0), flash.word(2)), (wrote, u32::MAX));
        assert_eq!(torn & wrote, wrote);
        seen[0] |= torn == wrote;
        seen[1] |= torn == u32::MAX;
        flash.power_on();
        seen[2] |= flash.word(1) != torn;
        assert!(flash.unstable || flash.word(1) == torn);
        // Programmed again it reads right, for good.
        assert_eq!(flash.program(4, wrote.to_le_bytes()), Ok(()));
        flash.power_on();
        assert_eq!(flash.word(1), wrote);
    }
    assert_eq!(seen, [true; 3]);
}
