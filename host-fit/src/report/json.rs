//! The machine-readable report of `fit`, `eval` and `inspect`.

use crate::diagnose::finding::Finding;
use crate::diagnose::trusted::{Trusted, trusted};
use crate::fit::{CrossValidation, Fit};
use crate::input::dataset::{Dataset, Movement};
use crate::input::stage::Stage;
use crate::judge::whole::WholeJudgement;
use crate::judge::{Decoded, Judgement, Zeros};
use crate::problem::model::Model;
use crate::problem::parameters::Parameters;
use crate::problem::zero_deviation::ZeroDeviation;
use crate::report::errors::{Errors, LogErrors, by_log, of_whole};
use crate::report::field::{ByAxis, Correlation, FieldReport};
use crate::report::parameters::{
    Coordinates, Parameter, field_parameters, parameters, parameters_in,
};
use runtime::ParameterSet;
use serde::Serialize;
use std::collections::BTreeMap;

/// By how much the reference lags behind the probes.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct ReferenceLag {
    /// Positive where the reference shows an earlier pose, us.
    pub value_us: f64,
    /// us.
    pub standard_error_us: f64,
    /// Whether it was taken off before the fit.
    pub compensated: bool,
}

/// The zero deviation of one movement.
#[derive(Clone, Debug, Serialize)]
pub struct MovementZero {
    /// Its number, after the name of its log where there are several.
    pub movement: String,
    /// At probe A, um.
    pub a_um: f64,
    /// At probe B, um.
    pub b_um: f64,
    /// At probe C, um.
    pub c_um: f64,
    /// Whether it was clipped to its range.
    pub clipped: bool,
}

/// The rows of a long log that a fit, a diagnosis and figures use.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Excerpt {
    /// How many.
    pub rows: usize,
    /// How many runs of rows that follow each other.
    pub runs: usize,
}

impl Excerpt {
    /// `None` if the rows are all.
    pub fn of(dataset: &Dataset, whole: Option<&WholeJudgement>) -> Option<Self> {
        whole.map(|_| Self {
            rows: dataset.rows.len(),
            runs: dataset.movements.len(),
        })
    }
}

/// What `fit` and `eval` both report.
#[derive(Clone, Debug, Serialize)]
pub struct Report {
    /// Equation of the model: "12", "15", "30" or "31"; "field" for the field model.
    pub model: String,
    /// The same for a title.
    #[serde(skip)]
    pub model_title: String,
    /// Why this model; null for `eval`.
    pub model_reason: Option<String>,
    /// Solver; null for `eval`.
    pub solver: Option<String>,
    /// How much was projected out; null for `eval`.
    pub project: Option<&'static str>,
    /// Seed; null for `eval`.
    pub seed: Option<u64>,
    /// The loss that the weights of the rows are by: "cauchy", "huber" or "none", also where the
    /// log lets none act; null for `eval`.
    pub loss: Option<&'static str>,
    /// Rows that count less than half in the fit, as the loss says; of a long log those of all rows
    /// whose errors are beyond any that the fit kept; null for `eval`.
    pub outlier_rows: Option<usize>,
    /// What the standard errors of the parameters are; null for `eval`.
    pub standard_errors: Option<&'static str>,
    /// Pairs of parameters with a correlation above 0.95 or below -0.95.
    pub correlations: Vec<Correlation>,
    /// Errors on rows left out; null unless asked for.
    pub cross_validation: Option<CrossValidated>,
    /// Rows of the logs named.
    pub rows: usize,
    /// Rows that the fit used: of a long log those of an excerpt at most.
    pub train_rows: usize,
    /// Movements of the logs named.
    pub movements: usize,
    /// Rows that were skipped as bad.
    pub skipped_rows: usize,
    /// Evaluations of the cost; null for `eval`.
    pub evaluations: Option<u64>,
    /// Time of the whole command up to here, log reading included, s.
    pub elapsed_s: f64,
    /// Time of the solver alone, s; null for `eval`.
    pub solver_s: Option<f64>,
    /// Why the solver stopped; null for `eval`.
    pub stopped: Option<String>,
    /// Fitness over the rows that the fit used, with the solver's own zero deviations; for `eval`
    /// that of the errors below.
    pub train_fitness: f64,
    /// Over all rows of the logs named; zero deviations refitted unless `delta` says zero.
    pub errors: Errors,
    /// Over the same rows with the solver's own zero deviations; null where there are none, and for
    /// a long log, of which only an excerpt has them.
    pub errors_solver_delta: Option<Errors>,
    /// How zero deviations were treated: "fit" or "zero".
    pub delta: &'static str,
    /// The same for a title.
    #[serde(skip)]
    pub zeros_in_words: &'static str,
    /// By name: lever_arm, theta, eta, a, b, c of the probes a, b, c; of the field model all 81.
    pub parameters: BTreeMap<String, Parameter>,
    /// What a fit of the field model says of itself; null for other models and for `eval`.
    pub field: Option<FieldReport>,
    /// Lag of the reference; null for `eval` and where no motion shows it.
    pub reference_lag: Option<ReferenceLag>,
    /// H1x .. H3y nearest to the designed ones.
    pub coordinates: Coordinates,
    /// Serial number in the blob.
    pub serial: String,
    /// Of a long log the rows that fit, diagnosis and figures use; null where they use all.
    pub excerpt: Option<Excerpt>,
    /// Zero deviation of each movement of the logs named; of a long log that `eval` judged, of each
    /// run of its excerpt.
    pub zero_deviations: Vec<MovementZero>,
    /// What the user should know.
    pub warnings: Vec<String>,
    /// What a diagnosis of the log found, the gravest first.
    pub findings: Vec<Finding>,
    /// The same errors log by log.
    pub logs: Vec<LogErrors>,
    /// The inputs whose errors no log shows, with what 1 % costs.
    pub trusted_inputs: Vec<Trusted>,
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
    /// What a diagnosis of the log found, the gravest first.
    pub findings: Vec<Finding>,
}

