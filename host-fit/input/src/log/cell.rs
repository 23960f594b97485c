//! One cell of a log as a number, or what is wrong with it.

use super::decimal::{self, NumberForm};
use super::layout::Dimension;
use crate::axis::sign;
use crate::stage::CodeScale;

/// A fault of one cell.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum CellFault {
    /// It is empty.
    #[error("the cell is empty; fill it in or remove the row")]
    Empty,
    /// It holds no number.
    #[error(
        "\"{text}\" is not a number; correct it or remove the row{}",
        comma_hint(text)
    )]
    NotANumber {
        /// Its text, shortened.
        text: String,
    },
    /// A decimal point, after decimal commas in the first rows.
    #[error(
        "\"{text}\" has a decimal point, where the first rows of the log have decimal commas; write all numbers alike, without marks between thousands"
    )]
    DecimalPoint {
        /// Its text, shortened.
        text: String,
    },
    /// It holds no time.
    #[error(
        "\"{text}\" is no time that is read; write a number in {}, a date and time such as 2026-01-31T03:04:05.678, 2026/01/31 03:04:05.678, 31.01.2026 03:04:05.678 or 31-Jan-2026 03:04:05.678, or a duration such as 0:00:05.678 or 5.678 s; in 01/02/2026 the month is not certain",
        Dimension::Time.units()
    )]
    NotATime {
        /// Its text, shortened.
        text: String,
    },
    /// A time in another form than the first time of the log.
    #[error(
        "\"{text}\" is a time written in another way than the first time of the log; write all as numbers, all as dates and times with a zone, or all without"
    )]
    OtherTime {
        /// Its text, shortened.
        text: String,
    },
    /// A word for a missing value, such as NaN.
    #[error("\"{text}\" stands for a missing value; remove the row")]
    Missing {
        /// The word.
        text: String,
    },
    /// An infinity.
    #[error("\"{text}\" is infinite; remove the row")]
    Infinite {
        /// Its text.
        text: String,
    },
    /// A fraction where codes or indices are whole.
    #[error(
        "{value} is not a whole number; this column holds {what}, check the [log] table of stage.toml"
    )]
    NotWhole {
        /// The value.
        value: f64,
        /// What the column holds.
        what: &'static str,
    },
    /// Beyond every sensible magnitude.
    #[error(
        "{value:e}{0} is absurd (more than {limit:e}{0}); remove the row, or check the column's unit in the [log] table of stage.toml",
        spaced(unit)
    )]
    Absurd {
        /// The value, in `unit`.
        value: f64,
        /// The largest sensible magnitude.
        limit: f64,
        /// The unit of both.
        unit: &'static str,
    },
    /// A temperature that no stage has.
    #[error(
        "{celsius:.0} \u{b0}C cannot be right. Is the column in {}? Set unit = \"{unit}\" in [temperature].",
        unit.replace('C', "\u{b0}C")
    )]
    Temperature {
        /// The temperature, degC.
        celsius: f64,
        /// The unit that the column may have.
        unit: &'static str,
    },
    /// A code that the converter cannot give.
    #[error(
        "code {code} is outside the converter's range {code_min} to {code_max}; remove the row, or correct code_min and code_max in stage.toml"
    )]
    OutsideConverter {
        /// The code.
        code: i64,
        /// Smallest code of the converter.
        code_min: i32,
        /// Largest code of the converter.
        code_max: i32,
    },
    /// A code at the end of the converter's range.
    #[error(
        "code {code} is at the converter's rail: the sensor is saturated; record the movement again, or skip such rows with --bad-rows skip"
    )]
    Saturated {
        /// The code.
        code: i32,
    },
}

impl CellFault {
    /// Whether a code is outside the decoded range.
    pub(super) const fn is_code(&self) -> bool {
        matches!(self, Self::OutsideConverter { .. } | Self::Saturated { .. })
    }

