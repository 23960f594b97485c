//! Text in UTF-16, as spreadsheets and instruments under Windows save it, turned into UTF-8.

/// Marks of UTF-16, and whether the low byte of a character comes first.
const MARKS: [([u8; 2], bool); 2] = [([0xff, 0xfe], true), ([0xfe, 0xff], false)];

/// Number of Latin-1 characters at the start that distinguish UTF-16 without a mark from binary data.
const PROBE_CHARACTERS: usize = 8;

/// Whether the low byte of UTF-16 comes first, and the length of its mark; `None` for other text.
fn byte_order(bytes: &[u8]) -> Option<(bool, usize)> {
    if let Some((mark, low_first)) = MARKS.iter().find(|(mark, _)| bytes.starts_with(mark)) {
        return Some((*low_first, mark.len()));
    }
    let start = bytes.get(..2 * PROBE_CHARACTERS)?;
    let latin = |byte: u8| matches!(byte, b'\t' | b'\n' | b'\r' | b' '..=b'~' | 0xa0..);
    let low_first = |pair: &[u8]| matches!(pair, [low, 0] if latin(*low));
    let high_first = |pair: &[u8]| matches!(pair, [0, low] if latin(*low));
    let (pairs, _) = start.as_chunks::<2>();
    if pairs.iter().all(|pair| low_first(pair)) {
        return Some((true, 0));
    }
    (pairs.iter().all(|pair| high_first(pair))).then_some((false, 0))
}

/// Decodes UTF-16 piece by piece.
#[derive(Clone, Debug)]
pub(super) struct Utf16 {
    low_first: bool,
    /// Number of bytes so far, with the mark.
    taken: usize,
    /// Bytes at the end of the last piece that are half a character.
    rest: Vec<u8>,
}

impl Utf16 {
    /// A decoder for a text with this start, and the length of its mark; `None` for other text.
    pub(super) fn from_start(start: &[u8]) -> Option<(Self, usize)> {
        let (low_first, mark) = byte_order(start)?;
        let decoder = Self {
            low_first,
            taken: mark,
            rest: Vec::new(),
        };
        Some((decoder, mark))
    }

    /// Appends the next piece to `text` as UTF-8; `is_last`: nothing follows.
    ///
    /// # Errors
    /// The offset of the first byte that is no character.
    pub(super) fn append(
        &mut self,
        piece: &[u8],
        is_last: bool,
        text: &mut Vec<u8>,
    ) -> Result<(), usize> {
        self.rest.extend_from_slice(piece);
        let bytes = std::mem::take(&mut self.rest);
        let (pairs, odd) = bytes.as_chunks::<2>();
        let unit = |pair: &[u8; 2]| match self.low_first {
            true => u16::from_le_bytes(*pair),
            false => u16::from_be_bytes(*pair),
        };
        let first_half = |pair: &&[u8; 2]| (0xd800..0xdc00).contains(&unit(pair));
        let half = pairs.last().filter(first_half).filter(|_| !is_last);
        let whole = pairs.len() - usize::from(half.is_some());
        if is_last && !odd.is_empty() {
            return Err(self.taken + bytes.len() - odd.len());
        }
        let pairs = pairs.get(..whole).unwrap_or_default();
        for character in char::decode_utf16(pairs.iter().map(unit)) {
            let character = character.map_err(|_| self.taken)?;
            self.taken += 2 * character.len_utf16();
            text.extend_from_slice(character.encode_utf8(&mut [0; 4]).as_bytes());
        }
        self.rest = bytes.get(2 * whole..).unwrap_or_default().to_vec();
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The text, decoded in pieces of `piece` bytes; `None` if it is not UTF-16.
    fn decoded(bytes: &[u8], piece: usize) -> Option<Result<Vec<u8>, usize>> {
        let (mut decoder, mark) = Utf16::from_start(bytes)?;
        let mut text = Vec::new();
        for piece in bytes[mark..].chunks(piece) {
            if let Err(place) = decoder.append(piece, false, &mut text) {
                return Some(Err(place));
            }
        }
        let end = decoder.append(&[], true, &mut text);
        Some(end.map(|()| text))
    }

    #[test]
    fn utf_16_of_either_order_with_and_without_a_mark_becomes_utf_8() {
        let text = "ifm_x [\u{b5}m]\t\u{3bc}rad\r\n\u{1f600}";
        let little: Vec<u8> = text.encode_utf16().flat_map(u16::to_le_bytes).collect();
        let big: Vec<u8> = text.encode_utf16().flat_map(u16::to_be_bytes).collect();
        let want = Some(Ok(text.as_bytes().to_vec()));
        for (mark, bytes) in [([0xff, 0xfe], &little), ([0xfe, 0xff], &big)] {
            for piece in [1, 2, 3, 5, 1000] {
                assert_eq!(decoded(bytes, piece), want);
                let marked = [&mark[..], bytes].concat();
                assert_eq!(decoded(&marked, piece), want);
                let cut = |bytes: usize| decoded(&marked[..marked.len() - bytes], piece);
                assert_eq!(cut(1), Some(Err(38)));
                assert_eq!(cut(2), Some(Err(36)));
            }
        }
        for other in [text, "", "a", "0,1,2,3,4,5,6,7,8,9"] {
            assert_eq!(decoded(other.as_bytes(), 7), None);
        }
    }
}
