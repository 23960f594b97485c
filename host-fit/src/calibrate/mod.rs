//! What `fit`, `check`, `eval` and `recalibrate` decide, before anything is written: fitted, diagnosed,
//! repaired, refused or not. The command line and the Python package show the same.

mod choice;
mod evaluation;
mod fitted;
mod limit;
mod recalibration;

pub(crate) use choice::values;
pub use choice::{Choice, name_of};
pub use evaluation::{EvalOrder, Evaluation};
pub use fitted::{CalibrateError, FitOrder, JudgedFit};
pub use limit::ErrorLimits;
pub use recalibration::Updated;

use hallstage_input::stage::Stage;
use runtime::ParameterSet;

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