    /// Whether a cell holds no number.
    pub(super) const fn is_text(&self) -> bool {
        matches!(
            self,
            Self::Empty
                | Self::Missing { .. }
                | Self::NotANumber { .. }
                | Self::NotATime { .. }
                | Self::DecimalPoint { .. }
        )
    }

    /// The reason to leave a row out, in words.
    pub(super) const fn reason(&self) -> &'static str {
        match self {
            Self::Empty => "an empty cell",
            Self::NotANumber { .. } | Self::DecimalPoint { .. } => "a cell that is not a number",
            Self::NotATime { .. } => "a time that cannot be read",
            Self::OtherTime { .. } => "a time written in another way than the first",
            Self::Missing { .. } | Self::Infinite { .. } => "a missing value or an infinity",
            Self::NotWhole { .. } => "a fraction where a whole number belongs",
            Self::Absurd { .. } | Self::Temperature { .. } => "an absurd number",
            Self::OutsideConverter { .. } => "a code outside the converter's range",
            Self::Saturated { .. } => "a saturated code",
        }
    }
}

/// Words for a missing value; those of spreadsheets and of C have a `#`.
const MISSING: [&[u8]; 8] = [
    b"nan",
    b"na",
    b"n/a",
    b"nat",
    b"null",
    b"none",
    b"nil",
    b"\xe2\x88\x9e",
];

/// Whether a text stands for a missing value.
fn is_missing(text: &[u8]) -> bool {
    let is_dash = text.iter().all(|byte| *byte == b'-');
    let word = text.strip_prefix(b"-").unwrap_or(text);
    let is_word = MISSING.iter().any(|known| word.eq_ignore_ascii_case(known));
    is_dash || is_word || text.contains(&b'#')
}

/// A unit after its number.
fn spaced(unit: &str) -> String {
    format!(" {}", sign(unit)).trim_end().to_owned()
}

fn comma_hint(text: &str) -> &'static str {
    let digits = text
        .bytes()
        .all(|b| b.is_ascii_digit() || b",.-+eE".contains(&b));
    if digits && text.contains(',') {
        " (write points for decimal commas, and no commas between thousands)"
    } else {
        ""
    }
}

/// Largest index or time that is exact in `f64`.
pub const WHOLE_MAX: f64 = 9_007_199_254_740_992.0;

/// Most characters of a bad cell in an error.
const SHOWN_CHARS: usize = 40;

/// A cell's text for a message: valid UTF-8, no control characters, not too long.
pub fn shown(cell: &[u8]) -> String {
    let text = String::from_utf8_lossy(cell.get(..4 * SHOWN_CHARS).unwrap_or(cell));
    let clean = |c: char| if c.is_control() { '\u{fffd}' } else { c };
    let mut short: String = text.chars().map(clean).take(SHOWN_CHARS).collect();
    if short.len() < cell.len() && text.chars().count() > SHOWN_CHARS {
        short.push_str("...");
    }
    short
}

/// A cell of a table.
#[derive(Clone, Copy, Debug)]
pub struct Cell<'a> {
    /// Its text.
    pub text: &'a [u8],
    /// How its table writes numbers.
    pub(super) numbers: NumberForm,
}

/// A converter's code.
pub(super) struct Code {
    pub(super) code: i32,
    /// Difference from a whole code; 0 in a column of codes.
    pub(super) fraction: f64,
    pub(super) is_saturated: bool,
}

/// Most digits of a plain integer, which is exact in `f64`: enough for all codes and times.
const PLAIN_DIGITS: usize = 15;

