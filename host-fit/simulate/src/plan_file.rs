//! A planned run as CSV: the trajectory of one movement at the servo rate.
//!
//! ```text
//! t_us,x_um,y_um,rz_urad,z_um,rx_urad,ry_urad
//! 0,0,0,0,0,0,0
//! 2000,0.18,3.12,-1.02,0.44,-0.71,0.93
//! ```
//!
//! The columns stand in this order. Rows are one servo period apart. Separators, comments and compression
//! are as in logs.

use super::pose::StagePose;
use super::protocol::Trajectory;
use hallstage_input::log::table::Table;
use hallstage_input::log::{CellFault, LogError};
use hallstage_input::text::TextReader;
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// The columns of a plan.
pub const COLUMNS: [&str; 7] = [
    "t_us", "x_um", "y_um", "rz_urad", "z_um", "rx_urad", "ry_urad",
];

/// Maximum number of rows: an hour at 500 Hz, and some.
const ROWS_MAX: usize = 2_000_000;

/// Largest sensible value, m or rad: ten times the range of such a stage.
const VALUE_MAX: f64 = 1e-2;

/// Why a plan is refused.
#[derive(Debug, thiserror::Error)]
pub enum PlanFileError {
    /// The file cannot be read, or is no table of numbers.
    #[error(transparent)]
    Table(#[from] LogError),
    /// The file has other columns.
    #[error("{}: the columns are {found}; they must be {}", path.display(), COLUMNS.join(","))]
    Columns {
        /// The file.
        path: PathBuf,
        /// The columns of the file.
        found: String,
    },
    /// The rows are not one servo period apart.
    #[error(
        "{}:{line}: t_us is {t_us}, where {due_us} is due: rows are one servo period of {period_us} us apart",
        path.display()
    )]
    Time {
        /// The file.
        path: PathBuf,
        /// The line, from 1.
        line: usize,
        /// The time there, us.
        t_us: i64,
        /// The right time, us.
        due_us: i64,
        /// The servo period, us.
        period_us: f64,
    },
    /// The file has no rows, or too many.
    #[error("{}: a run has from 1 to {ROWS_MAX} rows, one for every servo period", path.display())]
    Rows {
        /// The file.
        path: PathBuf,
    },
}

/// Reads a plan for a stage of this servo period from a file.
///
/// # Errors
/// Every variant of [`PlanFileError`].
pub fn read(path: &Path, servo_period_s: f64) -> Result<Trajectory, PlanFileError> {
    from_text(
        TextReader::open(path).map_err(LogError::from)?,
        servo_period_s,
    )
}

/// Reads a plan for a stage of this servo period from text.
///
/// # Errors
/// Every variant of [`PlanFileError`].
pub fn from_text(text: TextReader<'_>, servo_period_s: f64) -> Result<Trajectory, PlanFileError> {
    let mut table = Table::open(text, |name| COLUMNS.contains(&name))?;
    if table.head.names != COLUMNS {
        return Err(PlanFileError::Columns {
            found: table.head.names.join(","),
            path: table.head.path,
        });
    }
    let period_us = servo_period_s * 1e6;
    let mut poses = Trajectory::new();
    let mut start_us = 0;
    while table.next_row()? {
        let line = table.row_line();
        let bad = |column| {
            let place = table.head.place(line, column, None);
            move |fault: CellFault| place.refuse(fault.into())
        };
        let t_us = table.cell(0).whole("times").map_err(bad(0))?;
        if poses.is_empty() {
            start_us = t_us;
        }
        let due_us = i64::saturating_add(start_us, (poses.len() as f64 * period_us).round() as i64);
        if t_us != due_us {
            return Err(PlanFileError::Time {
                path: table.head.path,
                line,
                t_us,
                due_us,
                period_us,
            });
        }
        let mut pose = [0.0; 6];
        for (column, value) in (1..).zip(&mut pose) {
            let unit = if COLUMNS[column].ends_with("_um") {
                "m"
            } else {
                "rad"
            };
            let cell = table.cell(column).scaled(1e-6, VALUE_MAX, unit);
            *value = cell.map_err(bad(column))?;
        }
        poses.push(StagePose::from_array(pose));
        if poses.len() > ROWS_MAX {
            break;
        }
    }
    match (1..=ROWS_MAX).contains(&poses.len()) {
        true => Ok(poses),
        false => Err(PlanFileError::Rows {
            path: table.head.path,
        }),
    }
}

/// A plan as text, to 10 pm and prad, so that differences of neighbouring rows show the acceleration.
pub fn to_csv(poses: &[StagePose], servo_period_s: f64) -> String {
    let mut text = COLUMNS.join(",") + "\n";
    text.reserve(80 * poses.len());
    for (k, pose) in poses.iter().enumerate() {
        // Writing to memory cannot fail.
        let _ = write!(text, "{}", (k as f64 * servo_period_s * 1e6).round());
        pose.append_to(&mut text, 5);
        text.push('\n');
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> Result<Trajectory, String> {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("run.csv");
        std::fs::write(&path, text).expect("written");
        let name = path.display().to_string();
        read(&path, 0.002).map_err(|error| error.to_string().replace(&name, "run.csv"))
    }

    fn header() -> String {
        COLUMNS.join(",")
    }

    #[test]
    fn a_plan_reads_back_as_it_was_written() {
        let pose = StagePose::from_array([1.25e-4, -3e-12, 0.0, -2e-4, 7.6e-10, 4.8e-4]);
        let text = to_csv(&[StagePose::default(), pose, pose], 0.002);
        assert!(text.contains("\n2000,125.00000,0.00000,"), "{text}");
        let read = parse(&text).expect("a sound plan");
        assert_eq!((read.len(), read[0]), (3, StagePose::default()));
        for (read, written) in read[1].to_array().iter().zip(pose.to_array()) {
            assert!((read - written).abs() < 6e-12);
        }
    }

    #[test]
    fn what_is_no_plan_is_refused_with_its_place() {
        for (rows, says) in [
            ("", "run.csv: a run has from 1 to"),
            (
                "0,1,2,3,4,5,6\n4000,1,2,3,4,5,6\n",
                "run.csv:3: t_us is 4000, where 2000 is due",
            ),
            ("x,1,2,3,4,5,6\n", "run.csv:2: column 1 (t_us)"),
            ("0,1,2,3,inf,5,6\n", "run.csv:2: column 5 (z_um)"),
            ("0,1,2,3,4,5,20000\n", "run.csv:2: column 7 (ry_urad)"),
            ("0,1,2,3\n", "run.csv:2: 4 cells"),
        ] {
            let text = format!("{}\n{rows}", header());
            let message = parse(&text).expect_err("refused");
            assert!(message.contains(says), "{message}\ndoes not say\n{says}");
        }
        let columns = parse("t_us,y_um\n0,1\n").expect_err("refused");
        assert!(columns.contains("the columns are t_us,y_um"), "{columns}");
    }
}