/// The zero deviations of the movements of a dataset, or of those of the logs that it is an excerpt
/// of.
pub(super) fn movement_zeros(
    dataset: &Dataset,
    movements: &[Movement],
    zeros: &[ZeroDeviation],
) -> Vec<MovementZero> {
    let movements = movements.iter().zip(zeros);
    movements
        .map(|(movement, zero)| {
            let [a_um, b_um, c_um] = zero.delta_m.map(|d| d * 1e6);
            MovementZero {
                movement: dataset.movement_name(movement),
                a_um,
                b_um,
                c_um,
                clipped: zero.clipped,
            }
        })
        .collect()
}

/// Those of the movements of the logs named, or of the runs of an excerpt, where only that is held.
fn zero_deviations(
    judgement: &Judgement,
    judged: Option<&WholeJudgement>,
    dataset: &Dataset,
) -> Vec<MovementZero> {
    match (judged, &dataset.whole) {
        (Some(judged), Some(whole)) => movement_zeros(dataset, whole.movements(), &judged.zeros),
        _ => movement_zeros(dataset, &dataset.movements, &judgement.zeros),
    }
}

/// Errors on rows left out.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct CrossValidated {
    /// How many groups there were.
    pub groups: usize,
    /// What rows were left out by: "movements" or "time".
    pub split: &'static str,
    /// rms over rows decoded by the fit that had not seen their group; outliers do not count.
    pub left_out: ByAxis,
    /// rms over the same rows by the fit to all.
    pub in_fit: ByAxis,
}

impl From<&CrossValidation> for CrossValidated {
    fn from(found: &CrossValidation) -> Self {
        Self {
            groups: found.groups,
            split: found.split.name(),
            left_out: ByAxis::of_si(found.left_out),
            in_fit: ByAxis::of_si(found.in_fit),
        }
    }
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
    /// Whether the lag of the reference was taken off.
    pub lag_compensated: bool,
}