impl Cell<'_> {
    /// The number in a cell of a few digits, with or without a minus sign: most cells of codes are such.
    #[inline]
    fn plain(self) -> Option<i64> {
        let (digits, sign) = match self.text {
            [b'-', digits @ ..] => (digits, -1),
            digits => (digits, 1),
        };
        if digits.is_empty() || digits.len() > PLAIN_DIGITS {
            return None;
        }
        let mut number = 0;
        for byte in digits {
            let digit = byte.wrapping_sub(b'0');
            if digit > 9 {
                return None;
            }
            number = 10 * number + i64::from(digit);
        }
        Some(sign * number)
    }

    /// A finite number.
    #[inline(always)]
    pub fn number(self) -> Result<f64, CellFault> {
        match self.plain() {
            Some(number) => Ok(number as f64),
            None => self.other_number(),
        }
    }

    #[cold]
    fn other_number(self) -> Result<f64, CellFault> {
        let text = self.text.trim_ascii();
        if text.is_empty() {
            return Err(CellFault::Empty);
        }
        let is_point = self.numbers.decimal_commas && text.contains(&b'.');
        match self.numbers.number(text) {
            Some(number) if number.is_finite() => Ok(number),
            Some(number) if number.is_infinite() => Err(CellFault::Infinite { text: shown(text) }),
            Some(_) => Err(CellFault::Missing { text: shown(text) }),
            None if is_missing(text) => Err(CellFault::Missing { text: shown(text) }),
            None if is_point && decimal::is_number(text) => {
                Err(CellFault::DecimalPoint { text: shown(text) })
            }
            None => Err(CellFault::NotANumber { text: shown(text) }),
        }
    }

    /// A whole number, also `12.0`. `what` names the content of the column.
    #[inline]
    pub fn whole(self, what: &'static str) -> Result<i64, CellFault> {
        if let Some(number) = self.plain() {
            return Ok(number);
        }
        let value = self.scaled(1.0, WHOLE_MAX, "")?;
        match value.fract() == 0.0 {
            // In range: checked above.
            true => Ok(value as i64),
            false => Err(CellFault::NotWhole { value, what }),
        }
    }

    /// A number times `scale`, at most `limit` in magnitude.
    #[inline(always)]
    pub fn scaled(self, scale: f64, limit: f64, unit: &'static str) -> Result<f64, CellFault> {
        let value = self.number()? * scale;
        match value.abs() <= limit {
            true => Ok(value),
            false => Err(CellFault::Absurd { value, limit, unit }),
        }
    }

    /// The code: a whole number, or the nearest to a voltage of `codes_per_unit` each.
    #[inline]
    pub(super) fn code(
        self,
        codes_per_unit: f64,
        converter: &CodeScale,
    ) -> Result<Code, CellFault> {
        let (code, fraction) = match codes_per_unit == 1.0 {
            true => (self.whole("codes")?, 0.0),
            false => {
                let exact = self.scaled(codes_per_unit, WHOLE_MAX, "codes")?;
                (exact.round() as i64, exact - exact.round())
            }
        };
        let (code_min, code_max) = (converter.window.low - 1, converter.window.high + 1);
        match i32::try_from(code) {
            Ok(inside) if (code_min..=code_max).contains(&inside) => Ok(Code {
                code: inside,
                fraction,
                is_saturated: !converter.window.contains(inside),
            }),
            _ => Err(CellFault::OutsideConverter {
                code,
                code_min,
                code_max,
            }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    impl<'a> Cell<'a> {
        /// With decimal points.
        pub(in crate::log) fn new(text: &'a str) -> Self {
            Self {
                text: text.as_bytes(),
                numbers: NumberForm::default(),
            }
        }
    }

    #[test]
    fn numbers_are_read_as_rust_reads_them() {
        let numbers = "0 -0 +1 1. .5 +.5 1e5 1E-5 1.e5 0.1 9007199254740993 123456789.123456789 \
                       179769313486231580793e289 2.2250738585072014e-308 1e400 1e-400";
        let others = ". - + e5 1e 1_0 0x1 --1 1,5 nan inf -Infinity infinit";
        let split = numbers.split_whitespace().chain(others.split(' '));
        for text in split.chain(["", "1 2"]) {
            let have = Cell::new(text).number();
            match text.parse::<f64>() {
                Ok(number) if number.is_finite() => {
                    assert_eq!(have, Ok(number), "{text}");
                }
                _ => assert!(have.is_err(), "{text}"),
            }
        }
    }
}
