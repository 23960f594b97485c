//! Faults of many rows: no single row is to blame, and the message names the pattern.

use super::cell::CellFault;
use super::error::{LogError, LogProblem, Place};
use super::stream::LogRows;
use std::collections::BTreeSet;
use std::mem::discriminant;

/// Most rows that are read on after the first fault.
const ROWS_MAX: usize = 100_000;
/// Fewest bits that are always 0 below left-justified codes.
const SPARE_BITS: u32 = 4;
/// Fewest rows with the same fault, and one over their smallest share, that make a pattern.
const ROWS_MIN: usize = 10;
const ONE_IN: usize = 20;

/// What is wrong with a column of a log, or with all of its rows.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Pattern {
    /// Times repeat, because they have too few digits.
    #[error(
        "the row repeats the time of the row above: the times have too few digits, or rows are written twice; write each row once with all digits, or read the number of the row with `time = {{ column = \"..\", unit = \"rows\" }}` in the [log] table of stage.toml"
    )]
    CoarseTimes,
    /// Negative codes are written as large ones.
    #[error(
        "the codes have no sign: negative ones are written as {bits}-bit numbers; subtract 2^{bits} from the codes above {code_max}"
    )]
    NoSign {
        /// Bits of the converter.
        bits: u32,
        /// Its largest code.
        code_max: i32,
    },
    /// Codes count from the lowest one.
    #[error(
        "the codes count from the lowest one (offset binary); subtract {} from each code",
        code_max + 1
    )]
    OffsetBinary {
        /// The largest code of the converter.
        code_max: i32,
    },
    /// Codes stand at the left end of a longer word.
    #[error(
        "the codes are left-justified: their lowest {bits} bits are always 0; divide them by 2^{bits}"
    )]
    LeftJustified {
        /// Bits below the codes.
        bits: u32,
    },
    /// Other codes than the converter's.
    #[error(
        "codes are outside the converter's range; correct code_min and code_max in stage.toml, or record the codes of this converter"
    )]
    OtherCodes,
    /// Numbers with a fraction in a column of codes or of movements.
    #[error(
        "the numbers are not whole; if they are voltages or lengths, give their unit with `{{ column = \"..\", unit = \"..\" }}` in the [log] table of stage.toml"
    )]
    NotCodes,
    /// No numbers.
    #[error(
        "the cells are no numbers, such as \"{text}\"; write decimal numbers with points, without marks between thousands, or name another column in the [log] table of stage.toml"
    )]
    NotNumbers {
        /// The text of the first cell, shortened.
        text: String,
    },
    /// Most cells are empty.
    #[error(
        "the cells are empty or NaN; record each quantity in each row, or name another column in the [log] table of stage.toml"
    )]
    Empty,
    /// Numbers that are too large.
    #[error(
        "the numbers are too large; correct the unit or the scale of the column in the [log] table of stage.toml"
    )]
    TooLarge,
    /// One number that is too large.
    #[error("{value:e} stands for a missing value, it seems; skip such rows with --bad-rows skip")]
    Sentinel {
        /// The number.
        value: f64,
    },
    /// A fault of some cells.
    #[error("{0}; or skip all such rows with --bad-rows skip")]
    Scattered(CellFault),
    /// Codes at a rail.
    #[error(
        "codes are at the converter's rail; check the sensor, its cable and the range of the converter, and record the log again"
    )]
    Saturated,
    /// Other numbers of cells than the header.
    #[error(
        "the rows have {found} cells and the header {expected}; if the numbers have decimal commas, separate the cells by semicolons or tabs, and if white space separates the cells, put names with spaces into quotation marks"
    )]
    CellCount {
        /// Cells of the header.
        expected: usize,
        /// Cells of the first row with another number of them.
        found: usize,
    },
}

impl LogError {
    /// The error of a cell, as the first of several such cells in so many rows.
    #[must_use]
    pub fn of_rows(self, faults: usize, rows: usize) -> Self {
        match self.problem {
            // Its remedy is the same for all.
            LogProblem::Cell(fault @ CellFault::Saturated { .. }) => {
                self.place.refuse(fault.into())
            }
            LogProblem::Cell(fault) if faults > 1 && 2 * faults < rows => {
                let pattern = Pattern::Scattered(fault);
                self.place.refuse(LogProblem::Pattern {
                    faults,
                    rows,
                    pattern,
                })
            }
            problem => self.place.refuse(problem),
        }
    }
}

