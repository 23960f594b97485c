//! How a table writes its numbers: decimal points or commas, with or without marks between thousands.

use super::lines::lines_of;
use super::record::Record;

/// How the numbers of a table are written.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct NumberForm {
    /// Whether commas are decimal.
    pub(super) decimal_commas: bool,
    /// Whether the other one of comma and point stands between thousands.
    pub(super) has_groups: bool,
}

impl NumberForm {
    /// Of the numbers in the rows `bytes`, without the header.
    ///
    /// A comma is decimal where at least one number allows no other reading, such as `0,5`, `12,3456` and `1.234,5`.
    /// It stands between thousands where one has two groups or a decimal point, too. Where numbers contradict each
    /// other, and for `1,234` alone, a factor of a thousand is not guessed.
    pub(super) fn new(bytes: &[u8], separator: u8) -> Self {
        let quoted = separator != b',' || bytes.contains(&b'"');
        if !quoted || !bytes.contains(&b',') {
            return Self::default();
        }
        let mut record = Record::new(separator, Self::default());
        let [mut commas, mut points] = [Use::default(); 2];
        for line in lines_of(bytes) {
            record.split(line.text);
            for cell in record.cells().filter(|cell| is_number(cell.text)) {
                let text = cell.text.trim_ascii();
                commas.count(text, b',', b'.');
                points.count(text, b'.', b',');
            }
        }
        let decimal_commas = commas.is_decimal && !commas.groups && !points.is_decimal;
        Self {
            decimal_commas,
            has_groups: match decimal_commas {
                true => points.groups,
                false => commas.groups && !commas.is_decimal && !points.groups,
            },
        }
    }

    /// The number in a text, with or without marks between thousands. White space and apostrophes can be nothing else.
    pub(super) fn number(self, text: &[u8]) -> Option<f64> {
        let with_point = |byte: &u8| if *byte == b',' { b'.' } else { *byte };
        let plain = match self.decimal_commas {
            false => fast_float2::parse(text),
            true if text.contains(&b'.') => fast_float2::parse(""),
            true => fast_float2::parse(text.iter().map(with_point).collect::<Vec<u8>>()),
        };
        plain.ok().or_else(|| self.in_groups(text))
    }

    #[cold]
    fn in_groups(self, text: &[u8]) -> Option<f64> {
        let text = super::words::text(text).replace('\u{2212}', "-");
        let (decimal, group) = match self.decimal_commas {
            true => (',', '.'),
            false => ('.', ','),
        };
        let is_group = |c: char| {
            c.is_whitespace() || "'\u{2019}".contains(c) || (self.has_groups && c == group)
        };
        let end = text.find([decimal, 'e', 'E']).unwrap_or(text.len());
        let (whole, rest) = text.split_at(end);
        let digits = whole.trim_start_matches(['-', '+']);
        let mut parts = digits.split(is_group);
        let first = parts.next()?;
        // `0,234` is no number with groups: a factor of a thousand is not guessed.
        let leads = first.len() <= 3 && first.starts_with(|c| matches!(c, '1'..='9'));
        let is_sound = parts.clone().all(|part| part.len() == 3)
            && (leads || parts.next().is_none())
            && digits.chars().all(|c| c.is_ascii_digit() || is_group(c));
        let plain = whole.replace(is_group, "") + &rest.replace(decimal, ".");
        fast_float2::parse(plain).ok().filter(|_| is_sound)
    }
}

/// What a mark stands for.
#[derive(Clone, Copy, Default)]
struct Use {
    is_decimal: bool,
    groups: bool,
}

impl Use {
    /// Counts what a number with `mark`, perhaps beside the `other` mark, says for sure.
    fn count(&mut self, number: &[u8], mark: u8, other: u8) {
        let mut parts = number.split(|byte| *byte == mark);
        let whole = digits(parts.next().unwrap_or_default());
        match (parts.next(), parts.next()) {
            (None, _) => {}
            (Some(rest), None) if rest.contains(&other) => self.groups = true,
            (Some(rest), None) => {
                let is_grouped =
                    rest.len() == 3 && matches!(whole, [b'1'..=b'9', ..]) && whole.len() <= 3;
                self.is_decimal |= !is_grouped;
            }
            _ => self.groups = true,
        }
    }
}

