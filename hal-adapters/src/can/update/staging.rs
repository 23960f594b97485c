//! A blob and its tag in RAM while their words arrive.

use super::authentication::TAG_BYTES;
use runtime::blob::{CRC_BYTES, MAX_BYTES};

/// Bytes of a word.
pub(super) const WORD: usize = 4;
/// Words of the largest blob.
const WORDS_MAX: usize = MAX_BYTES.div_ceil(WORD);
const TAG_WORDS: usize = TAG_BYTES / WORD;
/// Words of a blob and of its tag.
const NOTED: usize = WORDS_MAX + TAG_WORDS;

/// Index of the tag's first word.
pub const TAG_INDEX: u8 = 240;
const _: () = assert!(WORDS_MAX <= TAG_INDEX as usize);

/// The words that arrived, and which.
#[derive(Clone, Debug)]
pub(super) struct Staging {
    blob: [[u8; WORD]; WORDS_MAX],
    tag: [[u8; WORD]; TAG_WORDS],
    /// One bit for each word of the blob, then for each of the tag.
    there: [u8; NOTED.div_ceil(8)],
}

impl Staging {
    /// No word yet.
    pub(super) const EMPTY: Self = Self {
        blob: [[0; WORD]; WORDS_MAX],
        tag: [[0; WORD]; TAG_WORDS],
        there: [0; NOTED.div_ceil(8)],
    };

    /// Forgets all words.
    pub(super) const fn clear(&mut self) {
        *self = Self::EMPTY;
    }

    /// Forgets the tag.
    pub(super) fn clear_tag(&mut self) {
        for k in 0..TAG_WORDS {
            self.note(WORDS_MAX + k, false);
        }
    }

    /// Keeps a word of a blob of `bytes` bytes, or of the tag. Ignores any other index.
    pub(super) fn put(&mut self, index: u8, word: u32, bytes: usize) {
        let k = usize::from(index);
        let in_tag = k.checked_sub(usize::from(TAG_INDEX));
        let (to, noted) = match in_tag {
            Some(k) => (self.tag.get_mut(k), WORDS_MAX + k),
            None if k < bytes.div_ceil(WORD) => (self.blob.get_mut(k), k),
            None => return,
        };
        if let Some(to) = to {
            *to = word.to_le_bytes();
            self.note(noted, true);
        }
    }

    fn note(&mut self, noted: usize, is_there: bool) {
        if let Some(there) = self.there.get_mut(noted / 8) {
            let bit = 1 << (noted % 8);
            *there = if is_there {
                *there | bit
            } else {
                *there & !bit
            };
        }
    }

    fn is_there(&self, noted: usize) -> bool {
        let there = self.there.get(noted / 8);
        there.is_some_and(|bits| bits >> (noted % 8) & 1 == 1)
    }

    /// Index of the first missing word of a blob of `bytes` bytes, and of its tag if `with_tag`.
    pub(super) fn missing(&self, bytes: usize, with_tag: bool) -> Option<u8> {
        let blob = (0..bytes.div_ceil(WORD)).map(|k| (k, k));
        let tag = (0..TAG_WORDS).map(|k| (usize::from(TAG_INDEX) + k, WORDS_MAX + k));
        let tag = tag.filter(|_| with_tag);
        let (index, _) = blob.chain(tag).find(|(_, noted)| !self.is_there(*noted))?;
        u8::try_from(index).ok()
    }

    /// The blob.
    pub(super) fn blob(&self, bytes: usize) -> &[u8] {
        let whole = self.blob.as_flattened();
        whole.get(..bytes).unwrap_or(whole)
    }

    /// The tag.
    pub(super) fn tag(&self) -> [u8; TAG_BYTES] {
        // Always sixteen bytes.
        *self
            .tag
            .as_flattened()
            .first_chunk()
            .unwrap_or(&[0; TAG_BYTES])
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
