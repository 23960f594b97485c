//! A planned run as CSV: the trajectory of one movement at the servo rate.
//!
//! ```text
//! t_us,x_um,y_um,rz_urad,z_um,rx_urad,ry_urad
//! 0,0,0,0,0,0,0
//! 2000,0.18,3.12,-1.02,0.44,-0.71,0.93
//! ```
//!
//! The columns stand in this order; every row is one servo period after the one before. Lines
//! that start with `#` are comments.

use super::pose::StagePose;
use super::protocol::Trajectory;
use crate::input::source::{self, SourceError};
use csv::{ReaderBuilder, StringRecord};
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// The columns of a plan.
pub const COLUMNS: [&str; 7] = [
    "t_us", "x_um", "y_um", "rz_urad", "z_um", "rx_urad", "ry_urad",
];

/// Bytes of a plan at most: 80 a row, as [`to_csv`] writes it, for more than an hour.
const BYTES_MAX: u64 = 160_000_000;

/// Characters of what was found in a message, at most.
const FOUND_MAX: usize = 80;

/// Largest sensible value, um or urad: ten times what such a stage moves.
const VALUE_MAX: f64 = 1e4;

/// Why a plan is refused.
#[derive(Debug, thiserror::Error)]
pub enum PlanFileError {
    /// It cannot be read, or is too large.
    #[error(transparent)]
    Source(#[from] SourceError),
    /// It is no CSV.
    #[error("{}: {source}; name a plan as `host-fit plan` writes it", path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// What the reader says.
        source: csv::Error,
    },
    /// The header is another one.
    #[error("{}, line 1: the columns are {found}; they must be {}", path.display(), COLUMNS.join(","))]
    Columns {
        /// The file.
        path: PathBuf,
        /// What is there.
        found: String,
    },
    /// A cell is no number that makes sense.
    #[error(
        "{}, line {line}, column {column}: \"{text}\" is no number from -{VALUE_MAX} to {VALUE_MAX}; correct it",
        path.display()
    )]
    Cell {
        /// The file.
        path: PathBuf,
        /// Line, from 1.
        line: u64,
        /// Its column.
        column: &'static str,
        /// What is there.
        text: String,
    },
    /// A row is not due when it should be.
    #[error(
        "{}, line {line}: t_us is {text}, where {due_us} is due: every row is one servo period of {period_us} us \
         after the one before", path.display()
    )]
    Time {
        /// The file.
        path: PathBuf,
        /// Line, from 1.
        line: u64,
        /// What is there.
        text: String,
        /// What should be there, us.
        due_us: i64,
        /// The servo period of the stage, us.
        period_us: f64,
    },
    /// There are no rows.
    #[error("{}: no rows; a run has one for every servo period", path.display())]
    Empty {
        /// The file.
        path: PathBuf,
    },
}

/// Reads a plan for a stage of this servo period.
///
/// # Errors
/// Every variant of [`PlanFileError`].
pub fn read(path: &Path, servo_period_s: f64) -> Result<Trajectory, PlanFileError> {
    let unreadable = |source| PlanFileError::Unreadable {
        path: path.to_owned(),
        source,
    };
    let bytes = source::read_whole(path, BYTES_MAX)?;
    let mut reader = ReaderBuilder::new()
        .comment(Some(b'#'))
        .trim(csv::Trim::All)
        .from_reader(bytes.as_slice());
    let header = reader.headers().map_err(unreadable)?;
    if header.iter().ne(COLUMNS) {
        return Err(PlanFileError::Columns {
            path: path.to_owned(),
            found: (header.iter().collect::<Vec<_>>().join(",").chars())
                .take(FOUND_MAX)
                .collect(),
        });
    }
    let period_us = servo_period_s * 1e6;
    let mut poses = Trajectory::new();
    let mut start_us = 0;
    for record in reader.records() {
        let record = record.map_err(unreadable)?;
        let line = record.position().map_or(0, csv::Position::line);
        let t_us = record[0].parse::<i64>().ok();
        if poses.is_empty() {
            start_us = t_us.unwrap_or(0);
        }
        let due_us = i64::saturating_add(start_us, (poses.len() as f64 * period_us).round() as i64);
        if t_us != Some(due_us) {
            return Err(PlanFileError::Time {
                path: path.to_owned(),
                line,
                text: record[0].chars().take(FOUND_MAX).collect(),
                due_us,
                period_us,
            });
        }
        poses.push(pose(&record).map_err(|column| PlanFileError::Cell {
            path: path.to_owned(),
            line,
            column: COLUMNS[column],
            text: record[column].chars().take(FOUND_MAX).collect(),
        })?);
    }
    if poses.is_empty() {
        return Err(PlanFileError::Empty {
            path: path.to_owned(),
        });
    }
    Ok(poses)
}

