//! The report of a fit, or of a blob that was judged: made once, shown as JSON, as tables and as a page.

use super::budget;
use super::channels::channels;
use super::errors::{RowErrors, errors, errors_per_degree, errors_per_log};
use super::field;
use super::figure::{Figure, Group, Item, bare, figure, group};
use super::motion::{probe_motion, valid_up_to};
use super::parameters::{Parameter, coordinates, field_parameters, parameters, parameters_in};
use super::reference::reference;
use hallstage_calibration::diagnose::Diagnosis;
use hallstage_calibration::diagnose::refusal::Refusal;
use hallstage_calibration::fit::{Fit, FitSettings};
use hallstage_calibration::judge::statistics::PoseError;
use hallstage_calibration::judge::{Judgement, Zeros};
use hallstage_calibration::words::{self, WordedRefusal};
use hallstage_input::axis::PROBES;
use hallstage_input::dataset::{Dataset, Movement};
use hallstage_input::log::LogReading;
use hallstage_input::stage::Stage;
use hallstage_solver::estimator::model::Model;
use hallstage_solver::estimator::paper::Parameters;
use hallstage_solver::solve::{Projection, Solver};
use runtime::ParameterSet;
use serde::{Serialize, Serializer};
use serde_json::json;
use std::collections::BTreeMap;

/// How well a blob describes logs, and the results of the fit.
#[derive(Clone, Debug)]
pub struct Report {
    /// The blob.
    pub set: ParameterSet,
    /// All figures.
    pub figures: Group,
    /// The parameters by name.
    pub parameters: BTreeMap<String, Parameter>,
    /// Setting, errors and zero deviation of each movement that was judged.
    pub movements: Vec<Group>,
    /// What the user should know.
    pub warnings: Vec<String>,
    /// Errors of the rows of the dataset, zero deviations taken off.
    pub by_row: RowErrors,
    /// Errors over these rows.
    pub over_rows: PoseError,
}

impl Serialize for Report {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        self.figures.serialize(to)
    }
}

/// A blob judged on logs.
#[derive(Clone, Debug)]
pub struct Judged<'a> {
    /// The blob.
    pub set: &'a ParameterSet,
    /// Over all rows that were judged.
    pub judgement: &'a Judgement,
    /// How zero deviations were treated.
    pub zeros: Zeros<'static>,
    /// Errors of the rows of the dataset, zero deviations taken off.
    pub by_row: RowErrors,
    /// Errors over these rows.
    pub over_rows: PoseError,
    /// The stage.
    pub stage: &'a Stage,
    /// The rows.
    pub dataset: &'a Dataset,
    /// Rows skipped as bad.
    pub skipped_rows: usize,
    /// Time so far, s.
    pub elapsed_s: f64,
    /// Findings of the reading, and of the judgement itself.
    pub warnings: Vec<String>,
    /// What a diagnosis of the log found.
    pub diagnosis: &'a Diagnosis,
    /// Why the blob is not to be used.
    pub refusal: Option<&'a Refusal>,
}