/// The number without its sign.
fn digits(number: &[u8]) -> &[u8] {
    match number {
        [b'-' | b'+', rest @ ..] => rest,
        rest => rest,
    }
}

/// Whether a cell has digits, and only characters of numbers: also bytes of a minus sign, spaces and an apostrophe
/// beyond ASCII.
pub(super) fn is_number(cell: &[u8]) -> bool {
    let cell = cell.trim_ascii();
    let beyond = b"\xc2\xa0\xe2\x80\xaf\x89\x99\x88\x92";
    let part = |b: &u8| b.is_ascii_digit() || b",.+-eE '".contains(b) || beyond.contains(b);
    cell.iter().all(part) && cell.iter().any(u8::is_ascii_digit)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_comma_is_decimal_or_between_thousands_only_where_nothing_else_is_possible() {
        for (text, decimal_commas, has_groups) in [
            ("1;0,5;2\n", true, false),
            ("1;-12,3456\n", true, false),
            ("1;\"3,5e-3\"\n", true, false),
            ("1,234;0,001\n", true, false),
            ("1234,567\n", true, false),
            ("1;2;note, by hand\n", false, false),
            ("1,234;-32,767\n", false, false),
            ("1,234,567;0,5\n", false, false),
            ("1.234,5;0,5\n", true, true),
            ("1.234;0,5\n", true, false),
            ("1,234.5;0.5\n", false, true),
            ("1,234,567;8\n", false, true),
            ("1,234.5;1.234,5\n", false, false),
            ("0,5;1.5\n", false, false),
            ("1;2\n", false, false),
        ] {
            let want = NumberForm {
                decimal_commas,
                has_groups,
            };
            let have = NumberForm::new(text.as_bytes(), b';');
            assert_eq!(have, want, "{text:?}");
        }
        assert_eq!(NumberForm::new(b"1,5\n", b','), NumberForm::default());
        assert!(NumberForm::new(b"\"1,5\",2\n", b',').decimal_commas);
    }

    #[test]
    fn marks_between_thousands_stand_before_three_digits_each() {
        let form = |decimal_commas, has_groups| NumberForm {
            decimal_commas,
            has_groups,
        };
        for (text, form, want) in [
            ("1 234.5", form(false, false), Some(1234.5)),
            ("-1'234'567", form(false, false), Some(-1_234_567.0)),
            ("1\u{202f}234,5", form(true, false), Some(1234.5)),
            ("\u{2212}1\u{a0}234,5e-1", form(true, false), Some(-123.45)),
            ("1,234.5", form(false, true), Some(1234.5)),
            ("-1.234,5", form(true, true), Some(-1234.5)),
            ("1,234", form(false, true), Some(1234.0)),
            ("0.5", form(true, true), None),
            ("\u{2212}0,5", form(true, true), Some(-0.5)),
            ("0,234", form(false, true), None),
            (",234", form(false, true), None),
            ("-,234.5", form(false, true), None),
            (".234", form(true, true), None),
            ("012,345", form(false, true), None),
            ("0 234", form(false, false), None),
            ("1,234", form(false, false), None),
            ("1.234", form(true, false), None),
            ("1.5", form(true, true), None),
            ("12 34", form(false, false), None),
            ("1234 567", form(false, false), None),
            ("1 234 5", form(false, false), None),
            ("1,234.5", form(true, true), None),
            ("1 m 234", form(false, false), None),
            ("", form(true, true), None),
        ] {
            assert_eq!(form.number(text.as_bytes()), want, "{text}");
        }
        assert_eq!(form(true, false).number(b"1\xa0234,5"), Some(1234.5));
    }
}
