//! Two sectors of flash, as the store needs them.
//!
//! A word of NOR flash is programmed by letting bits fall from 1 to 0; only the erase of a
//! whole sector raises them. The STM32F405 allows a word to be programmed several times as
//! long as bits only fall (RM0090 rev. 21, section 3.6.4).

/// Bytes of a sector: sectors 1 and 2 of the STM32F405 (RM0090 rev. 21, table 5).
pub const SECTOR_BYTES: usize = 16 * 1024;
/// Words of a sector.
pub const SECTOR_WORDS: usize = SECTOR_BYTES / 4;
/// How an erased word reads.
pub(super) const BLANK: u32 = u32::MAX;

/// One of the two sectors.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Sector {
    /// Parameter slot 0.
    First,
    /// Parameter slot 1.
    Second,
}

impl Sector {
    /// Both.
    pub const ALL: [Self; 2] = [Self::First, Self::Second];

    /// The one that this is not.
    pub const fn other(self) -> Self {
        match self {
            Self::First => Self::Second,
            Self::Second => Self::First,
        }
    }
}

/// The flash refused an operation or did not finish it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FlashFault {
    /// The status register afterwards, FLASH_SR on the STM32F405: its error bits, or BSY if the
    /// operation did not end in time.
    pub status: u32,
}

/// Two sectors that are read as bytes, programmed word by word and erased whole.
///
/// An implementation for the STM32F405 sets PSIZE to x32, which needs at least 2.7 V
/// (RM0090 rev. 21, table 13), clears the error bits before and looks at them after each
/// operation, and waits for BSY a bounded time. An erase takes up to 500 ms, and the core stands
/// still meanwhile if it runs from flash: the watchdog's period must be longer. After each
/// operation it resets the data cache: that holds what was there before an erase, and what a
/// word was to become (section 3.6.4), while what is read back is to come from flash.
pub trait Flash {
    /// The bytes of a sector, as they read now.
    fn bytes(&self, sector: Sector) -> &[u8; SECTOR_BYTES];

    /// Programs the word with the index `word`, 0 to [`SECTOR_WORDS`] - 1: bits that are 0 in
    /// `value` fall, the others stay.
    ///
    /// # Errors
    /// [`FlashFault`]; the word may hold anything between.
    fn program(&mut self, sector: Sector, word: usize, value: u32) -> Result<(), FlashFault>;

    /// Erases a sector: every bit is 1.
    ///
    /// # Errors
    /// [`FlashFault`]; the sector may hold anything.
    fn erase(&mut self, sector: Sector) -> Result<(), FlashFault>;
}

impl<F: Flash> Flash for &mut F {
    fn bytes(&self, sector: Sector) -> &[u8; SECTOR_BYTES] {
        (**self).bytes(sector)
    }

    fn program(&mut self, sector: Sector, word: usize, value: u32) -> Result<(), FlashFault> {
        (**self).program(sector, word, value)
    }

    fn erase(&mut self, sector: Sector) -> Result<(), FlashFault> {
        (**self).erase(sector)
    }
}

/// Why a word or sector does not hold what was written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WriteFault {
    /// The flash reported an error.
    Flash {
        /// Where.
        sector: Sector,
        /// What it reported.
        fault: FlashFault,
    },
    /// No error was reported, and yet the word reads otherwise.
    ReadsOtherwise {
        /// Where.
        sector: Sector,
        /// Which word of the sector.
        word: usize,
        /// What was written.
        wrote: u32,
        /// What is read.
        reads: u32,
    },
}

/// The little-endian word with this index; [`BLANK`] outside.
#[cfg_attr(target_os = "none", inline(never))]
pub(super) fn word_of(bytes: &[u8], index: usize) -> u32 {
    (index.checked_mul(4))
        .and_then(|at| bytes.get(at..)?.first_chunk())
        .map_or(BLANK, |bytes| u32::from_le_bytes(*bytes))
}

/// Programs a word and reads it back.
#[inline(never)]
pub(super) fn program(
    flash: &mut impl Flash,
    sector: Sector,
    word: usize,
    value: u32,
) -> Result<(), WriteFault> {
    (flash.program(sector, word, value)).map_err(|fault| WriteFault::Flash { sector, fault })?;
    expect(flash, sector, word, value)
}

/// Erases a sector and reads it back.
pub(super) fn erase(flash: &mut impl Flash, sector: Sector) -> Result<(), WriteFault> {
    (flash.erase(sector)).map_err(|fault| WriteFault::Flash { sector, fault })?;
    (0..SECTOR_WORDS).try_for_each(|word| expect(flash, sector, word, BLANK))
}

/// Refuses a word that does not read as it was written.
pub(super) fn expect(
    flash: &impl Flash,
    sector: Sector,
    word: usize,
    wrote: u32,
) -> Result<(), WriteFault> {
    let reads = word_of(flash.bytes(sector), word);
    if reads == wrote {
        Ok(())
    } else {
        Err(WriteFault::ReadsOtherwise {
            sector,
            word,
            wrote,
            reads,
        })
    }
}
