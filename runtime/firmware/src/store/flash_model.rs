//! Two sectors of NOR flash, and what a cut of the power leaves in them. Written from what is
//! known of flash, not from the store.
//!
//! - Programming lets bits fall, a word at a time, also in a word that is not blank (RM0090
//!   rev. 21, section 3.6.4). Only the erase of a whole sector raises bits (3.6.3).
//! - After a reset in an operation, contents are not guaranteed (3.6). Of a word that was being
//!   programmed, each bit that should fall has fallen or not.
//! - An erase that was interrupted leaves any mixture of raised bits, bits as they were, and
//!   fallen bits: NOR flash is programmed to 0 before it is erased (the Linux change "UBI: fix
//!   NOR flash recovery", for a Spansion S29GL512N).
//! - Such bits stay as they are, or read anew after each start (the "unstable bits" of UBIFS),
//!   until they are programmed to 0 or erased to the end. Programming again the bits that were
//!   to fall makes them fall for good.
//!
//! Not modelled: wear beyond a word that is stuck, disturbed neighbours, and bits that change
//! without a cut.

extern crate std;

use super::{Flash, FlashFault, SECTOR_BYTES, SECTOR_WORDS, Sector};
use std::boxed::Box;
use std::vec;
use std::vec::Vec;

/// Where in an operation the power fails.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cut {
    /// Nothing has changed.
    Before,
    /// Some bits have.
    Inside,
    /// The operation is complete, and the caller is not told.
    After,
}

impl Cut {
    /// Each.
    pub const ALL: [Self; 3] = [Self::Before, Self::Inside, Self::After];
}

/// Random words by a seed (SplitMix64, Steele et al. 2014).
#[derive(Clone, Debug)]
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

    /// A word in which each bit is 1 with the probability `eighths` / 8.
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
    sector: Sector,
    word: usize,
    bits: u32,
    /// They read as 1 with this probability.
    eighths: u32,
}

/// Two sectors, with what a cut of the power leaves in them. Two are equal if they read the same.
#[derive(Clone, Debug)]
pub struct FlashModel {
    bytes: [Box<[u8; SECTOR_BYTES]>; 2],
    weak: Vec<Weak>,
    words: Words,
    /// Whether weak bits read anew after each start.
    unstable: bool,
    /// Operations since the last start.
    pub operations: usize,
    cut: Option<(usize, Cut)>,
    off: bool,
    /// Erases of each sector.
    pub erases: [usize; 2],
    /// A word that neither programming nor an erase changes, without an error.
    pub stuck: Option<(Sector, usize)>,
}

const OFF: FlashFault = FlashFault { status: 0 };

impl FlashModel {
    /// Both sectors as they come from the factory.
    #[must_use]
    pub fn erased() -> Self {
        let sector = || {
            vec![0xff; SECTOR_BYTES]
                .into_boxed_slice()
                .try_into()
                .expect("its size")
        };
        Self {
            bytes: [sector(), sector()],
            weak: Vec::new(),
            words: Words(0),
            unstable: false,
            operations: 0,
            cut: None,
            off: false,
            erases: [0; 2],
            stuck: None,
        }
    }

    /// Contents as a probe writes them.
    ///
    /// # Panics
    /// If they are longer than a sector.
    pub fn load(&mut self, sector: Sector, contents: &[u8]) {
        let bytes = &mut self.bytes[sector as usize];
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
                let word = self.word(weak.sector, weak.word) & !weak.bits | drawn;
                self.put(weak.sector, weak.word, word);
            }
        }
    }

    /// Whether the power has failed since the last start.
    pub const fn is_off(&self) -> bool {
        self.off
    }

    fn word(&self, sector: Sector, word: usize) -> u32 {
        let bytes = &self.bytes[sector as usize][4 * word..4 * word + 4];
        u32::from_le_bytes(bytes.try_into().expect("four"))
    }

    fn put(&mut self, sector: Sector, word: usize, value: u32) {
        if self.stuck == Some((sector, word)) {
            return;
        }
        self.bytes[sector as usize][4 * word..4 * word + 4].copy_from_slice(&value.to_le_bytes());
    }

    /// Whether this operation is cut, and where.
    fn next(&mut self) -> Result<Option<Cut>, FlashFault> {
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
}

impl Flash for FlashModel {
    fn bytes(&self, sector: Sector) -> &[u8; SECTOR_BYTES] {
        &self.bytes[sector as usize]
    }

    fn program(&mut self, sector: Sector, word: usize, value: u32) -> Result<(), FlashFault> {
        let cut = self.next()?;
        let old = self.word(sector, word);
        let falling = old & !value;
        match cut {
            Some(Cut::Before) => {}
            Some(Cut::Inside) => {
                let eighths = self.words.below(9);
                let risen = self.words.biased(eighths) & falling;
                self.put(sector, word, old & !falling | risen);
                self.weak.push(Weak {
                    sector,
                    word,
                    bits: falling,
                    eighths,
                });
            }
            Some(Cut::After) | None => {
                self.put(sector, word, old & value);
                // Bits that are driven to 0, weak ones too, are 0 for good.
                for weak in (self.weak.iter_mut()).filter(|w| (w.sector, w.word) == (sector, word))
                {
                    weak.bits &= value;
                }
            }
        }
        cut.map_or(Ok(()), |_| Err(OFF))
    }

