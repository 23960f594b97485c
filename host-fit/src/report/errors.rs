//! Errors of the pose in a report: as JSON and as tables, over all rows and log by log.

use super::table::{Table, file_name};
use hallstage_calibration::fit::calibration;
use hallstage_calibration::judge::statistics::{ErrorSums, PoseError};
use hallstage_calibration::judge::{Decoded, Judgement, Zeros};
use hallstage_input::dataset::Dataset;
use hallstage_input::stage::Stage;
use hallstage_solver::problem::model::Model;
use hallstage_solver::problem::parameters::Parameters;
use runtime::ModelKind;
use runtime::calibration::Origin;
use runtime::frame::MISSING_CODE;
use serde_json::{Value, json};
use std::collections::BTreeMap;

/// Errors of X, Y, Rz by row, m, m, rad; `None` where there was no pose.
pub type RowErrors = Vec<Option<[f64; 3]>>;

/// The errors of a log with the designed values, Model (15), no zero deviation taken off. `None` where
/// no decoder can be made of them, or where it decodes no row.
pub fn designed(dataset: &Dataset, stage: &Stage) -> Option<(RowErrors, PoseError)> {
    let model = Model::of(ModelKind::M15);
    let designed = calibration(&dataset.rows, stage, model, &Parameters::designed(stage));
    let decoded = Decoded::new(&designed.prepare(&Origin::default()).ok()?, dataset);
    let figures = decoded.judge(dataset, stage, Zeros::None).errors;
    (figures.rows > 0).then_some((decoded.errors, figures))
}

/// rms and peak of X, Y (um) and Rz (urad).
pub fn errors(error: &PoseError) -> Value {
    of(
        error.axes.map(|axis| axis.rms),
        error.axes.map(|axis| axis.peak),
    )
}

/// The same of X, Y, Rz in SI. An error below zero, or of 1 m or more, which the blob of another program
/// may hold, is null.
pub fn of(rms: [f64; 3], peak: [f64; 3]) -> Value {
    let micro = |error: f64| (0.0..1.0).contains(&error).then_some(error * 1e6);
    let axis = |k: usize, unit: &str| json!({ format!("rmse_{unit}"): micro(rms[k]), format!("peak_{unit}"): micro(peak[k]) });
    json!({ "x": axis(0, "um"), "y": axis(1, "um"), "rz": axis(2, "urad") })
}

/// rms and peak of X, Y (um) and Rz (urad).
pub fn micro(error: &PoseError) -> [[f64; 2]; 3] {
    error.axes.map(|axis| [axis.rms * 1e6, axis.peak * 1e6])
}

/// A table with a row of rms and peak for each entry (um, um, urad); what is not known is NaN.
pub fn error_table(
    title: &str,
    rows: impl IntoIterator<Item = (impl Into<String>, [[f64; 2]; 3])>,
) -> Table {
    let titles = [
        "X rms, um",
        "peak",
        "Y rms, um",
        "peak",
        "Rz rms, urad",
        "peak",
    ];
    let mut table = Table::new(title, &titles);
    for (what, errors) in rows {
        table.row(what, errors.as_flattened().iter().map(|x| cell(*x)));
    }
    table
}

/// An error in um or urad.
fn cell(x: f64) -> String {
    match x.is_nan() {
        true => "-".to_owned(),
        false => format!("{x:.3}"),
    }
}

/// The errors of each log over all its rows.
pub(super) fn by_log(dataset: &Dataset, judgement: &Judgement) -> Vec<Value> {
    let logs = dataset.logs.iter().zip(&judgement.logs);
    let figures = logs.map(|(log, judged)| {
        let path = file_name(&log.path);
        json!({ "path": path, "rows": judged.rows, "errors": errors(&judged.errors) })
    });
    figures.collect()
}

/// The errors of rows by whole degrees of mount and body; empty where the log has no temperatures.
pub(super) fn by_temperature(dataset: &Dataset, by_row: &RowErrors) -> Vec<Value> {
    let mut degrees: BTreeMap<(usize, i32), ErrorSums> = BTreeMap::new();
    for (index, (row, error)) in dataset.rows.iter().zip(by_row).enumerate() {
        for (sensor, read_mc) in row.frame.temperature_mc().into_iter().enumerate() {
            if read_mc != MISSING_CODE {
                let degree = read_mc.div_euclid(1000);
                let sums = degrees.entry((sensor, degree)).or_insert(ErrorSums::NONE);
                sums.take(index, *error);
            }
        }
    }
    let value = |((sensor, degree), sums): ((usize, i32), ErrorSums)| {
        json!({
            "sensor": (["mount", "body"][sensor]),
            "from_c": degree,
            "to_c": degree + 1,
            "rows": sums.rows,
            "errors": errors(&sums.errors()),
        })
    };
    degrees.into_iter().map(value).collect()
}
