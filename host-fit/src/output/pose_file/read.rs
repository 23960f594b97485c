//! Reads a pose file back, to the decoder's words.

use super::{HEADER, PoseRow};
use runtime::{PlanarPose, Pose, Reading, Status, VerticalPose};
use std::path::{Path, PathBuf};

/// Cells of a line.
const CELLS: usize = 9;

/// Why a pose file is refused.
#[derive(Debug, thiserror::Error)]
pub enum PoseFileError {
    /// The file cannot be read.
    #[error("{}: cannot read the pose file: {source}; check the path", path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// The first line is not the header of a pose file.
    #[error("{}:1: not a pose file: it starts with \"{found}\" where \"{HEADER}\" belongs; name a file that decode wrote", path.display())]
    NoHeader {
        /// The file.
        path: PathBuf,
        /// Start of the first line.
        found: String,
    },
    /// A line with too few or too many cells.
    #[error("{}:{line}: {found} cells where a pose file has 9; decode the log again", path.display())]
    CellCount {
        /// The file.
        path: PathBuf,
        /// Line, from 1.
        line: usize,
        /// Its cells.
        found: usize,
    },
    /// A cell that is not a finite number of its column.
    #[error("{}:{line}: column {column} ({name}): \"{text}\" is not a number of this column; decode the log again", path.display())]
    BadCell {
        /// The file.
        path: PathBuf,
        /// Line, from 1.
        line: usize,
        /// Column, from 1.
        column: usize,
        /// Its name.
        name: &'static str,
        /// What is there.
        text: String,
    },
}

/// Reads a pose file.
///
/// # Errors
/// Every variant of [`PoseFileError`].
pub fn read(path: &Path) -> Result<Vec<PoseRow>, PoseFileError> {
    let bytes = std::fs::read(path).map_err(|source| PoseFileError::Unreadable {
        path: path.to_path_buf(),
        source,
    })?;
    parse(&String::from_utf8_lossy(&bytes), path)
}

/// Reads the text of a pose file; `path` is only named in errors.
pub(super) fn parse(text: &str, path: &Path) -> Result<Vec<PoseRow>, PoseFileError> {
    let mut lines = text.lines();
    let header = lines.next().unwrap_or_default();
    if header.trim_end() != HEADER {
        return Err(PoseFileError::NoHeader {
            path: path.to_path_buf(),
            found: header.chars().take(HEADER.len()).collect(),
        });
    }
    let numbered = lines.enumerate().map(|(k, line)| (k + 2, line));
    numbered
        .map(|(number, line)| parse_line(line, number, path))
        .collect()
}

fn parse_line(line: &str, number: usize, path: &Path) -> Result<PoseRow, PoseFileError> {
    let mut cells = [""; CELLS];
    let mut found = 0;
    for cell in line.split(',') {
        if let Some(slot) = cells.get_mut(found) {
            *slot = cell.trim();
        }
        found += 1;
    }
    if found != CELLS {
        return Err(PoseFileError::CellCount {
            path: path.to_path_buf(),
            line: number,
            found,
        });
    }
    let bad = |column: usize| PoseFileError::BadCell {
        path: path.to_path_buf(),
        line: number,
        column: column + 1,
        name: HEADER.split(',').nth(column).unwrap_or_default(),
        text: cells[column].chars().take(40).collect(),
    };
    let whole = |column: usize| cells[column].parse::<i64>().map_err(|_| bad(column));
    let word = |column: usize| {
        let micro: f64 = cells[column].parse().map_err(|_| bad(column))?;
        let word = (micro * 1e-6) as f32;
        if word.is_finite() {
            Ok(word)
        } else {
            Err(bad(column))
        }
    };
    let status = cells[8].parse::<u32>().map_err(|_| bad(8))?;
    Ok(PoseRow {
        movement: whole(0)?,
        t_us: whole(1)?,
        reading: Reading {
            pose: Pose {
                planar: PlanarPose::from_array([word(2)?, word(3)?, word(4)?]),
                vertical: VerticalPose::from_array([word(5)?, word(6)?, word(7)?]),
            },
            status: Status::from_bits(status),
        },
    })
}
