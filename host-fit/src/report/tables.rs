//! The tables of a report, with the units and digits that a reader wants.

use super::before_after::Errors;
use super::json::{MovementZero, Report};
use crate::input::dataset::{Dataset, Row};
use crate::input::stage::Stage;
use crate::judge::statistics::PoseError;
use crate::problem::model::Model;
use crate::problem::parameters::Parameters;
use crate::problem::terms::shown;
use crate::solve::field::terms::{BEYOND_MODEL_31, PER_PROBE, name};
use runtime::ModelKind;
use serde::Serialize;
use std::collections::BTreeMap;

/// Standard errors to either side of a 95 % interval.
const NORMAL_95: f64 = 1.959_964;
/// Movements that a table lists.
pub(super) const MOVEMENTS_MAX: usize = 1000;

/// The errors of one stage of the calibration.
#[derive(Clone, Debug, Serialize)]
pub struct StageRow {
    /// Which parameters, of which model.
    pub title: String,
    /// rms and peak of X, Y (um) and Rz (urad).
    pub axes: [[f64; 2]; 3],
}

/// rms and peak in um and urad.
fn micro(errors: &PoseError) -> [[f64; 2]; 3] {
    errors.axes.map(|axis| [axis.rms * 1e6, axis.peak * 1e6])
}

/// The errors before and after the fit.
pub(super) fn stage_rows(stages: &[Errors]) -> Vec<StageRow> {
    let row = |errors: &Errors| StageRow {
        title: errors.title.clone(),
        axes: micro(&errors.figures),
    };
    stages.iter().map(row).collect()
}

/// One movement.
#[derive(Clone, Debug, Serialize)]
pub struct MovementRow<'a> {
    /// Its name.
    pub name: &'a str,
    /// Its zero deviation.
    pub zero: &'a MovementZero,
    /// Its rows.
    pub rows: usize,
    /// Mean of Z (um), Rx, Ry (urad).
    pub setting: [f64; 3],
    /// rms and peak of X, Y (um) and Rz (urad).
    pub axes: [[f64; 2]; 3],
}

/// The movements with their errors and zero deviations.
pub(super) fn movement_rows<'a>(
    dataset: &Dataset,
    errors: &[PoseError],
    zeros: &'a [MovementZero],
) -> Vec<MovementRow<'a>> {
    let mean = |rows: &[Row], axis: usize| {
        let sum: f64 = rows.iter().map(|row| row.vertical[axis]).sum();
        // Plus zero makes no minus zero.
        (sum / rows.len() as f64 * 1e6).round() + 0.0
    };
    let movements = dataset.movements.iter().zip(errors).zip(zeros);
    movements
        .take(MOVEMENTS_MAX)
        .map(|((movement, errors), zero)| MovementRow {
            name: &zero.movement,
            rows: movement.rows.len(),
            setting: [0, 1, 2].map(|axis| mean(&dataset.rows[movement.rows.clone()], axis)),
            axes: micro(errors),
            zero,
        })
        .collect()
}

/// One parameter, its numbers with as many digits as mean something.
#[derive(Clone, Debug, Serialize)]
pub struct ParameterRow {
    /// Its name.
    pub name: String,
    /// Its value.
    pub value: String,
    /// Its standard error, or a dash.
    pub standard_error: String,
    /// Its 95 % interval, or a dash.
    pub interval: String,
    /// As designed; of a term with a prior the mean of that.
    pub designed: String,
    /// Unit of all four.
    pub unit: &'static str,
    /// Whether Model (31) has it not.
    pub beyond_model_31: bool,
}

/// The parameters term by term; angles in degrees.
pub(super) fn parameter_rows(report: &Report, stage: &Stage) -> Vec<ParameterRow> {
    let values = Parameters::designed(stage).values;
    let ids = Model::of(ModelKind::M31).parameters();
    let designed: BTreeMap<String, f64> = ids.map(|id| (id.name(), values[id.index])).collect();
    let order = (0..PER_PROBE).flat_map(|term| [0, 1, 2].map(|probe| (term, probe)));
    let row = |(term, probe): (usize, usize)| {
        let name = name(probe * PER_PROBE + term);
        let parameter = report.parameters.get(&name)?;
        let (scale, unit) = shown(1.0, parameter.unit);
        let value = parameter.value * scale;
        let designed = designed.get(&name).map_or(0.0, |value| value * scale);
        let error = parameter.standard_error.map(|error| error * scale);
        // Two digits of the standard error.
        let digits = error.filter(|error| *error > 0.0).map_or(6, |error| {
            (1.0 - error.log10().floor()).clamp(0.0, 9.0) as usize
        });
        let dash = || "-".to_owned();
        let interval = |error: f64| {
            let half = NORMAL_95 * error;
            format!("{:.digits$} to {:.digits$}", value - half, value + half)
        };
        Some(ParameterRow {
            name,
            value: format!("{value:.digits$}"),
            standard_error: error.map_or_else(dash, |error| format!("{error:.digits$}")),
            interval: error.map_or_else(dash, interval),
            designed: format!("{designed}"),
            unit,
            beyond_model_31: term >= BEYOND_MODEL_31,
        })
    };
    order.filter_map(row).collect()
}
