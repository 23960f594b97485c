//! The parameters in RAM against their check, a word a tick: a bit that flips is found within two passes, 0.6 s.

use crc::Digest;
use stage_node::records::Loaded;
use stage_node::store::CRC;

const WORDS: usize = size_of::<Loaded>() / 4;

/// The check of the words until now, and the expected check of all words.
pub struct Constants {
    start: usize,
    next: usize,
    digest: Digest<'static, u32>,
    expected: u32,
}

impl Constants {
    /// Of parameters that were loaded just now and never change again.
    pub fn new(loaded: &'static Loaded) -> Self {
        let mut new = Self {
            start: core::ptr::from_ref(loaded).addr(),
            next: 0,
            digest: CRC.digest(),
            expected: 0,
        };
        while new.next < WORDS {
            new.take_word();
        }
        new.expected = new.end();
        new
    }

    /// Takes the next word. After the last word: whether all are unchanged; else true.
    pub fn are_sound(&mut self) -> bool {
        self.take_word();
        self.next < WORDS || self.end() == self.expected
    }

    fn take_word(&mut self) {
        let word: u32;
        // SAFETY: a word of a static. By assembler, because the bytes between fields have no value in Rust.
        unsafe {
            core::arch::asm!(
                "ldr {}, [{}]",
                out(reg) word,
                in(reg) self.start + 4 * self.next,
                options(nostack, readonly, preserves_flags)
            );
        }
        self.digest.update(&word.to_le_bytes());
        self.next += 1;
    }

    fn end(&mut self) -> u32 {
        self.next = 0;
        core::mem::replace(&mut self.digest, CRC.digest()).finalize()
    }
}
