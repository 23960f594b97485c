//! What `fit`, `check`, `eval` and `recalibrate` decide, before anything is written: fitted, diagnosed,
//! repaired, refused or not. The command line and the Python package show the same.

mod choice;
mod evaluation;
mod fitted;
mod limit;
mod recalibration;
mod settings;

pub use choice::Choice;
pub(crate) use choice::values;
pub use evaluation::{EvalOrder, Evaluation};
pub use fitted::{CalibrateError, FitOrder, Outcome};
pub use limit::Limits;
pub use recalibration::Updated;
pub use settings::{Mismatch, choose_loss};

use crate::report::errors::errors;
use crate::report::figure::{Group, group};
use crate::report::trusted::trusted;
use hallstage_calibration::diagnose::Diagnosis;
use hallstage_calibration::diagnose::refusal::Refusal;
use hallstage_calibration::fit::{Fit, FitError};
use hallstage_calibration::words::{self, WordedRefusal};
use hallstage_input::log::LogReading;
use hallstage_input::stage::Stage;
use runtime::ParameterSet;
use serde_json::json;

/// Why a blob is not of a stage: it was made for other scales of codes; `None` where it may be.
pub fn other_scales(set: &ParameterSet, stage: &Stage) -> Option<String> {
    let (hall, capacitive) = (&set.hall, &set.capacitive);
    let keys = [
        ("hall.m_per_count", stage.hall.m_per_count, hall.m_per_code),
        (
            "capacitive.m_per_count",
            stage.capacitive.m_per_count,
            capacitive.m_per_code,
        ),
    ];
    let other = |(_, of_stage, of_blob): &(&str, f64, f32)| *of_stage as f32 != *of_blob;
    keys.into_iter().find(other).map(|(key, of_stage, of_blob)| {
        format!(
            "{key} is {of_stage:e}, but the parameter blob was made for {of_blob:e}: name the stage.toml that the blob was \
             fitted with"
        )
    })
}

/// The figures of a log that no calibration is kept of: model and errors of the fit, null without a fit; why there is no
/// fit, null if there is one.
pub fn checked(log: &LogReading, fitted: Result<&Fit, &FitError>, diagnosis: &Diagnosis) -> Group {
    let (rows, movements) = log.dataset.read();
    let fit = fitted.ok();
    let refusal = Refusal::from_fit(fitted, &diagnosis.findings);
    group! {
        "rows" => rows,
        "judged_rows" => fit.map(|fit| fit.judgement.rows()),
        "movements" => movements,
        "skipped_rows" => log.skipped_rows,
        "model" => fit.map(|fit| fit.model.name),
        "errors" => fit.map(|fit| errors(&fit.judgement.errors)),
        "failure" => json!(fitted.err().map(ToString::to_string)),
        "refusal" => json!(refusal.as_ref().map(|refusal| WordedRefusal(refusal, &diagnosis.findings))),
        "warnings" => json!(words::messages(&log.warnings)),
        "verdict" => json!(diagnosis.verdict),
        "predicted" => json!(diagnosis.predicted),
        "findings" => json!(words::worded(&diagnosis.findings)),
        "trusted_inputs" => fit.map_or_else(Vec::new, |fit| trusted(&fit.set)),
    }
}
