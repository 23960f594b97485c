//! What `fit` and `eval` report, as programs read it.

use crate::report::errors::{RowErrors, by_log, by_temperature, errors};
use crate::report::field;
use crate::report::parameters::{
    Parameter, coordinates, field_parameters, parameters, parameters_in,
};
use crate::report::table::{Table, tables};
use crate::report::trusted::trusted;
use hallstage_calibration::diagnose::Diagnosis;
use hallstage_calibration::fit::Fit;
use hallstage_calibration::judge::predicted::Predicted;
use hallstage_calibration::judge::verdict::Verdict;
use hallstage_calibration::judge::{Judgement, Zeros};
use hallstage_calibration::words;
use hallstage_input::dataset::{Dataset, Movement};
use hallstage_input::finding::Finding;
use hallstage_input::log::LogReading;
use hallstage_input::stage::Stage;
use hallstage_solver::problem::model::Model;
use hallstage_solver::problem::parameters::Parameters;
use runtime::ParameterSet;
use serde::Serialize;
use serde_json::{Map, Value, json};
use std::collections::BTreeMap;

/// Keys of a fit that programs may look up in any report.
const OF_FIT: [&str; 6] = [
    "model_reason",
    "solver",
    "project",
    "seed",
    "evaluations",
    "errors_solver_delta",
];

/// One movement: its setting, its errors, its zero deviation.
#[derive(Clone, Debug, Serialize)]
pub struct MovementZero {
    /// Its number, after the name of its log where there are several.
    pub movement: String,
    /// Its rows.
    pub rows: usize,
    /// Mean Z, um.
    pub z_um: f64,
    /// Mean Rx, urad.
    pub rx_urad: f64,
    /// Mean Ry, urad.
    pub ry_urad: f64,
    /// Errors over its rows, the zero deviation taken off.
    pub errors: Value,
    /// At probe A, um.
    pub a_um: f64,
    /// At probe B, um.
    pub b_um: f64,
    /// At probe C, um.
    pub c_um: f64,
    /// Whether it is beyond its range.
    pub is_beyond: bool,
}

/// How many rows of a long log a fit, a diagnosis and figures use, and in how many runs of rows that follow
/// each other; null if they use all.
fn excerpt(dataset: &Dataset) -> Value {
    let (rows, used) = (dataset.read().0, dataset.rows.len());
    match used < rows {
        true => json!({ "rows": used, "runs": dataset.movements.len() }),
        false => Value::Null,
    }
}

/// What `fit` and `eval` both report: how well a blob describes logs.
#[derive(Clone, Debug, Serialize)]
pub struct Report {
    /// Equation of the model: "12", "15", "30" or "31"; "field" for the field model.
    pub model: &'static str,
    /// Rows of the logs named.
    pub rows: usize,
    /// Rows that the errors are over: those of the logs, and in a fit to a long log those of its sample.
    pub judged_rows: usize,
    /// Rows that the fit used: of a long log those of a sample at most.
    pub train_rows: usize,
    /// Movements of the logs named.
    pub movements: usize,
    /// Rows that were skipped as bad.
    pub skipped_rows: usize,
    /// Time of the whole command up to here, log reading included, s.
    pub elapsed_s: f64,
    /// Fitness over the rows that the fit used, with the solver's own zero deviations; for `eval`
    /// that of the errors below.
    pub train_fitness: f64,
    /// Over the judged rows; zero deviations refitted unless `delta` says zero.
    pub errors: Value,
    /// How zero deviations were treated: "fit" or "zero".
    pub delta: &'static str,
    /// By name: lever_arm, theta, eta, a, b, c of the probes a, b, c; of the field model all 81.
    pub parameters: BTreeMap<String, Parameter>,
    /// H1x .. H3y nearest to the designed ones.
    pub coordinates: Value,
    /// Serial number in the blob.
    pub serial: String,
    /// Of a long log the rows that fit, diagnosis and figures use; null where they use all.
    pub excerpt: Value,
    /// Zero deviation of each movement that was judged.
    pub zero_deviations: Vec<MovementZero>,
    /// What the user should know.
    pub warnings: Vec<String>,
    /// Whether the blob can be used; null where the log cannot show that for a blob.
    pub verdict: Option<Verdict>,
    /// Errors of the blob that are predicted for service; null where the log cannot show them.
    pub predicted: Option<Predicted>,
    /// How far from the temperature of the log the blob is good, K; null where that is not known.
    pub valid_within_k: Option<f64>,
    /// The errors by degree of mount and body, where the logs have temperatures.
    pub temperatures: Vec<Value>,
    /// What a diagnosis of the log found, by severity.
    #[serde(serialize_with = "words::serialize")]
    pub findings: Vec<Finding>,
    /// The same errors log by log.
    pub logs: Vec<Value>,
    /// The inputs whose errors no log shows, with what 1 % costs.
    pub trusted_inputs: Value,
    /// What only a fit has: see [`of_fit`]. Of a judgement those keys of it that programs may look up in
    /// any report, null.
    #[serde(flatten)]
    pub of_fit: Map<String, Value>,
}

