//! Why a log is refused: what, where, and what to do.

use super::cell::CellFault;
use crate::input::source::SourceError;
use std::path::{Path, PathBuf};

/// One cell of a log.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CellPlace {
    /// The file.
    pub path: PathBuf,
    /// Line, from 1.
    pub line: usize,
    /// Column of the table, from 1.
    pub column: usize,
    /// The column's name in the header.
    pub name: String,
    /// The movement, if its own cell could be read.
    pub movement: Option<i64>,
}

impl core::fmt::Display for CellPlace {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(
            f,
            "{}:{}: column {}",
            self.path.display(),
            self.line,
            self.column
        )?;
        if !self.name.is_empty() {
            write!(f, " ({})", self.name)?;
        }
        match self.movement {
            Some(movement) => write!(f, ", movement {movement}"),
            None => Ok(()),
        }
    }
}

/// Why a log is refused.
#[derive(Debug, thiserror::Error)]
pub enum LogError {
    /// No log was named.
    #[error("no log was named; name one or more CSV or CSV.gz files")]
    NoLog,
    /// The file cannot be read, or is no text.
    #[error(transparent)]
    Source(#[from] SourceError),
    /// Nothing in its first mebibyte, or only comments and blank lines.
    #[error("{}: the log is empty, or its first mebibyte is only comments; record it again or name another file", path.display())]
    Empty {
        /// The file.
        path: PathBuf,
    },
    /// A header and no row.
    #[error("{}:{line}: a header but no rows; record the log again or name another file", path.display())]
    HeaderOnly {
        /// The file.
        path: PathBuf,
        /// Line of the header.
        line: usize,
    },
    /// The first line holds numbers only.
    #[error("{}:{line}: the first line holds numbers, not column names; put a header such as movement,t_us,... above it", path.display())]
    NoHeader {
        /// The file.
        path: PathBuf,
        /// The line.
        line: usize,
    },
    /// The header is a single cell.
    #[error("{}:{line}: \"{text}\" is not a header with several columns; separate the cells by commas, semicolons or tabs, or name a log", path.display())]
    NoSeparator {
        /// The file.
        path: PathBuf,
        /// Line of the header.
        line: usize,
        /// What is there, shortened.
        text: String,
    },
    /// More columns than any log has.
    #[error("{}:{line}: the header has more than {limit} columns; name another file, or leave out the columns that are not needed", path.display())]
    TooManyColumns {
        /// The file.
        path: PathBuf,
        /// Line of the header.
        line: usize,
        /// Most columns that are read.
        limit: usize,
    },
    /// More rows than are held where each of them is needed.
    #[error("{}: more than {limit} rows in all, the most that are held at once; name a part of the logs", path.display())]
    TooManyRows {
        /// The log that was read.
        path: PathBuf,
        /// Most rows.
        limit: usize,
    },
    /// A log that was changed while it was used.
    #[error("{}: the log changed while it was read: it is read twice; wait until it is recorded", path.display())]
    Changed {
        /// The file.
        path: PathBuf,
    },
    /// A line longer than any log has.
    #[error("{}:{line}: the line is longer than {limit_bytes} bytes, the most that is read; name a log with a row in each line", path.display())]
    LineTooLong {
        /// The file.
        path: PathBuf,
        /// The line.
        line: usize,
        /// Length of the longest line that is read.
        limit_bytes: usize,
    },
    /// More movements than any log has.
    #[error("{}:{line}: more than {limit} movements, the most that a log may have; check the movement column, or split the log", path.display())]
    TooManyMovements {
        /// The file.
        path: PathBuf,
        /// The line of the first row of the movement too many.
        line: usize,
        /// Most movements of a log.
        limit: usize,
    },
    /// A column that is needed is not there.
    #[error("{}:{line}: the column `{column}` is missing; record it, or name the column that holds it with `{key} = \"...\"` in the [log] table of stage.toml", path.display())]
    MissingColumn {
        /// The file.
        path: PathBuf,
        /// Line of the header.
        line: usize,
        /// The name that is expected.
        column: String,
        /// Its key in the table `[log]`.
        key: &'static str,
    },
    /// A column that nobody knows.
    #[error("{place} is unknown; map it, or drop it with `ignore = [\"{}\"]`, in the [log] table of stage.toml, which `host-fit init` drafts (known columns: {known})", place.name)]
    UnknownColumn {
        /// Where its name stands.
        place: Box<CellPlace>,
        /// Names that are known.
        known: String,
    },
    /// A column without a name.
    #[error("{place} has no name; name it, or remove the separator too many")]
    UnnamedColumn {
        /// Where its name would stand.
        place: Box<CellPlace>,
    },
    /// Two columns of the header hold the same quantity.
    #[error("{place} repeats the quantity of column {first}; rename or remove one")]
    RepeatedColumn {
        /// Where the second name stands.
        place: Box<CellPlace>,
        /// The earlier column.
        first: usize,
    },
    /// A column without a unit.
    #[error("{place} has no unit; write one of {units} into its name, as in `{0} [..]`, or give it with `{key} = {{ column = \"{0}\", unit = \"..\" }}` in the [log] table of stage.toml", place.name)]
    NoUnit {
        /// Where its name stands.
        place: Box<CellPlace>,
        /// The units that it may have.
        units: &'static str,
        /// Its key in the table `[log]`.
        key: &'static str,
    },
    /// A column of voltages, and how many volts a code has is not known.
    #[error(
        "{place} is a voltage, and the parameters are for the converter's codes; give its `volts_per_count` (V) in the [{table}] table of stage.toml"
    )]
    NoVoltsPerCount {
        /// Where its name stands.
        place: Box<CellPlace>,
        /// The table of `stage.toml` that describes the converter.
        table: &'static str,
    },
    /// The row of units below the header says another unit than the column's name or `[log]`.
    #[error(
        "{place} has the unit {below} in the row below the header, and another by its name or the [log] table of stage.toml; correct one of them"
    )]
    UnitsDisagree {
        /// Where its name stands.
        place: Box<CellPlace>,
        /// The unit in the row of units.
        below: String,
    },
    /// `--split` for a log that has a column for the movement.
    #[error("{}: the log has a column for the movement, so --split does not apply; leave it out", path.display())]
    SplitWithMovements {
        /// The file.
        path: PathBuf,
    },
    /// Two sets of columns hold one thing, such as capacitive codes and `z_m, rx_rad, ry_rad`.
    #[error("{}:{line}: both `{one}` and `{other}` are there and hold the same thing; drop one set with `ignore = [...]` in the [log] table of stage.toml", path.display())]
    AmbiguousColumns {
        /// The file.
        path: PathBuf,
        /// Line of the header.
        line: usize,
        /// A column of the first set.
        one: String,
        /// A column of the second set.
        other: String,
    },
    /// A row with too few or too many cells.
    #[error("{}:{line}: {found} cells where the header has {expected}; correct or remove the line", path.display())]
    CellCount {
        /// The file.
        path: PathBuf,
        /// Line.
        line: usize,
        /// Cells of the header.
        expected: usize,
        /// Cells of this row.
        found: usize,
    },
    /// The file ends in the middle of its last line.
    #[error("{}:{line}: the file ends in the middle of this line ({found} of {expected} cells); copy it again, or remove the line", path.display())]
    CutLine {
        /// The file.
        path: PathBuf,
        /// The last line.
        line: usize,
        /// Cells of the header.
        expected: usize,
        /// Cells of the last line; the last of them may be cut too.
        found: usize,
    },
    /// A cell that is no sound number of its column.
    #[error("{place}: {fault}")]
    Cell {
        /// Which cell.
        place: Box<CellPlace>,
        /// What is wrong with it.
        fault: CellFault,
    },
    /// A time before that of the row above, in one movement.
    #[error(
        "{place}: time runs backwards, from {before_us} us to {t_us} us; sort the rows by time, or give each run a movement number of its own"
    )]
    TimeBackwards {
        /// The cell of the time.
        place: Box<CellPlace>,
        /// Time of the row above, us.
        before_us: i64,
        /// Time of this row, us.
        t_us: i64,
    },
    /// A row with the movement and the time of the row above.
    #[error("{place}: the row repeats the time {t_us} us of the row above; remove the duplicate")]
    DuplicatedRow {
        /// The cell of the time.
        place: Box<CellPlace>,
        /// The time, us.
        t_us: i64,
    },
    /// A movement that goes on after another one began.
    #[error(
        "{place}: the movement was left at line {left_line} and comes back; keep the rows of a movement together, or give the second part a number of its own"
    )]
    MovementReturns {
        /// The cell of the movement.
        place: Box<CellPlace>,
        /// The line at which another movement began.
        left_line: usize,
    },
    /// A log holds the same rows as one named before it, so they would count twice.
    #[error("{}: the same rows as in {}; name each log once", path.display(), first.display())]
    SameLog {
        /// The file.
        path: PathBuf,
        /// The file named before it.
        first: PathBuf,
    },
    /// Every row was left out.
    #[error("{}: every row is bad and was left out, {rows} in all (the first: {first}); record the log again", path.display())]
    NoGoodRows {
        /// The file.
        path: PathBuf,
        /// How many rows.
        rows: usize,
        /// What is wrong with the first of them.
        first: Box<LogError>,
    },
}