/// The report of a fit.
pub fn of_fit(fit: &Fit, choice: Choice, c: &Circumstances) -> Report {
    let parameters_fitted = &fit.solution.parameters;
    let zeros = Zeros::of_model(fit.model);
    let mut warnings = c.warnings.clone();
    warnings.extend(fit.warnings.iter().map(ToString::to_string));
    Report {
        model: fit.model.name.to_owned(),
        model_title: fit.model.title(),
        model_reason: Some(fit.model_reason.clone()),
        solver: Some(choice.solver.to_owned()),
        project: Some(choice.project),
        seed: Some(choice.seed),
        loss: Some(fit.loss.name()),
        outlier_rows: Some(fit.left_out.rows),
        standard_errors: Some(match fit.field {
            Some(_) => {
                "posterior: from the curvature under white noise of the probes and a walk of the reference, with the prior"
            }
            None => {
                "sandwich over movements, or blocks of 0.5 s where there are fewer than 20: drift is in it, what the model lacks is not"
            }
        }),
        correlations: (fit.correlations.iter())
            .map(|(a, b, correlation)| Correlation {
                parameters: [a.clone(), b.clone()],
                correlation: *correlation,
            })
            .collect(),
        cross_validation: None,
        rows: c.dataset.named().0,
        train_rows: fit.train_rows,
        movements: c.dataset.named().1,
        skipped_rows: c.skipped_rows,
        evaluations: Some(fit.solution.evaluations),
        elapsed_s: c.elapsed_s,
        solver_s: Some(fit.solution.elapsed.as_secs_f64()),
        stopped: Some(fit.solution.stopped.clone()),
        train_fitness: fit.train_fitness,
        errors: Errors::from(fit.errors()),
        // An excerpt has no zero deviations of the movements as they are.
        errors_solver_delta: (fit.whole.is_none())
            .then(|| Errors::from(&fit.judgement_solver_zeros.errors)),
        delta: zeros.name(),
        zeros_in_words: zeros.words(),
        parameters: match &fit.field {
            Some(field) => field_parameters(
                &field.parameters.probes,
                Some(&field.posterior.standard_errors()),
            ),
            None => parameters(fit.model, parameters_fitted, &fit.standard_error),
        },
        field: fit.field.as_ref().map(FieldReport::new),
        reference_lag: fit.lag.map(|lag| ReferenceLag {
            value_us: lag.value_s * 1e6,
            standard_error_us: lag.standard_error_s * 1e6,
            compensated: choice.lag_compensated,
        }),
        coordinates: c
            .stage
            .designed
            .nearest_with(&parameters_fitted.geometry())
            .into(),
        serial: fit.set.serial.as_str().to_owned(),
        excerpt: Excerpt::of(c.dataset, fit.whole.as_ref()),
        zero_deviations: zero_deviations(&fit.judgement, fit.whole.as_ref(), c.dataset),
        warnings,
        findings: c.findings.clone(),
        logs: match &fit.whole {
            Some(whole) => of_whole(c.dataset, whole),
            None => by_log(&fit.decoded, &fit.judgement, c.dataset),
        },
        trusted_inputs: trusted(&fit.set),
    }
}

/// The report of a judgement of a blob.
pub fn of_eval(
    set: &ParameterSet,
    decoded: &Decoded,
    judgement: &Judgement,
    whole: Option<&WholeJudgement>,
    zeros: Zeros,
    c: &Circumstances,
) -> Report {
    let model = Model::of(set.model);
    let values = Parameters::of_set(set);
    let errors = whole.map_or(&judgement.errors, |whole| &whole.errors);
    Report {
        model: model.name.to_owned(),
        model_title: model.title(),
        model_reason: None,
        solver: None,
        project: None,
        seed: None,
        loss: None,
        outlier_rows: None,
        standard_errors: None,
        correlations: Vec::new(),
        cross_validation: None,
        rows: whole.map_or(c.dataset.rows.len(), WholeJudgement::rows),
        train_rows: set.fit.train_rows as usize,
        movements: whole.map_or(c.dataset.movements.len(), |whole| whole.zeros.len()),
        skipped_rows: c.skipped_rows,
        evaluations: None,
        elapsed_s: c.elapsed_s,
        solver_s: None,
        stopped: None,
        train_fitness: errors.fitness(),
        errors: Errors::from(errors),
        errors_solver_delta: None,
        delta: zeros.name(),
        zeros_in_words: zeros.words(),
        parameters: parameters_in(set),
        field: None,
        reference_lag: None,
        coordinates: c.stage.designed.nearest_with(&values.geometry()).into(),
        serial: set.serial.as_str().to_owned(),
        excerpt: Excerpt::of(c.dataset, whole),
        zero_deviations: zero_deviations(judgement, whole, c.dataset),
        warnings: c.warnings.clone(),
        findings: c.findings.clone(),
        logs: match whole {
            Some(whole) => of_whole(c.dataset, whole),
            None => by_log(decoded, judgement, c.dataset),
        },
        trusted_inputs: trusted(set),
    }
}
