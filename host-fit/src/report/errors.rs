//! Errors of the pose in a report: over all rows, and log by log.

use crate::input::dataset::{Dataset, LogSource};
use crate::judge::statistics::{AxisError, PoseError};
use crate::judge::whole::{LogJudgement, WholeJudgement};
use crate::judge::{Decoded, Judgement, errors_by_log};
use serde::Serialize;

/// rms and peak of a displacement.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Micrometres {
    /// um.
    pub rmse_um: f64,
    /// um.
    pub peak_um: f64,
}

/// rms and peak of a rotation.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Microradians {
    /// urad.
    pub rmse_urad: f64,
    /// urad.
    pub peak_urad: f64,
}

/// Errors of the three planar axes.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Errors {
    /// X.
    pub x: Micrometres,
    /// Y.
    pub y: Micrometres,
    /// Rz.
    pub rz: Microradians,
}

impl From<&PoseError> for Errors {
    fn from(error: &PoseError) -> Self {
        let [x, y, rz] = error.axes;
        let linear = |a: AxisError| Micrometres {
            rmse_um: a.rms * 1e6,
            peak_um: a.peak * 1e6,
        };
        Self {
            x: linear(x),
            y: linear(y),
            rz: Microradians {
                rmse_urad: rz.rms * 1e6,
                peak_urad: rz.peak * 1e6,
            },
        }
    }
}

/// The errors of one log.
#[derive(Clone, Debug, Serialize)]
pub struct LogErrors {
    /// The file.
    pub path: String,
    /// Its rows.
    pub rows: usize,
    /// Over all of them.
    pub errors: Errors,
}

/// The errors of each log, zero deviations as in `judgement`.
pub(super) fn by_log(
    decoded: &Decoded,
    judgement: &Judgement,
    dataset: &Dataset,
) -> Vec<LogErrors> {
    let errors = decoded.errors_less(&judgement.zeros, dataset);
    let errors = errors_by_log(&errors, dataset);
    let of_log = |(log, errors): (&LogSource, &PoseError)| LogErrors {
        path: log.path.display().to_string(),
        rows: log.rows.len(),
        errors: Errors::from(errors),
    };
    dataset.logs.iter().zip(&errors).map(of_log).collect()
}

/// The errors of each log over all its rows, of which the dataset is an excerpt.
pub(super) fn of_whole(dataset: &Dataset, whole: &WholeJudgement) -> Vec<LogErrors> {
    let of_log = |(log, judged): (&LogSource, &LogJudgement)| LogErrors {
        path: log.path.display().to_string(),
        rows: judged.rows,
        errors: Errors::from(&judged.errors),
    };
    dataset.logs.iter().zip(&whole.logs).map(of_log).collect()
}

/// The rms errors of each of several logs for a terminal, a line each.
pub fn as_text(logs: &[LogErrors]) -> String {
    let line = |log: &LogErrors| {
        let Errors { x, y, rz } = &log.errors;
        format!(
            "  {:>8.3} um {:>8.3} um {:>8.3} urad rms in {}\n",
            x.rmse_um, y.rmse_um, rz.rmse_urad, log.path
        )
    };
    let several = logs.iter().filter(|_| logs.len() > 1);
    several.map(line).collect()
}
