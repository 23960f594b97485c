//! Errors of the pose in a report: over all rows, log by log, and by temperature.

use super::figure::{Group, Item, figure, file, group, micro};
use super::table::Table;
use hallstage_calibration::fit::calibration;
use hallstage_calibration::judge::statistics::{ErrorSums, PoseError};
use hallstage_calibration::judge::{Decoded, Judgement, Zeros};
use hallstage_input::axis::PLANAR;
use hallstage_input::dataset::Dataset;
use hallstage_input::stage::Stage;
use hallstage_solver::estimator::paper::Parameters;
use hallstage_solver::estimator::parameters::FieldParameters;
use runtime::ModelKind;
use runtime::calibration::Origin;
use runtime::frame::MISSING_CODE;
use std::collections::BTreeMap;

/// Errors of X, Y, Rz by row, m, m, rad; `None` for a row without pose.
pub type RowErrors = Vec<Option<[f64; 3]>>;

/// The errors of a log with the designed values and Model (15), no zero deviation taken off. `None` where these make no
/// decoder, or decode no row.
pub fn designed(dataset: &Dataset, stage: &Stage) -> Option<(RowErrors, PoseError)> {
    let designed = FieldParameters::from_model_31(&Parameters::designed(stage), stage);
    let designed = calibration(&dataset.rows, stage, ModelKind::M15, &designed).ok()?;
    let decoded = Decoded::new(&designed.prepare(&Origin::default()).ok()?, dataset);
    let errors = decoded.judge(dataset, stage, Zeros::None).errors;
    (errors.rows > 0).then_some((decoded.errors, errors))
}

/// rms and peak of X, Y, Rz.
pub fn errors(error: &PoseError) -> Group {
    let (rms, peak) = (
        error.axes.map(|axis| axis.rms),
        error.axes.map(|axis| axis.peak),
    );
    from_rms_and_peak(rms, peak)
}

/// The same of X, Y, Rz in SI. The blob of another program may hold an error below zero, or of 1 m or more, which is not
/// shown.
pub fn from_rms_and_peak(rms: [f64; 3], peak: [f64; 3]) -> Group {
    let known = |error: f64| {
        if (0.0..1.0).contains(&error) {
            error
        } else {
            f64::NAN
        }
    };
    per_axis(|k| {
        let (rms, peak) = (known(rms[k]), known(peak[k]));
        group! { "rmse" => micro(&PLANAR[k], rms), "peak" => micro(&PLANAR[k], peak) }
    })
}

/// What `item` gives for X, Y and Rz.
pub fn per_axis<T: Into<Item>>(item: impl Fn(usize) -> T) -> Group {
    Group(
        (0..3)
            .map(|k| (PLANAR[k].key.to_owned(), item(k).into()))
            .collect(),
    )
}

/// X, Y, Rz in SI as figures.
pub fn pose(axes: [f64; 3]) -> Group {
    per_axis(|k| micro(&PLANAR[k], axes[k]))
}

/// rms and peak of X, Y (um) and Rz (urad).
pub fn to_micro(error: &PoseError) -> [[f64; 2]; 3] {
    error.axes.map(|axis| [axis.rms * 1e6, axis.peak * 1e6])
}

/// A table with a row of rms and peak for each entry (um, um, urad). NaN stands for an unknown error.
pub fn error_table(
    title: &str,
    rows: impl IntoIterator<Item = (impl Into<String>, [[f64; 2]; 3])>,
) -> Table {
    let mut table = Table::new(title, &["X rms", "peak", "Y rms", "peak", "Rz rms", "peak"]);
    for (what, errors) in rows {
        let axis = |k: usize| errors[k].map(|error| figure(error, PLANAR[k].micro));
        table.row(what, [0, 1, 2].map(axis).concat());
    }
    table
}

/// The errors of each log.
pub(super) fn errors_per_log(dataset: &Dataset, judgement: &Judgement) -> Vec<Group> {
    let logs = dataset.logs.iter().zip(&judgement.logs);
    logs.map(|(log, judged)| {
        group! { "path" => file(&log.path), "rows" => judged.rows, "errors" => errors(&judged.errors) }
    })
    .collect()
}

/// The errors of rows by whole degrees of mount and body; empty where the log has no temperatures.
pub(super) fn errors_per_degree(dataset: &Dataset, by_row: &RowErrors) -> Vec<Group> {
    let mut degrees: BTreeMap<(usize, i32), ErrorSums> = BTreeMap::new();
    for (row, error) in dataset.rows.iter().zip(by_row) {
        for (sensor, read_mc) in row.frame.temperature_mc().into_iter().enumerate() {
            if read_mc != MISSING_CODE {
                let degree = read_mc.div_euclid(1000);
                let sums = degrees.entry((sensor, degree)).or_insert(ErrorSums::NONE);
                sums.take(*error);
            }
        }
    }
    let celsius = |degree: i32| figure(f64::from(degree), "degC");
    let group = |((sensor, degree), sums): ((usize, i32), ErrorSums)| {
        group! {
            "sensor" => ["mount", "body"][sensor],
            "from" => celsius(degree),
            "to" => celsius(degree + 1),
            "rows" => sums.rows,
            "errors" => errors(&sums.errors()),
        }
    };
    degrees.into_iter().map(group).collect()
}