impl Report {
    /// What tables of figures leave out: what is shown in another way, or nowhere.
    fn hidden(&self) -> Vec<&'static str> {
        let mut hidden = vec![
            "parameters",
            "zero_deviations",
            "coordinates",
            "warnings",
            "findings",
            "verdict",
            "predicted",
            "valid_within_k",
            "elapsed_s",
            "solver_s",
        ];
        if self.logs.len() < 2 {
            hidden.push("logs");
        }
        if self.temperatures.len() < 2 {
            hidden.push("temperatures");
        }
        hidden
    }

    /// Its tables, without what is hidden and those of `more` keys.
    pub fn details(&self, more: &[&str]) -> Vec<Table> {
        tables(self, &[&self.hidden()[..], more].concat())
    }
}

/// What a command knows besides the fit or judgement itself.
#[derive(Clone, Debug)]
pub struct Circumstances<'a> {
    /// The stage.
    pub stage: &'a Stage,
    /// The rows.
    pub dataset: &'a Dataset,
    /// Rows skipped as bad.
    pub skipped_rows: usize,
    /// Time so far, s.
    pub elapsed_s: f64,
    /// Warnings from reading.
    pub warnings: Vec<String>,
    /// What a diagnosis of the log found.
    pub diagnosis: Diagnosis,
}

impl<'a> Circumstances<'a> {
    /// Of a log that was read, so long after the start, and diagnosed.
    pub fn new(
        log: &'a LogReading,
        stage: &'a Stage,
        elapsed_s: f64,
        diagnosis: Diagnosis,
    ) -> Self {
        let warnings = words::messages(&log.warnings);
        Self {
            stage,
            dataset: &log.dataset,
            skipped_rows: log.skipped_rows,
            elapsed_s,
            warnings,
            diagnosis,
        }
    }
}

/// The movements that were judged, by their names in the dataset.
fn movement_zeros(dataset: &Dataset, judgement: &Judgement) -> Vec<MovementZero> {
    let one = |(k, movement): (usize, &Movement)| {
        let zero = &judgement.zeros[k];
        let [a_um, b_um, c_um] = zero.delta_m.map(|d| d * 1e6);
        let [z_um, rx_urad, ry_urad] = judgement.settings[k].map(|x| x * 1e6);
        MovementZero {
            movement: dataset.movement_name(movement),
            rows: movement.rows.len(),
            z_um,
            rx_urad,
            ry_urad,
            errors: errors(&judgement.by_movement[k]),
            a_um,
            b_um,
            c_um,
            is_beyond: zero.is_beyond,
        }
    };
    judgement.movements.iter().enumerate().map(one).collect()
}

/// What led to a fit.
#[derive(Clone, Debug)]
pub struct Choice {
    /// Name of the solver.
    pub solver: &'static str,
    /// How much was projected out.
    pub project: &'static str,
    /// Seed.
    pub seed: u64,
}

