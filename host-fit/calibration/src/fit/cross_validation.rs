//! Cross-validation: how well a fit predicts rows that it has not seen.

use super::{Fit, FitError, FitSettings, Job};
use crate::judge::statistics::PoseError;
use crate::judge::{Decoded, Zeros};
use hallstage_input::dataset::{Dataset, Movement};
use hallstage_input::progress::Progress;
use hallstage_input::stage::Stage;

/// Groups that rows are left out by.
const GROUPS: usize = 5;

/// What rows are left out by.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Split {
    /// Whole movements, every fifth.
    Movements,
    /// Fifths of each movement, one after the other: where one of the movements holds a fifth of the rows
    /// or more, and may be all that determines some parameters.
    Time,
}

impl Split {
    /// Its name in JSON and text.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Movements => "movements",
            Self::Time => "time",
        }
    }
}

/// Errors on rows left out, beside those of the fit on the same rows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CrossValidation {
    /// What rows were left out by.
    pub split: Split,
    /// How many groups there were, and as many fits.
    pub groups: usize,
    /// rms of X, Y, Rz (m, m, rad) over all rows but the outliers, each decoded by the fit that had
    /// not seen its group. Zero deviations refitted for each movement, or part of one, where the model has them.
    pub left_out: [f64; 3],
    /// The same by the fit to all groups.
    pub in_fit: [f64; 3],
}

/// Fits without each group of rows in turn. A group holds whole movements, or long parts of them,
/// so that what neighbours have in common, such as the walk of the reference, cannot pass for knowledge.
///
/// # Errors
/// See [`FitError`]: of the first group without which there is no fit.
pub fn cross_validate(
    fit: &Fit,
    dataset: &Dataset,
    stage: &Stage,
    settings: &FitSettings,
) -> Result<CrossValidation, FitError> {
    let rows_of = |movement: &Movement| movement.rows.len();
    let longest = dataset.movements.iter().map(rows_of).max().unwrap_or(0);
    let split = if longest * GROUPS >= dataset.rows.len() {
        Split::Time
    } else {
        Split::Movements
    };
    let group_of = |row: usize| {
        let movement = dataset.rows[row].movement;
        let rows = &dataset.movements[movement].rows;
        match split {
            Split::Movements => movement % GROUPS,
            Split::Time => (row - rows.start) * GROUPS / rows.len(),
        }
    };
    let zeros = Zeros::of_model(fit.model);
    let of_group = |decoded: &Decoded, group: usize| {
        let mut left_out = decoded.clone();
        for (row, error) in left_out.errors.iter_mut().enumerate() {
            if group_of(row) != group || fit.outliers.binary_search(&row).is_ok() {
                *error = None;
            }
        }
        left_out.judge(dataset, stage, zeros).errors
    };
    let (mut left_out, mut in_fit) = (Vec::new(), Vec::new());
    let progress = Progress::new("leaving out", GROUPS as u64);
    for group in 0..GROUPS {
        progress.reach(group as u64);
        let mut job = Job::new(dataset, stage, settings);
        job.selected.retain(|&row| group_of(row) != group);
        let without = job.of_model(fit.model)?;
        left_out.push(of_group(&without.decoded, group));
        in_fit.push(of_group(&fit.decoded, group));
    }
    Ok(CrossValidation {
        split,
        groups: GROUPS,
        left_out: rms(&left_out),
        in_fit: rms(&in_fit),
    })
}

/// rms over the rows of all.
fn rms(groups: &[PoseError]) -> [f64; 3] {
    let rows: usize = groups.iter().map(|group| group.rows).sum();
    [0, 1, 2].map(|axis| {
        let squares = |sum: f64, g: &PoseError| sum + g.axes[axis].rms.powi(2) * g.rows as f64;
        (groups.iter().fold(0.0, squares) / rows.max(1) as f64).sqrt()
    })
}
