//! Why a log is refused: where, what, and what to do.

use super::cell::CellFault;
use super::pattern::Pattern;
use crate::axis::counted;
use crate::source::{SourceError, SourceProblem};
use std::fmt::{Display, Formatter, Result as FmtResult};
use std::path::PathBuf;

/// A place in a log: a file, a line of it, or a cell.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Place {
    /// The file; empty where no log was named.
    pub path: PathBuf,
    /// Line, from 1.
    pub line: Option<usize>,
    /// Column of the table, from 1, and its name in the header.
    pub column: Option<(usize, String)>,
    /// The movement of the cell, if its number could be read.
    pub movement: Option<i64>,
}

impl Place {
    /// A file, or a line of it.
    pub fn new(path: impl Into<PathBuf>, line: impl Into<Option<usize>>) -> Box<Self> {
        Box::new(Self {
            path: path.into(),
            line: line.into(),
            ..Self::default()
        })
    }

    /// A problem at this place, as an error.
    pub fn refuse(self: Box<Self>, problem: LogProblem) -> LogError {
        LogError {
            place: self,
            problem,
        }
    }
}

impl Display for Place {
    fn fmt(&self, f: &mut Formatter<'_>) -> FmtResult {
        write!(f, "{}", self.path.display())?;
        if let Some(line) = self.line {
            write!(f, ":{line}")?;
        }
        if let Some((column, name)) = &self.column {
            write!(f, ": column {column}")?;
            if !name.is_empty() {
                write!(f, " ({name})")?;
            }
        }
        match self.movement {
            Some(movement) => write!(f, ", movement {movement}"),
            None => Ok(()),
        }
    }
}

/// Why a log is refused, and where.
#[derive(Debug, thiserror::Error)]
#[error("{place}{}{problem}", if place.path.as_os_str().is_empty() { "" } else { ": " })]
pub struct LogError {
    /// Its place.
    pub place: Box<Place>,
    /// The problem.
    pub problem: LogProblem,
}

impl From<SourceError> for LogError {
    fn from(SourceError { path, problem }: SourceError) -> Self {
        Place::new(path, None).refuse(problem.into())
    }
}

/// The columns that are not known, at the end of a message.
fn unknown_columns(names: &[String]) -> String {
    match names {
        [] => String::new(),
        names => format!(" (not known: {})", names.join(", ")),
    }
}