impl LogRows<'_> {
    /// The error of a log, named by its pattern where several rows have the same fault; reads on to count them.
    pub(super) fn named_by_pattern(&mut self, error: LogError) -> LogError {
        let is_text = match &error.problem {
            LogProblem::Cell(fault) => fault.is_text(),
            LogProblem::DuplicatedRow { .. } | LogProblem::CellCount { .. } => false,
            _ => return error,
        };
        if is_text && let Ok(Some(header)) = self.table.other_table() {
            let place = Place::new(&self.table.head.path, self.table.row_line());
            return place.refuse(LogProblem::OtherTable { header });
        }
        let time = self.reader.columns.time.cell;
        let column = error.place.column.as_ref().map(|(column, _)| column - 1);
        let (mut rows, mut faults) = (1, 1);
        let mut before_us = f64::NAN;
        let mut numbers = Vec::new();
        while rows < ROWS_MAX {
            let found = match self.table.next_row() {
                Ok(false) => break,
                Ok(true) => {
                    let t_us = self.reader.t_us(&self.table.row);
                    let above_us = before_us;
                    before_us = *t_us.as_ref().unwrap_or(&before_us);
                    match t_us.and_then(|t_us| self.reader.row(&self.table.row, t_us as i64)) {
                        Err(bad) => Some((bad.cell, bad.fault.into())),
                        Ok(row) if before_us == above_us => {
                            let repeats = LogProblem::DuplicatedRow { t_us: row.t_us };
                            column.map(|time| (time, repeats))
                        }
                        Ok(_) => None,
                    }
                }
                Err(LogError { problem, .. }) => Some((usize::MAX, problem)),
            };
            rows += 1;
            let number = column.map(|cell| (cell, self.table.row.cell(cell).number()));
            // Another cell of the row may have a fault, too.
            let found = match number.clone() {
                Some((cell, Err(fault))) if is_text && cell != time => Some((cell, fault.into())),
                _ => found,
            };
            let is_same = |(cell, problem): (usize, LogProblem)| {
                cell == column.unwrap_or(usize::MAX) && problem.is_like(&error.problem)
            };
            faults += usize::from(found.is_some_and(is_same));
            numbers.extend(number.and_then(|(_, number)| number.ok()));
        }
        let pattern = match &error.problem {
            LogProblem::DuplicatedRow { .. } => Some(Pattern::CoarseTimes),
            LogProblem::CellCount { expected, found } => {
                let (expected, found) = (*expected, *found);
                Some(Pattern::CellCount { expected, found })
            }
            LogProblem::Cell(fault) => Pattern::of_cells(fault, &numbers, faults),
            _ => None,
        };
        match pattern {
            _ if faults < ROWS_MIN || faults * ONE_IN < rows => error.of_rows(faults, rows),
            Some(pattern) => error.place.refuse(LogProblem::Pattern {
                faults,
                rows,
                pattern,
            }),
            None => error,
        }
    }
}

impl LogProblem {
    /// Whether it is the same problem of another row.
    fn is_like(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Cell(one), Self::Cell(other)) => {
                one.reason() == other.reason() || one.is_code() && other.is_code()
            }
            _ => discriminant(self) == discriminant(other),
        }
    }
}

impl Pattern {
    /// Of a column with this fault in many cells and these numbers in the others.
    fn of_cells(fault: &CellFault, numbers: &[f64], faults: usize) -> Option<Self> {
        Some(match fault {
            CellFault::Empty | CellFault::Missing { .. } => Self::Empty,
            CellFault::NotANumber { text } | CellFault::DecimalPoint { text } => {
                Self::NotNumbers { text: text.clone() }
            }
            CellFault::NotWhole { .. } => Self::NotCodes,
            CellFault::Absurd { .. } => {
                let by_size = |a: &f64, b: &f64| a.abs().total_cmp(&b.abs());
                let value = numbers.iter().copied().max_by(by_size).unwrap_or_default();
                // The first is not among the numbers.
                match numbers.iter().filter(|number| **number == value).count() + 1 == faults {
                    true => Self::Sentinel { value },
                    false => Self::TooLarge,
                }
            }
            CellFault::Saturated { code } => match numbers.iter().any(|n| *n > f64::from(*code)) {
                true => Self::of_codes(numbers, *code),
                false => Self::Saturated,
            },
            CellFault::OutsideConverter { code_max, .. } => Self::of_codes(numbers, *code_max),
            CellFault::Infinite { .. }
            | CellFault::Temperature { .. }
            | CellFault::NotATime { .. }
            | CellFault::OtherTime { .. } => return None,
        })
    }

    /// Of codes that this converter cannot give: a sound log crosses zero in small steps.
    fn of_codes(codes: &[f64], code_max: i32) -> Self {
        let half = f64::from(code_max) + 1.0;
        let other: BTreeSet<i64> = codes.iter().map(|code| *code as i64).collect();
        let bits = other.iter().map(|code| code.trailing_zeros()).min();
        let bits = bits.unwrap_or_default();
        let shifted = |code: &i64| (*code as f64 / 2f64.powi(bits as i32)).abs() <= 2.0 * half;
        if bits >= SPARE_BITS && other.len() >= ROWS_MIN && other.iter().all(shifted) {
            return Self::LeftJustified { bits };
        }
        let are_unsigned = codes.iter().all(|code| (0.0..2.0 * half).contains(code));
        if code_max <= 0 || !are_unsigned {
            return Self::OtherCodes;
        }
        let jumps = codes
            .windows(2)
            .any(|pair| (pair[1] - pair[0]).abs() > half);
        match jumps || codes.iter().all(|code| *code > 1.5 * half) {
            true => Self::NoSign {
                bits: code_max.ilog2() + 2,
                code_max,
            },
            false => Self::OffsetBinary { code_max },
        }
    }
}
