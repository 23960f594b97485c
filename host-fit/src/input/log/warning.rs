//! What is odd about a log without being wrong.

use super::cell::CellFault;
use super::error::CellPlace;
use std::path::PathBuf;

/// Why rows were left out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SkipReason {
    /// An empty cell.
    Empty,
    /// A cell that is not a number.
    NotANumber,
    /// A time written in another way than the first.
    OtherTime,
    /// NaN or an infinity.
    NotFinite,
    /// A fraction where a whole number belongs.
    NotWhole,
    /// A number beyond every sensible magnitude.
    Absurd,
    /// A code that the converter cannot give.
    OutsideConverter,
    /// A code at a rail of the converter.
    Saturated,
}

impl SkipReason {
    /// The reason, in words.
    pub const fn text(self) -> &'static str {
        match self {
            Self::Empty => "an empty cell",
            Self::NotANumber => "a cell that is not a number",
            Self::OtherTime => "a time written in another way than the first",
            Self::NotFinite => "a NaN or an infinity",
            Self::NotWhole => "a fraction where a whole number belongs",
            Self::Absurd => "an absurd number",
            Self::OutsideConverter => "a code outside the converter's range",
            Self::Saturated => "a saturated code",
        }
    }
}

impl From<&CellFault> for SkipReason {
    fn from(fault: &CellFault) -> Self {
        match fault {
            CellFault::Empty => Self::Empty,
            CellFault::NotANumber { .. } | CellFault::DecimalPoint { .. } => Self::NotANumber,
            CellFault::OtherTime { .. } => Self::OtherTime,
            CellFault::Nan | CellFault::Infinite { .. } => Self::NotFinite,
            CellFault::NotWhole { .. } => Self::NotWhole,
            CellFault::Absurd { .. } => Self::Absurd,
            CellFault::OutsideConverter { .. } => Self::OutsideConverter,
            CellFault::Saturated { .. } => Self::Saturated,
        }
    }
}

/// How many more of the same there are.
fn and_others(others: usize) -> String {
    match others {
        0 => String::new(),
        others => format!(" (as have {others} more)"),
    }
}

/// How many more logs there are.
fn and_logs(others: usize) -> String {
    match others {
        0 => String::new(),
        others => format!(" and {others} more"),
    }
}

/// Where movements begin that no column tells.
fn beginnings(split_s: Option<f64>) -> String {
    let gap = super::split::GAP_PERIODS;
    let every = split_s.map_or(String::new(), |seconds| format!("every {seconds} s, "));
    format!("{every}after a gap of more than {gap} rows and where the time starts again")
}

/// Something that the user should know about a log that was read.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum LogWarning {
    /// Rows were left out, as the user asked.
    #[error("{}: rows left out for {}: {rows} (the first: line {}, column {}, {})", first.path.display(), reason.text(), first.line, first.column, first.name)]
    RowsSkipped {
        /// Why.
        reason: SkipReason,
        /// How many.
        rows: usize,
        /// The bad cell of the first of them.
        first: Box<CellPlace>,
    },
    /// All rows of a movement were left out.
    #[error("{}: movement {movement} is left out: all its rows ({rows}) are bad; record it again if its setting matters", path.display())]
    MovementSkipped {
        /// The file.
        path: PathBuf,
        /// The movement.
        movement: i64,
        /// Its rows.
        rows: usize,
    },
    /// Further movements of which all rows were left out.
    #[error("{}: and {movements} more movements are left out: all their rows ({rows}) are bad; record the log again", path.display())]
    MovementsSkipped {
        /// The file.
        path: PathBuf,
        /// How many movements.
        movements: usize,
        /// Their rows.
        rows: usize,
    },
    /// A movement with one row: its zero deviation takes up all that the row could tell.
    #[error("{}: movement {first} has one row{}, which tells the fit nothing: its zero deviation fits it exactly; check the movement column", path.display(), and_others(*others))]
    SingleRow {
        /// The file.
        path: PathBuf,
        /// The first such movement.
        first: i64,
        /// How many more there are.
        others: usize,
    },
    /// The last line does not end in a line break.
    #[error("{}:{line}: the last line has no line break; if the file was cut, its last number may be cut too", path.display())]
    NoFinalLineBreak {
        /// The file.
        path: PathBuf,
        /// The last line.
        line: usize,
    },
    /// Logs have no column for the movement: their times told where movements begin.
    #[error("{}{}: no column for the movement; the times tell {movements} in all (one begins {}), each with its own zero deviation", path.display(), and_logs(*others), beginnings(*split_s))]
    MovementsByTime {
        /// The first such file.
        path: PathBuf,
        /// How many more there are.
        others: usize,
        /// How many movements came out of all of them.
        movements: usize,
        /// The length that the user asked for, s.
        split_s: Option<f64>,
    },
    /// Voltages that are no whole codes.
    #[error("{}: voltages are {mean:.2} codes from whole ones on average, so volts_per_count is wrong, or another instrument recorded them, or they were rounded; check them, as the parameters are for the codes of the stage's converter", path.display())]
    BetweenCodes {
        /// The file.
        path: PathBuf,
        /// Mean distance, codes.
        mean: f64,
    },
    /// The log was sampled at another period than the servo's.
    #[error("{}: rows are {log_us} us apart, but the servo period is {servo_us} us; missed frames are counted by the log's own period", path.display())]
    OtherPeriod {
        /// The file.
        path: PathBuf,
        /// Median time between rows, us.
        log_us: i64,
        /// Servo period of `stage.toml`, us.
        servo_us: f64,
    },
    /// There are more rows than a fit needs.
    #[error(
        "fit and diagnosis use {taken} of {rows} rows, in {runs} runs spread over all that moves; errors are over all rows"
    )]
    Excerpt {
        /// Rows of the logs.
        rows: usize,
        /// Rows of the excerpt.
        taken: usize,
        /// Runs of rows that follow each other.
        runs: usize,
    },
}

impl LogWarning {
    /// Adds the warnings of one more log; logs without a column for the movement share one.
    pub(super) fn add(warnings: &mut Vec<Self>, more: Vec<Self>) {
        for warning in more {
            let Self::MovementsByTime {
                movements: more, ..
            } = warning
            else {
                warnings.push(warning);
                continue;
            };
            let counts = warnings.iter_mut().find_map(|known| match known {
                Self::MovementsByTime {
                    others, movements, ..
                } => Some((others, movements)),
                _ => None,
            });
            match counts {
                Some((others, movements)) => {
                    *others += 1;
                    *movements += more;
                }
                None => warnings.push(warning),
            }
        }
    }
}