impl LogError {
    /// The file and the line that it names, where it names them.
    pub fn file_and_line(&self) -> (Option<&Path>, Option<usize>) {
        if let Some(place) = self.place() {
            return (Some(&place.path), Some(place.line));
        }
        match self {
            Self::HeaderOnly { path, line }
            | Self::NoHeader { path, line }
            | Self::NoSeparator { path, line, .. }
            | Self::TooManyColumns { path, line, .. }
            | Self::LineTooLong { path, line, .. }
            | Self::TooManyMovements { path, line, .. }
            | Self::MissingColumn { path, line, .. }
            | Self::AmbiguousColumns { path, line, .. }
            | Self::CellCount { path, line, .. }
            | Self::CutLine { path, line, .. } => (Some(path), Some(*line)),
            Self::Empty { path }
            | Self::TooManyRows { path, .. }
            | Self::Changed { path }
            | Self::SplitWithMovements { path }
            | Self::SameLog { path, .. }
            | Self::NoGoodRows { path, .. } => (Some(path), None),
            Self::Source(source) => (Some(source.path()), None),
            _ => (None, None),
        }
    }

    /// The cell that it names, if it is about one.
    pub const fn place(&self) -> Option<&CellPlace> {
        match self {
            Self::UnknownColumn { place, .. }
            | Self::UnnamedColumn { place }
            | Self::RepeatedColumn { place, .. }
            | Self::NoUnit { place, .. }
            | Self::NoVoltsPerCount { place, .. }
            | Self::UnitsDisagree { place, .. }
            | Self::Cell { place, .. }
            | Self::TimeBackwards { place, .. }
            | Self::DuplicatedRow { place, .. }
            | Self::MovementReturns { place, .. } => Some(place),
            _ => None,
        }
    }
}
