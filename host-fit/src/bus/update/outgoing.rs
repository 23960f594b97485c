//! The words of a transfer: those of the blob, then those of the tag.

use super::plan::Plan;
use hal_adapters::can::update::{Key, Nonce, TAG_INDEX, UpdateData, tag, word_of};
use std::collections::VecDeque;

/// What is still to be sent of a transfer.
#[derive(Debug, Default)]
pub(super) struct Outgoing {
    blob: Vec<u8>,
    key: Option<Key>,
    /// What came of the node's nonce.
    nonce: Vec<u32>,
    words: VecDeque<UpdateData>,
    /// How often a word was asked for again.
    pub(super) resent: u32,
}

impl Outgoing {
    /// Before a transfer.
    pub(super) fn new(plan: &Plan) -> Self {
        Self {
            blob: plan.wanted.blob().to_vec(),
            key: plan.key,
            ..Self::default()
        }
    }

    /// Length of the blob, bytes.
    pub(super) const fn bytes(&self) -> usize {
        self.blob.len()
    }

    /// Words still to be sent, and all that there are.
    pub(super) fn left(&self) -> (u64, u64) {
        let total = self.blob.len().div_ceil(4) as u64 + 4;
        (self.words.len() as u64, total)
    }

    /// Another transfer begins.
    pub(super) fn begin(&mut self) {
        self.nonce.clear();
        self.words.clear();
    }

    /// Which word of the nonce is to be asked for; `None` once all are there.
    pub(super) fn challenge(&self) -> Option<u8> {
        (self.nonce.len() < size_of::<Nonce>() / 4).then_some(self.nonce.len() as u8)
    }

    /// Takes the word of the nonce that was asked for.
    pub(super) fn take(&mut self, word: u32) {
        self.nonce.push(word);
    }

    /// All words, under this token.
    pub(super) fn fill(&mut self, token: u8, sequence: u32, crc: u32) {
        let words = words(token, &self.blob, 0);
        self.words.extend(words);
        self.add_tag(token, sequence, crc);
    }

    /// What was lost, once more: a word of the blob, or the tag, which is short.
    pub(super) fn resend(&mut self, index: u32, token: u8, sequence: u32, crc: u32) {
        self.resent += 1;
        if index >= TAG_INDEX.into() {
            return self.add_tag(token, sequence, crc);
        }
        let lost = words(token, &self.blob, 0).find(|data| u32::from(data.index) == index);
        self.words.extend(lost);
    }

    /// The next word.
    pub(super) fn next(&mut self) -> Option<UpdateData> {
        self.words.pop_front()
    }

    fn add_tag(&mut self, token: u8, sequence: u32, crc: u32) {
        if let (Some(key), &[a, b, c, d]) = (&self.key, &self.nonce[..]) {
            let tag = tag(key, &[a, b, c, d], sequence, &self.blob, crc);
            self.words.extend(words(token, &tag, TAG_INDEX));
        }
    }
}

/// The words of `bytes`, whose first has this index.
fn words(token: u8, bytes: &[u8], first: u8) -> impl Iterator<Item = UpdateData> {
    (0..).map_while(move |k| {
        let (index, word) = (first.checked_add(k)?, word_of(bytes, k.into())?);
        Some(UpdateData { token, index, word })
    })
}
