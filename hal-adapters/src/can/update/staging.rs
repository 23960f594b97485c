//! A blob and its tag in RAM while their words arrive.

use super::authentication::TAG_BYTES;
use runtime::blob::{CRC_BYTES, MAX_BYTES};

/// Bytes of a word.
pub(super) const WORD: usize = 4;
/// Words of the largest blob.
const WORDS_MAX: usize = MAX_BYTES.div_ceil(WORD);
const TAG_WORDS: usize = TAG_BYTES / WORD;
/// Words of a blob and of its tag.
const WORDS: usize = WORDS_MAX + TAG_WORDS;

/// Index of the tag's first word.
pub const TAG_INDEX: u8 = 240;
const _: () = assert!(WORDS_MAX <= TAG_INDEX as usize);

/// The words that arrived: of the blob, then of the tag.
#[derive(Clone, Debug)]
pub(super) struct Staging {
    words: [[u8; WORD]; WORDS],
    is_there: [bool; WORDS],
}

/// The place of a word by its index; `None` beyond a blob of `bytes` bytes and its tag.
fn place(index: u8, bytes: usize) -> Option<usize> {
    let k = usize::from(index);
    match k.checked_sub(usize::from(TAG_INDEX)) {
        Some(k) => (k < TAG_WORDS).then_some(WORDS_MAX + k),
        None => (k < bytes.div_ceil(WORD)).then_some(k),
    }
}

impl Staging {
    /// No word yet.
    pub(super) const EMPTY: Self = Self {
        words: [[0; WORD]; WORDS],
        is_there: [false; WORDS],
    };

    /// Forgets all words.
    pub(super) const fn clear(&mut self) {
        *self = Self::EMPTY;
    }

    /// Forgets the tag.
    pub(super) fn clear_tag(&mut self) {
        for is_there in self.is_there.iter_mut().skip(WORDS_MAX) {
            *is_there = false;
        }
    }

    /// Keeps a word of a blob of `bytes` bytes, or of the tag. Ignores any other index.
    pub(super) fn put(&mut self, index: u8, word: u32, bytes: usize) {
        if let Some(k) = place(index, bytes)
            && let (Some(to), Some(is_there)) = (self.words.get_mut(k), self.is_there.get_mut(k))
        {
            (*to, *is_there) = (word.to_le_bytes(), true);
        }
    }

    /// Index of the first missing word of a blob of `bytes` bytes, and of its tag if `with_tag`.
    pub(super) fn missing(&self, bytes: usize, with_tag: bool) -> Option<u8> {
        let indices = 0..=if with_tag { u8::MAX } else { TAG_INDEX - 1 };
        let is_there = |k: usize| self.is_there.get(k).copied().unwrap_or(false);
        indices
            .into_iter()
            .find(|index| place(*index, bytes).is_some_and(|k| !is_there(k)))
    }

    /// The blob.
    pub(super) fn blob(&self, bytes: usize) -> &[u8] {
        self.words.as_flattened().get(..bytes).unwrap_or_default()
    }

    /// The tag.
    pub(super) fn tag(&self) -> [u8; TAG_BYTES] {
        // Always the last sixteen bytes.
        let words = self.words.as_flattened();
        *words.last_chunk().unwrap_or(&[0; TAG_BYTES])
    }
}

/// The CRC-32C in the last bytes of a blob.
pub fn blob_crc(blob: &[u8]) -> Option<u32> {
    blob.last_chunk::<CRC_BYTES>()
        .copied()
        .map(u32::from_le_bytes)
}

/// Word `index` of `bytes`; the last one is padded with zeros.
pub fn word_at(bytes: &[u8], index: usize) -> Option<u32> {
    let chunk = bytes.chunks(WORD).nth(index)?;
    let mut word = [0; WORD];
    for (to, from) in word.iter_mut().zip(chunk) {
        *to = *from;
    }
    Some(u32::from_le_bytes(word))
}