impl Report {
    /// The report of a blob that was judged.
    ///
    /// | key | what |
    /// |---|---|
    /// | `model` | equation of the model: "12", "15", "30" or "31"; "field" for the field model |
    /// | `rows`, `movements`, `skipped_rows` | of the logs named; rows that were skipped as bad |
    /// | `judged_rows`, `train_rows` | rows that the errors are over, in a fit to a long log its sample; rows that the fit used |
    /// | `elapsed_s` | time of the whole command, log reading included |
    /// | `train_fitness` | fitness over the rows that the fit used, with the solver's own zero deviations; for `eval` over the judged rows |
    /// | `errors`, `delta` | over the judged rows; how zero deviations were treated: "fit" or "zero" |
    /// | `parameters` | by name; of the field model all 81 |
    /// | `coordinates` | H1x .. H3y nearest to the designed ones |
    /// | `excerpt` | rows of a long log that fit, diagnosis and figures use, and their runs of successive rows; null for all rows |
    /// | `zero_deviations` | of each movement that was judged |
    /// | `verdict`, `predicted`, `valid_within_k` | whether the blob can be used, its errors predicted for service, how far from the temperature of the log they hold; null where the log cannot show them |
    /// | `valid_up_to` | the largest rms acceleration and speed of all axes at once with good errors |
    /// | `budget` | sources of uncertainty with their contributions to X, Y, Rz, combined and expanded; inputs not included |
    /// | `temperatures`, `logs` | the errors by degree of mount and body, and log by log |
    /// | `channels` | properties of each column of the logs |
    /// | `reference` | the calibrated point, and the places of the beams |
    pub fn from_judgement(judged: Judged) -> Self {
        let Judged {
            set,
            judgement,
            dataset,
            diagnosis,
            ..
        } = judged;
        let findings = &diagnosis.findings;
        let refusal = judged.refusal.map(|why| WordedRefusal(why, findings));
        let (rows, movements) = dataset.read();
        let (used, runs) = (dataset.rows.len(), dataset.movements.len());
        let excerpt = (used < rows).then(|| group! { "rows" => used, "runs" => runs });
        let parameters = parameters_in(set);
        let zero_deviations = zero_deviations(dataset, judgement);
        let places_m = Parameters::from_set(set).nearest_places_m(judged.stage);
        let figures = group! {
            "model" => Model::from_kind(set.model).name,
            "rows" => rows,
            "judged_rows" => judgement.rows(),
            "train_rows" => set.fit.train_rows,
            "movements" => movements,
            "skipped_rows" => judged.skipped_rows,
            "elapsed_s" => json!(judged.elapsed_s),
            "train_fitness" => bare(judgement.errors.fitness(), "um"),
            "errors" => errors(&judgement.errors),
            "delta" => judged.zeros.name(),
            "parameters" => json!(parameters),
            "coordinates" => json!(coordinates(places_m)),
            "serial" => set.serial.as_str(),
            "excerpt" => excerpt,
            "zero_deviations" => json!(zero_deviations),
            "warnings" => json!(judged.warnings),
            "verdict" => json!(diagnosis.verdict),
            "predicted" => json!(diagnosis.predicted),
            "budget" => diagnosis.budget.as_ref().map(budget::figures),
            "valid_within_k" => json!(diagnosis.validity.map(|validity| validity.within_k)),
            "valid_up_to" => json!(diagnosis.up_to.map(valid_up_to)),
            "temperatures" => several(errors_per_degree(dataset, &judged.by_row)),
            "findings" => json!(words::worded(findings)),
            "channels" => channels(&diagnosis.columns, dataset),
            "logs" => several(errors_per_log(dataset, judgement)),
            "reference" => reference(judged.stage),
            "refusal" => json!(refusal),
            // Programs may look these up in any report.
            "model_reason" => Figure::None,
            "solver" => Figure::None,
            "project" => Figure::None,
            "seed" => Figure::None,
            "evaluations" => Figure::None,
            "errors_solver_delta" => Figure::None,
        };
        Self {
            set: set.clone(),
            figures,
            parameters,
            movements: zero_deviations,
            warnings: judged.warnings,
            by_row: judged.by_row,
            over_rows: judged.over_rows,
        }
    }