/// The text of a plan, to 10 pm and prad: differences of neighbouring rows still show the
/// acceleration.
pub fn to_csv(poses: &[StagePose], servo_period_s: f64) -> String {
    let mut text = COLUMNS.join(",") + "\n";
    text.reserve(80 * poses.len());
    for (k, pose) in poses.iter().enumerate() {
        // Writing to memory cannot fail.
        let _ = write!(text, "{}", (k as f64 * servo_period_s * 1e6).round());
        for value in pose.planar.iter().chain(&pose.vertical) {
            // Rounded first, and zero added: never -0.00000.
            let _ = write!(text, ",{:.5}", (value * 1e11).round() / 1e5 + 0.0);
        }
        text.push('\n');
    }
    text
}

/// The pose of a record of seven cells, or the column that is no number.
fn pose(record: &StringRecord) -> Result<StagePose, usize> {
    let value = |column: usize| match record[column].parse::<f64>() {
        Ok(value) if value.abs() <= VALUE_MAX => Ok(value * 1e-6),
        _ => Err(column),
    };
    Ok(StagePose {
        planar: [value(1)?, value(2)?, value(3)?],
        vertical: [value(4)?, value(5)?, value(6)?],
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> Result<Trajectory, String> {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("run.csv");
        std::fs::write(&path, text).expect("written");
        read(&path, 0.002).map_err(|error| {
            error
                .to_string()
                .replace(&path.display().to_string(), "run.csv")
        })
    }

    fn header() -> String {
        COLUMNS.join(",")
    }

    #[test]
    fn a_plan_is_read_in_si_units() {
        let text = format!(
            "# made by hand\n{}\n1000,1,-2,3,4,-5,6\n3000,0,0,0.5,0,0,0\n",
            header()
        );
        let poses = parse(&text).expect("a sound plan");
        assert_eq!(poses.len(), 2);
        assert_eq!(poses[0].planar, [1.0, -2.0, 3.0].map(|x| x * 1e-6));
        assert_eq!(poses[0].vertical, [4.0, -5.0, 6.0].map(|x| x * 1e-6));
        assert_eq!(poses[1].planar[2], 0.5e-6);
    }

    #[test]
    fn a_plan_reads_back_as_it_was_written() {
        let pose = StagePose {
            planar: [1.25e-4, -3e-12, 0.0],
            vertical: [-2e-4, 7.6e-10, 4.8e-4],
        };
        let text = to_csv(&[StagePose::default(), pose, pose], 0.002);
        assert!(text.contains("\n2000,125.00000,0.00000,"), "{text}");
        let read = parse(&text).expect("a sound plan");
        assert_eq!((read.len(), read[0]), (3, StagePose::default()));
        for (read, pose) in [
            (read[1].planar, pose.planar),
            (read[1].vertical, pose.vertical),
        ] {
            for axis in 0..3 {
                assert!((read[axis] - pose[axis]).abs() < 6e-12);
            }
        }
    }

    #[test]
    fn what_is_no_plan_is_refused_with_its_place() {
        let h = header();
        for (text, says) in [
            (String::new(), "run.csv, line 1: the columns are ;"),
            (
                "t_us,y_um\n0,1\n".to_owned(),
                "run.csv, line 1: the columns are t_us,y_um",
            ),
            (format!("{h}\n"), "run.csv: no rows"),
            (
                format!("{h}\n0,1,2,3,4,5,6\n4000,1,2,3,4,5,6\n"),
                "run.csv, line 3: t_us is 4000, where 2000 is due",
            ),
            (
                format!("{h}\nx,1,2,3,4,5,6\n"),
                "run.csv, line 2: t_us is x, where 0 is due",
            ),
            (
                format!("{h}\n0,1,2,3,inf,5,6\n"),
                "run.csv, line 2, column z_um: \"inf\" is no number",
            ),
            (
                format!("{h}\n0,1,NaN,3,4,5,6\n"),
                "line 2, column y_um: \"NaN\"",
            ),
            (
                format!("{h}\n0,1,2,3,4,5,20000\n"),
                "line 2, column ry_urad: \"20000\"",
            ),
            (format!("{h}\n0,1,2,3\n"), "line: 2"),
            (
                format!("{h}{}\n", " ".repeat(BYTES_MAX as usize)),
                "run.csv: more than 160000000 bytes",
            ),
        ] {
            let message = parse(&text).expect_err("refused");
            assert!(message.contains(says), "{message}\ndoes not say\n{says}");
        }
    }
}
