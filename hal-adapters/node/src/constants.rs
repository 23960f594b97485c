//! The decoder in RAM against its check, a word a tick: a bit that flips is found within two passes, 0.6 s.

use crc::Digest;
use runtime::AnyDecoder;
use runtime::blob::CRC;

/// Words of the decoder.
pub const WORDS: usize = size_of::<AnyDecoder>() / 4;

/// The check of the words until now, and of all words at the first pass.
#[derive(Clone)]
pub struct Constants {
    next: usize,
    digest: Digest<'static, u32>,
    expected: Option<u32>,
}

impl Default for Constants {
    fn default() -> Self {
        Self {
            next: 0,
            digest: CRC.digest(),
            expected: None,
        }
    }
}

impl Constants {
    /// Takes the next word of a decoder that stays where it is. After the last word: whether all are unchanged; else true.
    /// The first call takes all words.
    pub fn are_sound(&mut self, decoder: &AnyDecoder) -> bool {
        let start = core::ptr::from_ref(decoder).addr();
        self.take(|k| word(start + 4 * k))
    }

    fn take(&mut self, word: impl Fn(usize) -> u32) -> bool {
        let mut take_next = || {
            self.digest.update(&word(self.next).to_le_bytes());
            self.next += 1;
        };
        let Some(expected) = self.expected else {
            (0..WORDS).for_each(|_| take_next());
            self.expected = Some(self.end());
            return true;
        };
        take_next();
        self.next < WORDS || self.end() == expected
    }

    fn end(&mut self) -> u32 {
        self.next = 0;
        core::mem::replace(&mut self.digest, CRC.digest()).finalize()
    }
}

/// A word of a decoder. By assembler, because the bytes between fields have no value in Rust.
#[cfg(any(target_arch = "arm", target_arch = "riscv32"))]
fn word(at: usize) -> u32 {
    let word: u32;
    // SAFETY: reads an aligned word of a value that the caller borrows.
    unsafe {
        #[cfg(target_arch = "arm")]
        core::arch::asm!("ldr {}, [{}]", out(reg) word, in(reg) at, options(nostack, readonly, preserves_flags));
        #[cfg(target_arch = "riscv32")]
        core::arch::asm!("lw {}, 0({})", out(reg) word, in(reg) at, options(nostack, readonly, preserves_flags));
    }
    word
}

/// On other cores, a host's for one, memory is not checked.
#[cfg(not(any(target_arch = "arm", target_arch = "riscv32")))]
const fn word(_: usize) -> u32 {
    0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn any_word_that_changes_is_found_within_two_passes() {
        for changed in 0..WORDS {
            let mut constants = Constants::default();
            assert!((0..3 * WORDS).all(|_| constants.take(|k| k as u32)));
            let word = |k| k as u32 ^ u32::from(k == changed) << 20;
            assert!((0..2 * WORDS).any(|_| !constants.take(word)), "{changed}");
        }
    }
}