/// A fault of a log.
#[derive(Debug, thiserror::Error)]
pub enum LogProblem {
    /// No log was named.
    #[error("no log was named; name one or more CSV or CSV.gz files")]
    NoLog,
    /// The file cannot be read, or is not text.
    #[error(transparent)]
    Source(#[from] SourceProblem),
    /// Its first mebibyte is empty, or only comments and blank lines.
    #[error(
        "the log is empty, or its first mebibyte is only comments; record it again or name another file"
    )]
    Empty,
    /// A header and no row.
    #[error("a header but no rows; record the log again or name another file")]
    HeaderOnly,
    /// The first line holds numbers.
    #[error(
        "the first line holds numbers, not column names; put a header such as movement,t_us,... above it"
    )]
    NoHeader,
    /// No separator between columns was found in the line that should be the header.
    #[error(
        "\"{text}\" is not a header with several columns; separate the cells by commas, semicolons or tabs, or name a log"
    )]
    NoSeparator {
        /// The start of the line.
        text: String,
    },
    /// Too many columns.
    #[error(
        "the header has more than {limit} columns; name another file, or leave out the columns that are not needed"
    )]
    TooManyColumns {
        /// The most that are read.
        limit: usize,
    },
    /// A line is too long.
    #[error(
        "the line is longer than {limit_bytes} bytes, the most that is read; name a log with a row in each line"
    )]
    LineTooLong {
        /// The most bytes.
        limit_bytes: usize,
    },
    /// Too many movements.
    #[error(
        "more than {limit} movements, the most that a log may have; check the movement column, or split the log"
    )]
    TooManyMovements {
        /// The most.
        limit: usize,
    },
    /// A column is missing.
    #[error(
        "the column `{column}` is missing; record it, or name the column that holds it with `{key} = \"...\"` in the [log] table of stage.toml{}",
        unknown_columns(unknown)
    )]
    MissingColumn {
        /// The name that was looked for.
        column: String,
        /// The key in the `[log]` table.
        key: &'static str,
        /// Columns that are not known.
        unknown: Vec<String>,
    },
    /// The places of the beams are known, and the log holds no beams.
    #[error(
        "the log holds X, Y, Rz in place of the beams, so places, scales and air of the beams do not apply; log the \
         beams, or take `x`, `y1`, `y2`, `scale` and `air` out of [interferometer] in stage.toml"
    )]
    PoseWithPlaces,
    /// Two columns for one quantity.
    #[error(
        "it repeats the quantity of column {first}; name one of the two columns in the [log] table of stage.toml, and put the other into `ignore`"
    )]
    RepeatedQuantity {
        /// The other column, from 1.
        first: usize,
    },
    /// Two columns of one name differ.
    #[error(
        "it has the name of column {first} and other numbers; give each column a name of its own, and export all signals by one clock"
    )]
    RepeatedColumn {
        /// The other column, from 1.
        first: usize,
    },
    /// A quantity has no unit.
    #[error(
        "it has no unit; write one of {units} into its name, as in `{name} [..]`, or give it with `{key} = {{ column = \"{name}\", unit = \"..\" }}` in the [log] table of stage.toml"
    )]
    NoUnit {
        /// The column's name.
        name: String,
        /// The units of its kind.
        units: String,
        /// The key in the `[log]` table.
        key: &'static str,
    },
    /// A column holds voltages, and the parameters are for codes.
    #[error(
        "it is a voltage, and the parameters are for the converter's codes; give its `volts_per_count` (V) in the [{table}] table of stage.toml"
    )]
    NoVoltsPerCount {
        /// The table of its converter.
        table: &'static str,
    },
    /// A column has two units.
    #[error(
        "it has the unit {below} in the row below the header, and another by its name or the [log] table of stage.toml; correct one of them"
    )]
    UnitsDisagree {
        /// The unit in the row below the header.
        below: String,
    },
    /// Two sets of columns hold the same quantities.
    #[error(
        "both `{one}` and `{other}` are there and hold the same thing; drop one set with `ignore = [...]` in the [log] table of stage.toml"
    )]
    AmbiguousColumns {
        /// A column of one set.
        one: String,
        /// A column of the other set.
        other: String,
    },
    /// Another table begins.
    #[error(
        "another table begins here, with its header in line {header}; write each table to a file of its own, and name all of them"
    )]
    OtherTable {
        /// The line of its header.
        header: usize,
    },
    /// A line with more or fewer cells than the header.
    #[error("{} where the header has {expected}; correct or remove the line", counted(*found, "cell"))]
    CellCount {
        /// Cells of the header.
        expected: usize,
        /// Cells of the line.
        found: usize,
    },
    /// The last line has too few cells and no line break.
    #[error(
        "the file ends in the middle of this line ({found} of {expected} cells); copy it again, or remove the line"
    )]
    CutLine {
        /// Cells of the header.
        expected: usize,
        /// Cells of the line.
        found: usize,
    },
    /// A cell that cannot be used.
    #[error(transparent)]
    Cell(#[from] CellFault),
    /// A row is earlier than the row above.
    #[error(
        "time runs backwards, from {before_us} us to {t_us} us; sort the rows by time, or give each run a movement number of its own"
    )]
    TimeBackwards {
        /// Time of the row above, us.
        before_us: i64,
        /// Time of this row, us.
        t_us: i64,
    },
    /// A clock starts again.
    #[error(
        "the time starts again, from {before_us} us to {t_us} us; add to all later times what the clock lost, or give the rows from here on a movement number of their own"
    )]
    ClockRestarts {
        /// Time of the row above, us.
        before_us: i64,
        /// Time of this row, us.
        t_us: i64,
    },
    /// A counter is full.
    #[error(
        "the time falls by 2^{bits} of its units, as a counter of {bits} bits does that is full; add 2^{bits} to all later times, or give the rows from here on a movement number of their own"
    )]
    ClockWraps {
        /// Bits of the counter.
        bits: i32,
    },
    /// Many rows have the same fault.
    #[error("{faults} of {rows} rows: {pattern}")]
    Pattern {
        /// Rows with the fault.
        faults: usize,
        /// Rows from the first with the fault on.
        rows: usize,
        /// What they have in common.
        pattern: Pattern,
    },
    /// A row has the time of the row above.
    #[error("the row repeats the time {t_us} us of the row above; remove one of the two rows")]
    DuplicatedRow {
        /// The time, us.
        t_us: i64,
    },
    /// A movement has rows in two places.
    #[error(
        "the movement was left at line {left_line} and comes back; keep the rows of a movement together, or give the second part a number of its own"
    )]
    MovementReturns {
        /// The line of the first row after it.
        left_line: usize,
    },
    /// A log is named twice.
    #[error("named twice; name each log once")]
    SameLog,
    /// All rows are bad.
    #[error(
        "every row is bad and was left out, {rows} in all (the first: {first}); record the log again"
    )]
    NoGoodRows {
        /// Their number.
        rows: usize,
        /// Why the first was left out.
        first: Box<LogError>,
    },
}
