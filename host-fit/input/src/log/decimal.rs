//! Decimal commas, in tables with semicolons or tabs between cells.

/// Whether the rows in `bytes`, without the header, have decimal commas.
///
/// At least one number must allow no other reading, such as `0,5` and `12,3456`; in `1,234` the comma may separate
/// thousands. No number may have a decimal point or several commas: a factor of a thousand is not guessed.
pub(super) fn has_decimal_commas(bytes: &[u8], separator: u8) -> bool {
    if separator == b',' || !bytes.contains(&b',') {
        return false;
    }
    let cells = bytes.split(|b| *b == separator || *b == b'\n' || *b == b'\r');
    let mut certain = false;
    for number in cells.map(unquoted).filter(|cell| is_number(cell)) {
        let mut parts = number.splitn(2, |b| *b == b',');
        let whole = digits(parts.next().unwrap_or_default());
        match parts.next() {
            None if number.contains(&b'.') => return false,
            None => {}
            Some(rest) if rest.contains(&b',') || number.contains(&b'.') => return false,
            Some(rest) => {
                let grouped =
                    rest.len() == 3 && matches!(whole, [b'1'..=b'9', ..]) && whole.len() <= 3;
                certain |= !grouped;
            }
        }
    }
    certain
}

fn unquoted(cell: &[u8]) -> &[u8] {
    let inside = cell.trim_ascii();
    let inside = inside.strip_prefix(b"\"").unwrap_or(inside);
    inside.strip_suffix(b"\"").unwrap_or(inside).trim_ascii()
}

/// The number without its sign.
fn digits(number: &[u8]) -> &[u8] {
    match number {
        [b'-' | b'+', rest @ ..] => rest,
        rest => rest,
    }
}

/// Whether a cell has digits, and only characters of numbers.
pub(super) fn is_number(cell: &[u8]) -> bool {
    let cell = cell.trim_ascii();
    let part = |b: &u8| b.is_ascii_digit() || b",.+-eE".contains(b);
    cell.iter().all(part) && cell.iter().any(u8::is_ascii_digit)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_comma_is_decimal_only_where_nothing_else_is_possible() {
        for (text, decimal) in [
            ("1;0,5;2\n", true),
            ("1;-12,3456\n", true),
            ("1;\"3,5e-3\"\n", true),
            ("1,234;0,001\n", true),
            ("1234,567\n", true),
            ("1;2;note, by hand\n", false),
            ("1,234;-32,767\n", false),
            ("1,234,567;0,5\n", false),
            ("1.234,5;0,5\n", false),
            ("0,5;1.5\n", false),
            ("1;2\n", false),
        ] {
            assert_eq!(
                has_decimal_commas(text.as_bytes(), b';'),
                decimal,
                "{text:?}"
            );
        }
        assert!(!has_decimal_commas(b"1,5\n", b','));
    }
}