/// The report of a fit. What only a fit has:
///
/// | key | what |
/// |---|---|
/// | `model_reason`, `solver`, `project`, `seed` | why this model, and how it was fitted |
/// | `evaluations`, `solver_s`, `stopped` | evaluations of the cost, time of the solver alone, why it stopped |
/// | `loss`, `outlier_rows` | what the weights of the rows are by, also where the log lets none act; rows that count less than half, of a long log those of the sample |
/// | `standard_errors` | what the standard errors of the parameters are |
/// | `correlations` | pairs of parameters with a correlation above 0.95 or below -0.95 |
/// | `errors_solver_delta` | errors with the solver's own zero deviations; null of a judgement |
/// | `field` | what a fit of the field model says of itself; null for other models |
/// | `reference_lag` | lag of the reference, us, positive where it shows an earlier pose, with its standard error and whether it was taken off before the fit; null where no motion shows it |
pub fn of_fit(fit: &Fit, choice: Choice, c: &Circumstances) -> Report {
    let parameters = match &fit.field {
        Some(field) => field_parameters(
            &field.parameters.probes,
            Some(&field.posterior.standard_errors()),
        ),
        None => parameters(fit.model, &fit.solution.parameters, &fit.standard_error),
    };
    let by_row = fit.decoded.errors_less(&fit.judgement.zeros, c.dataset);
    let warnings = words::messages(&fit.warnings);
    let standard_errors = match fit.field {
        Some(_) => {
            "posterior: from the curvature under white noise of the probes and a walk of the reference, with the prior"
        }
        None => {
            "sandwich over movements, or blocks of 0.5 s where there are fewer than 20: drift is in it, what the model lacks is not"
        }
    };
    let correlations = fit.correlations.iter().map(field::correlation);
    let lag = fit.lag.map(|lag| {
        json!({
            "value_us": lag.value_s * 1e6,
            "standard_error_us": lag.standard_error_s * 1e6,
            "compensated": fit.later.is_some(),
        })
    });
    let of_fit = json!({
        "model_reason": fit.model_reason,
        "solver": choice.solver,
        "project": choice.project,
        "seed": choice.seed,
        "evaluations": fit.solution.evaluations,
        "solver_s": fit.solution.elapsed.as_secs_f64(),
        "stopped": fit.solution.stopped,
        "loss": fit.loss.name(),
        "outlier_rows": fit.left_out.rows,
        "standard_errors": standard_errors,
        "correlations": correlations.collect::<Vec<_>>(),
        "errors_solver_delta": errors(&fit.errors_solver_zeros),
        "field": fit.field.as_ref().map(field::figures),
        "reference_lag": lag,
    });
    Report {
        train_fitness: fit.train_fitness,
        parameters,
        coordinates: coordinates(fit.solution.parameters.nearest_places_m(c.stage)),
        warnings: c.warnings.iter().cloned().chain(warnings).collect(),
        of_fit: of_fit.as_object().cloned().unwrap_or_default(),
        ..of_eval(
            &fit.set,
            &fit.judgement,
            Zeros::of_model(fit.model),
            &by_row,
            c,
        )
    }
}

/// The report of a judgement of a blob; `by_row` are the errors of the rows of the dataset.
pub fn of_eval(
    set: &ParameterSet,
    judgement: &Judgement,
    zeros: Zeros,
    by_row: &RowErrors,
    c: &Circumstances,
) -> Report {
    let dataset = c.dataset;
    Report {
        model: Model::of(set.model).name,
        rows: dataset.read().0,
        judged_rows: judgement.rows(),
        train_rows: set.fit.train_rows as usize,
        movements: dataset.read().1,
        skipped_rows: c.skipped_rows,
        elapsed_s: c.elapsed_s,
        train_fitness: judgement.errors.fitness(),
        errors: errors(&judgement.errors),
        delta: zeros.name(),
        parameters: parameters_in(set),
        coordinates: coordinates(Parameters::of_set(set).nearest_places_m(c.stage)),
        serial: set.serial.as_str().to_owned(),
        excerpt: excerpt(dataset),
        zero_deviations: movement_zeros(dataset, judgement),
        warnings: c.warnings.clone(),
        verdict: c.diagnosis.verdict,
        predicted: c.diagnosis.predicted,
        valid_within_k: c.diagnosis.validity.map(|validity| validity.within_k),
        temperatures: by_temperature(dataset, by_row),
        findings: c.diagnosis.findings.clone(),
        logs: by_log(dataset, judgement),
        trusted_inputs: trusted(set),
        of_fit: OF_FIT
            .map(|key| (key.to_owned(), Value::Null))
            .into_iter()
            .collect(),
    }
}