    fn erase(&mut self, sector: Sector) -> Result<(), FlashFault> {
        let cut = self.next()?;
        self.erases[sector as usize] += 1;
        match cut {
            Some(Cut::Before) => {}
            Some(Cut::Inside) => {
                self.weak.retain(|weak| weak.sector != sector);
                // How far it came: bits fall first, in part of the sector, then all rise.
                let eighths = self.words.below(9);
                let falls = self.words.below(3) == 0;
                for word in 0..SECTOR_WORDS {
                    let drawn = self.words.biased(eighths);
                    let old = self.word(sector, word);
                    self.put(sector, word, if falls { old & drawn } else { old | drawn });
                    self.weak.push(Weak {
                        sector,
                        word,
                        bits: u32::MAX,
                        eighths: if self.unstable {
                            self.words.below(9)
                        } else {
                            0
                        },
                    });
                }
            }
            Some(Cut::After) | None => {
                self.weak.retain(|weak| weak.sector != sector);
                for word in 0..SECTOR_WORDS {
                    self.put(sector, word, u32::MAX);
                }
            }
        }
        cut.map_or(Ok(()), |_| Err(OFF))
    }
}

#[test]
fn bits_only_fall_until_the_sector_is_erased() {
    let mut flash = FlashModel::erased();
    for (value, reads) in [
        (0xffff_00ff, 0xffff_00ff),
        (0x0fff_ffff, 0x0fff_00ff),
        (u32::MAX, 0x0fff_00ff),
    ] {
        assert_eq!(flash.program(Sector::First, 7, value), Ok(()));
        assert_eq!(flash.word(Sector::First, 7), reads);
    }
    assert_eq!(flash.erase(Sector::Second), Ok(()));
    assert_eq!(flash.word(Sector::First, 7), 0x0fff_00ff);
    assert_eq!(flash.erase(Sector::First), Ok(()));
    assert_eq!(flash, FlashModel::erased());
}

impl PartialEq for FlashModel {
    fn eq(&self, other: &Self) -> bool {
        self.bytes == other.bytes
    }
}

#[test]
fn a_cut_leaves_bits_between_and_lets_nothing_follow() {
    let wrote = 0x00ff_f00f;
    let mut seen = [false; 3];
    for seed in 0..64 {
        let mut flash = FlashModel::erased();
        flash.seed(seed);
        flash.cut_at(1, Cut::Inside);
        assert_eq!(flash.program(Sector::First, 0, wrote), Ok(()));
        assert_eq!(flash.program(Sector::First, 1, wrote), Err(OFF));
        assert_eq!(flash.program(Sector::First, 2, wrote), Err(OFF));
        assert_eq!(flash.erase(Sector::First), Err(OFF));
        let torn = flash.word(Sector::First, 1);
        assert_eq!(
            (flash.word(Sector::First, 0), flash.word(Sector::First, 2)),
            (wrote, u32::MAX)
        );
        assert_eq!(torn & wrote, wrote);
        seen[0] |= torn == wrote;
        seen[1] |= torn == u32::MAX;
        flash.power_on();
        seen[2] |= flash.word(Sector::First, 1) != torn;
        assert!(flash.unstable || flash.word(Sector::First, 1) == torn);
        // Programmed again, it is as it should be, for good.
        assert_eq!(flash.program(Sector::First, 1, wrote), Ok(()));
        flash.power_on();
        assert_eq!(flash.word(Sector::First, 1), wrote);
    }
    assert_eq!(seen, [true; 3]);
}

#[test]
fn a_cut_erase_leaves_any_mixture_in_its_sector_only() {
    let (mut risen, mut fallen, mut kept) = (0, 0, 0);
    for seed in 0..64 {
        let mut flash = FlashModel::erased();
        flash.seed(seed);
        flash.load(Sector::First, &[0x5a; SECTOR_BYTES]);
        flash.load(Sector::Second, &[0x33; SECTOR_BYTES]);
        flash.cut_at(0, Cut::Inside);
        assert_eq!(flash.erase(Sector::First), Err(OFF));
        assert!(flash.bytes(Sector::Second).iter().all(|&b| b == 0x33));
        for &byte in flash.bytes(Sector::First) {
            risen += (byte & !0x5a).count_ones();
            fallen += (!byte & 0x5a).count_ones();
            kept += (!(byte ^ 0x5a)).count_ones();
        }
        let before = flash.clone();
        flash.power_on();
        assert_eq!(flash == before, !flash.unstable);
        assert_eq!(flash.erase(Sector::First), Ok(()));
        flash.power_on();
        assert!(flash.bytes(Sector::First).iter().all(|&b| b == 0xff));
    }
    assert!(risen > 100_000 && fallen > 100_000 && kept > 100_000);
}