    /// The report of a fit. Only a fit has:
    ///
    /// | key | what |
    /// |---|---|
    /// | `model_reason`, `solver`, `project`, `seed` | why this model, and how it was fitted |
    /// | `evaluations`, `solver_s`, `stopped` | evaluations of the cost, time of the solver alone, why it stopped |
    /// | `loss`, `outlier_rows` | the loss that weights the rows; rows of the sample that count less than half |
    /// | `standard_errors` | what the standard errors of the parameters include |
    /// | `correlations` | pairs of parameters with a correlation above 0.95 or below -0.95 |
    /// | `errors_solver_delta` | errors with the solver's own zero deviations |
    /// | `field` | figures of a fit of the field model; null for other models |
    /// | `probe_motion` | lags of A, B, C behind their mean; what the acceleration of X, Y, Rz, Z, Rx, Ry (rotations at 0.25 m) adds to the readings of A, then B, then C; standard errors of both; the matrices of the correction, SI |
    /// | `reference_lag` | lag of the reference, positive where it shows an earlier pose, and whether it was taken off; null where no motion shows it |
    pub fn from_fit(
        fit: &Fit,
        settings: &FitSettings,
        (log, stage): (&LogReading, &Stage),
        (loss, elapsed_s): (&str, f64),
        (diagnosis, refusal): (&Diagnosis, Option<&Refusal>),
    ) -> Self {
        let dataset = fit.rows(&log.dataset);
        let (solver, projection) = match fit.field {
            Some(_) => (Solver::LeastSquares, Projection::Linear),
            None => (settings.solver, settings.options.projection),
        };
        let (estimate, posterior) = (&fit.estimate, &fit.estimate.posterior);
        let model_31 = estimate.parameters.model_31();
        let mut report = Self::from_judgement(Judged {
            set: &fit.set,
            judgement: &fit.judgement,
            zeros: Zeros::for_model(fit.model),
            by_row: fit.errors_by_row(dataset),
            over_rows: fit.judgement.errors,
            stage,
            dataset,
            skipped_rows: log.skipped_rows,
            elapsed_s,
            warnings: words::messages(&log.warnings),
            diagnosis,
            refusal,
        });
        let (parameters, standard_errors) = match &fit.field {
            Some(_) => (
                field_parameters(
                    &estimate.parameters.probes,
                    Some(&posterior.standard_errors()),
                ),
                "posterior: from the curvature under white noise of the probes and a walk of the reference, with the prior",
            ),
            None => (
                parameters(fit.model, &model_31, &posterior.standard_errors_31()),
                "sandwich over movements, or blocks of 0.5 s where there are fewer than 20; it includes drift, not what the model lacks",
            ),
        };
        report.parameters = parameters;
        let places_m = model_31.nearest_places_m(stage);
        let lag = estimate.lag.map(|lag| {
            let value = figure(lag.value_s * 1e6, "us");
            group! {
                "value" => value.with_error(Some(lag.standard_error_s * 1e6)),
                "compensated" => fit.later.is_some(),
            }
        });
        let correlations = posterior.correlations_shown();
        let correlations: Vec<Group> = correlations.iter().map(field::correlation).collect();
        let own = group! {
            "train_fitness" => bare(fit.train_fitness(dataset, stage), "um"),
            "parameters" => json!(report.parameters),
            "coordinates" => json!(coordinates(places_m)),
            "model_reason" => words::model_reason(fit),
            "solver" => solver.name(),
            "project" => projection.name(),
            "seed" => settings.options.seed,
            "evaluations" => estimate.evaluations,
            "solver_s" => json!(estimate.elapsed.as_secs_f64()),
            "stopped" => words::stopped(&estimate.stopped),
            "loss" => loss,
            "outlier_rows" => fit.fitted.outliers().count(),
            "standard_errors" => standard_errors,
            "correlations" => correlations,
            "errors_solver_delta" => errors(&fit.errors_with_own_delta(dataset, stage)),
            "field" => fit.field.as_ref().map(|of| field::figures(of, posterior)),
            "reference_lag" => lag,
            "probe_motion" => probe_motion(fit),
        };
        own.0
            .into_iter()
            .for_each(|(name, item)| report.figures.set(&name, item));
        report
    }
}

/// A list that is shown only where it has several rows.
fn several(groups: Vec<Group>) -> Item {
    match groups.len() {
        0 | 1 => json!(groups).into(),
        _ => groups.into(),
    }
}

/// Name, setting, errors and zero deviation of each movement that was judged.
fn zero_deviations(dataset: &Dataset, judgement: &Judgement) -> Vec<Group> {
    let movement = |(k, movement): (usize, &Movement)| {
        let zero = &judgement.zeros[k];
        let [z, rx, ry] = judgement.settings[k].map(|x| x * 1e6);
        let mut group = group! {
            "movement" => dataset.movement_name(movement),
            "rows" => movement.rows.len(),
            "z" => figure(z, "um"),
            "rx" => figure(rx, "urad"),
            "ry" => figure(ry, "urad"),
            "errors" => errors(&judgement.by_movement[k]),
        };
        for (probe, delta_m) in PROBES.iter().zip(zero.delta_m) {
            group.set(&probe.to_lowercase(), figure(delta_m * 1e6, "um"));
        }
        group.set("is_beyond", zero.is_beyond);
        group
    };
    judgement
        .movements
        .iter()
        .enumerate()
        .map(movement)
        .collect()
}
