//! Text in UTF-16, as spreadsheets and instruments under Windows save it, turned into UTF-8.

use std::borrow::Cow;
use std::ops::Range;

/// The first bytes of UTF-16, and whether the low byte of a character comes first.
const MARKS: [([u8; 2], bool); 2] = [([0xff, 0xfe], true), ([0xfe, 0xff], false)];

/// Without such a mark: so many characters of Latin-1 at the start tell UTF-16 from binary data.
const PROBE_CHARACTERS: usize = 8;

/// The order of the bytes of UTF-16, and how many bytes its mark has; `None` for other text.
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

/// Whether a text that starts like this is UTF-16.
pub(super) fn is_utf16(start: &[u8]) -> bool {
    byte_order(start).is_some()
}

/// The text as UTF-8 where it is UTF-16, with either order of bytes, and as it is where it is
/// not.
///
/// # Errors
/// The first bytes that are no character, from 0.
pub(super) fn to_utf8(bytes: &[u8]) -> Result<Cow<'_, [u8]>, Range<usize>> {
    let Some((low_first, mark)) = byte_order(bytes) else {
        return Ok(bytes.into());
    };
    let (pairs, rest) = bytes.get(mark..).unwrap_or_default().as_chunks::<2>();
    if !rest.is_empty() {
        return Err(bytes.len() - rest.len()..bytes.len());
    }
    let unit = |pair: &[u8; 2]| match low_first {
        true => u16::from_le_bytes(*pair),
        false => u16::from_be_bytes(*pair),
    };
    let mut text = String::with_capacity(pairs.len());
    let mut units = 0;
    for character in char::decode_utf16(pairs.iter().map(unit)) {
        let at = mark + 2 * units;
        let character = character.map_err(|_| at..at + 2)?;
        units += character.len_utf16();
        text.push(character);
    }
    Ok(text.into_bytes().into())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn utf_16_of_either_order_with_and_without_a_mark_becomes_utf_8() {
        let text = "ifm_x [\u{b5}m]\t\u{3bc}rad\r\n\u{1f600}";
        let little: Vec<u8> = text.encode_utf16().flat_map(u16::to_le_bytes).collect();
        let big: Vec<u8> = text.encode_utf16().flat_map(u16::to_be_bytes).collect();
        for (mark, bytes) in [([0xff, 0xfe], &little), ([0xfe, 0xff], &big)] {
            assert!(is_utf16(bytes));
            assert_eq!(to_utf8(bytes).as_deref(), Ok(text.as_bytes()));
            let marked = [&mark[..], bytes].concat();
            assert_eq!(to_utf8(&marked).as_deref(), Ok(text.as_bytes()));
            assert_eq!(to_utf8(&marked[..marked.len() - 1]), Err(38..39));
            assert_eq!(to_utf8(&marked[..marked.len() - 2]), Err(36..38));
        }
        for other in [text, "", "a", "0,1,2,3,4,5,6,7,8,9"] {
            assert!(!is_utf16(other.as_bytes()));
            assert_eq!(to_utf8(other.as_bytes()).as_deref(), Ok(other.as_bytes()));
        }
    }
}
