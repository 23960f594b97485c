//! Whether the logs of one fit are of one stage in one state: each is fitted alone.

use super::finding::{Code, Finding, Severity};
use super::trials::{Trial, Trials, unlimited, zeros_free};
use super::warning;
use crate::input::dataset::Dataset;
use crate::input::stage::Stage;
use crate::judge::identify::check_motion;
use crate::problem::model::Model;
use runtime::ModelKind;
use std::fmt::Write;

/// Sensitivities of two logs may differ by this part: runs with other motion give others, because
/// Model (31) is not all that there is.
const GAIN_MAX: f64 = 0.01;
/// Beyond this they are of different stages, or a gain has changed.
const GAIN_REFUSED: f64 = 0.02;

/// How far the logs contradict each other.
pub fn disagreement(dataset: &Dataset, stage: &Stage) -> Option<Finding> {
    if dataset.logs.len() < 2 {
        return None;
    }
    let (zeros_free, unlimited) = (zeros_free(stage), unlimited(stage));
    let trial = |dataset: &Dataset| {
        let model = Model::of(ModelKind::M31);
        check_motion(dataset, stage, dataset.rows.len(), model).ok()?;
        Trials::new(dataset, stage, &zeros_free, &unlimited).of(None)
    };
    let together = trial(dataset)?;
    let alone: Vec<(usize, Trial)> = (0..dataset.logs.len())
        .filter_map(|log| Some((log, trial(&of_log(dataset, log))?)))
        .collect();
    let (_, first) = alone.first()?;
    let differences = alone.iter().map(|(_, trial)| {
        let (eta, theirs) = (trial.free.eta(), first.free.eta());
        [0, 1, 2].map(|k| eta[k] / theirs[k] - 1.0)
    });
    let differences: Vec<[f64; 3]> = differences.collect();
    let (which, worst) = (differences.iter().enumerate())
        .map(|(k, d)| (k, d.iter().fold(0.0, |a: f64, x| a.max(x.abs()))))
        .max_by(|(_, a), (_, b)| a.total_cmp(b))?;
    if worst <= GAIN_MAX {
        return None;
    }
    let mut message = format!(
        "the logs do not agree: together they fit to {:.2} um rms",
        together.within_um
    );
    for (log, trial) in &alone {
        let path = dataset.logs[*log].path.display();
        let _ = write!(message, ", {path} alone to {:.2} um", trial.within_um);
    }
    let [a, b, c] = differences[which].map(|d| d * 100.0);
    let log = dataset.logs[alone[which].0].path.display().to_string();
    let _ = write!(
        message,
        "; the sensitivity of the probes A, B, C in {log} differs by {a:+.1}, {b:+.1}, {c:+.1} % from that in {}: fit logs of \
         one stage in one state only, and fit the other one by itself",
        dataset.logs[alone[0].0].path.display()
    );
    Some(Finding {
        severity: if worst > GAIN_REFUSED {
            Severity::Refuse
        } else {
            Severity::Warn
        },
        message,
        value: Some(worst * 100.0),
        unit: Some("%"),
        ..warning(Code::LogsDisagree)
    })
}

/// The rows of one log.
fn of_log(dataset: &Dataset, log: usize) -> Dataset {
    dataset.only(|rows| {
        let movement = rows.first().map(|row| row.movement);
        movement.is_some_and(|movement| dataset.movements[movement].log == log)
    })
}
