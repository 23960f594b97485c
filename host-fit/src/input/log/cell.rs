//! One cell of a log as a number, or what is wrong with it.

use crate::input::stage::CodeScale;

/// What is wrong with one cell.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum CellFault {
    /// Nothing in it.
    #[error("the cell is empty; fill it in or remove the row")]
    Empty,
    /// Not a number.
    #[error(
        "\"{text}\" is not a number; correct it or remove the row{}",
        comma_hint(text)
    )]
    NotANumber {
        /// What is there, shortened.
        text: String,
    },
    /// A decimal point in a table whose first rows have decimal commas.
    #[error(
        "\"{text}\" has a decimal point, where the first rows of the log have decimal commas; write all numbers alike, without marks between thousands"
    )]
    DecimalPoint {
        /// What is there, shortened.
        text: String,
    },
    /// A time that is written in another way than the first of the log.
    #[error(
        "\"{text}\" is a time written in another way than the first of the log; write all as numbers, all as dates and times with a zone, or all without"
    )]
    OtherTime {
        /// What is there, shortened.
        text: String,
    },
    /// NaN.
    #[error("NaN stands for a missing value; remove the row")]
    Nan,
    /// An infinity.
    #[error("\"{text}\" is infinite; remove the row")]
    Infinite {
        /// What is there.
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
        "{value:e} {unit} is absurd (more than {limit:e} {unit}); remove the row, or check the column's unit in the [log] table of stage.toml"
    )]
    Absurd {
        /// The value, in `unit`.
        value: f64,
        /// The largest sensible magnitude.
        limit: f64,
        /// The unit of both.
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
        "code {code} is at the converter's rail: the sensor is saturated; record the movement again, or leave such rows out with --bad-rows skip"
    )]
    Saturated {
        /// The code.
        code: i32,
    },
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

/// Largest index or time that is kept exactly on its way through `f64`.
pub(super) const WHOLE_MAX: f64 = 9_007_199_254_740_992.0;

/// How much of a bad cell an error shows, in characters.
const SHOWN_CHARS: usize = 40;

/// A cell's text for a message: valid UTF-8, no control characters, not too long.
pub(crate) fn shown(cell: &[u8]) -> String {
    let text = String::from_utf8_lossy(cell.get(..4 * SHOWN_CHARS).unwrap_or(cell));
    let clean = |c: char| if c.is_control() { '\u{fffd}' } else { c };
    let mut short: String = text.chars().map(clean).take(SHOWN_CHARS).collect();
    if short.len() < cell.len() && text.chars().count() > SHOWN_CHARS {
        short.push_str("...");
    }
    short
}

/// A finite number.
pub(crate) fn number(cell: &[u8]) -> Result<f64, CellFault> {
    let cell = cell.trim_ascii();
    if cell.is_empty() {
        return Err(CellFault::Empty);
    }
    let value: f64 = core::str::from_utf8(cell)
        .ok()
        .and_then(|text| text.parse().ok())
        .ok_or_else(|| CellFault::NotANumber { text: shown(cell) })?;
    if value.is_nan() {
        Err(CellFault::Nan)
    } else if value.is_infinite() {
        Err(CellFault::Infinite { text: shown(cell) })
    } else {
        Ok(value)
    }
}

/// A whole number; `12.0` counts as one. `what` says what the column holds.
pub(crate) fn whole(cell: &[u8], what: &'static str) -> Result<i64, CellFault> {
    let value = number(cell)?;
    if value.abs() > WHOLE_MAX {
        return Err(CellFault::Absurd {
            value,
            limit: WHOLE_MAX,
            unit: "",
        });
    }
    if value.fract() != 0.0 {
        return Err(CellFault::NotWhole { value, what });
    }
    // In range: checked above.
    Ok(value as i64)
}

/// A number times `scale`, at most `limit` in magnitude.
pub(crate) fn scaled(
    cell: &[u8],
    scale: f64,
    limit: f64,
    unit: &'static str,
) -> Result<f64, CellFault> {
    let value = number(cell)? * scale;
    if value.abs() <= limit {
        Ok(value)
    } else {
        Err(CellFault::Absurd { value, limit, unit })
    }
}

/// A converter's code: how far from a whole number the cell is, and whether the code is at a rail.
pub(super) struct Code {
    pub(super) code: i32,
    /// In codes; 0 in a column of codes.
    pub(super) fraction: f64,
    pub(super) is_saturated: bool,
}

/// The code in a cell: a whole number, which may be known, or the nearest to a voltage of
/// `codes_per_unit` each.
#[inline]
pub(super) fn code(
    known: Option<i64>,
    cell: &[u8],
    codes_per_unit: f64,
    converter: &CodeScale,
) -> Result<Code, CellFault> {
    let (code, fraction) = match (codes_per_unit == 1.0, known) {
        (true, Some(code)) => (code, 0.0),
        (true, None) => (whole(cell, "codes")?, 0.0),
        (false, _) => {
            let exact = scaled(cell, codes_per_unit, WHOLE_MAX, "codes")?;
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
