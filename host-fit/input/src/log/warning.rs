//! What is odd about a log without being wrong.

use crate::finding::{Code, Finding};
use std::path::Path;

/// Movements with one row; `first` is the number of the first.
pub(super) fn single_rows(path: &Path, first: i64, movements: usize) -> Finding {
    let others = match movements {
        0 | 1 => String::new(),
        several => format!(" (as have {} more)", several - 1),
    };
    let message = format!(
        "{}: movement {first} has one row{others}, which adds nothing to the fit: its zero deviation fits it exactly; check the \
         movement column",
        path.display()
    );
    Finding::new(Code::ShortMovements, message).of(movements as f64, "movements")
}

/// The last line does not end in a line break.
pub(super) fn file_cut(path: &Path, line: usize) -> Finding {
    let message = format!(
        "{}:{line}: the last line has no line break; if the file was cut, its last number may be cut too",
        path.display()
    );
    Finding::new(Code::FileCut, message)
}

/// A log has no column for the movement: gaps in its times separate them.
pub(super) fn by_time(path: &Path, movements: usize, split_s: Option<f64>) -> Finding {
    let every = split_s.map_or(String::new(), |seconds| format!("every {seconds} s, "));
    let message = format!(
        "{}: no column for the movement; the times tell {movements} (one begins {every}after a gap of more than {} rows and \
         where the time starts again), each with its own zero deviation",
        path.display(),
        super::order::GAP_PERIODS
    );
    Finding::new(Code::MovementsByTime, message).of(movements as f64, "movements")
}

/// Voltages are no whole codes: so far off on average.
pub(super) fn between_codes(path: &Path, mean: f64) -> Finding {
    let message = format!(
        "{}: voltages are {mean:.2} codes from whole ones on average, so volts_per_count is wrong, or another instrument \
         recorded them, or they were rounded; check them, as the parameters are for the codes of the stage's converter",
        path.display()
    );
    Finding::new(Code::BetweenCodes, message).of(mean, "codes")
}

/// There are more rows than a fit needs.
pub(super) fn sampled(rows: usize, taken: usize, runs: usize) -> Finding {
    let message = format!(
        "fit and diagnosis use {taken} of {rows} rows, in {runs} runs spread over all that moves; errors are over all rows"
    );
    Finding::new(Code::Excerpt, message).of(taken as f64, "rows")
}
