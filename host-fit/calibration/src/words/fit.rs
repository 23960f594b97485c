//! Why there is no fit, why this model, and why a solver stopped.

use crate::fit::{Fit, FitError, ModelReason};
use crate::judge::identify::FitFailure;
use hallstage_input::axis::sign;
use hallstage_input::channel::Channel;
use hallstage_solver::estimator::error::FieldFitError;
use hallstage_solver::estimator::paper_terms::shown;
use hallstage_solver::estimator::service::Comparison;
use hallstage_solver::solve::search::run::StopReason;
use hallstage_solver::solve::{SolveError, Stopped};
use runtime::ModelKind;
use std::fmt::{Display, Formatter, Result};

impl Display for FitError {
    fn fmt(&self, f: &mut Formatter<'_>) -> Result {
        match self {
            Self::Failed(failure) => failure.fmt(f),
            Self::Solver(error) => f.write_str(&unsolved(error)),
            Self::Field(error) => f.write_str(&no_field(error)),
            Self::AtPole { solver } => write!(
                f,
                "the {solver} search ended with a row of the log next to a pole of 1/phi, where nothing can be judged: let it run longer (--generations, --population), use --project delta or linear, or take the default solver"
            ),
            Self::Unusable(error) => write!(
                f,
                "the fitted parameters cannot be used: {error}. Check the vertical motion in the log and the search ranges"
            ),
        }
    }
}

impl Display for FitFailure {
    fn fmt(&self, f: &mut Formatter<'_>) -> Result {
        match self {
            Self::TooFewRows {
                rows,
                unknowns,
                model,
            } => write!(
                f,
                "{rows} rows cannot determine {unknowns} unknowns of model ({model}): use a longer log or a larger --train"
            ),
            Self::NoMotion {
                motion,
                span_micro,
                noise_micro,
                parameters,
            } => {
                let (axis, unit) = (motion.title(), sign(motion.micro_unit()));
                let (record, without) = (recording(*motion), without(*motion));
                write!(
                    f,
                    "{axis} does not move in the log (span {span_micro:.3} {unit}, noise {noise_micro:.3} {unit}), so {parameters} cannot be found: record {record}{without}"
                )
            }
            Self::DeadProbe {
                probe,
                span_micro,
                noise_micro,
            } => write!(
                f,
                "Hall probe {probe} does not follow the motion in the log (span {span_micro:.3} µm, noise {noise_micro:.3} µm): check the probe, its cable and its column"
            ),
            Self::NotDetermined {
                parameters,
                motions,
            } => {
                let what = parameters.iter().map(|(id, error)| match error {
                    Some(error) => format!(
                        "{} (standard error {error:.3e} {})",
                        id.name(),
                        id.term.unit
                    ),
                    None => id.name(),
                });
                let what = what.collect::<Vec<_>>().join(", ");
                let record: Vec<_> = motions.iter().copied().map(recording).collect();
                let is_flat = parameters
                    .iter()
                    .any(|(id, error)| error.is_none() && id.is_slope());
                let flat = if is_flat {
                    "; without vertical motion use --model 30"
                } else {
                    ""
                };
                write!(
                    f,
                    "the log does not determine {what}: record independent {}, with larger amplitude or more rows (or, if --solver named a search, it may have ended far from the best fit: take the default){flat}",
                    record.join(", ")
                )
            }
            Self::NotDescribed {
                model,
                motion,
                error_micro,
                motion_micro,
            } => {
                let (axis, unit) = (motion.title(), sign(motion.micro_unit()));
                write!(
                    f,
                    "the fitted model ({model}) does not describe this log: its errors are {error_micro:.1} {unit} rms in {axis}, the motion itself has {motion_micro:.1} {unit} rms. Check the columns, the order and signs of the sensors and the scales in stage.toml, and record a log where the stage moves along {axis}"
                )
            }
        }
    }
}

/// What to record, after "record" or "record independent".
fn recording(axis: Channel) -> String {
    match axis {
        Channel::Z => "movements at different heights Z".to_owned(),
        Channel::Rx | Channel::Ry => format!("movements at different tilts {}", axis.title()),
        _ => format!("{} motion", axis.title()),
    }
}

/// The way out where a log has no vertical motion.
const fn without(axis: Channel) -> &'static str {
    match axis {
        Channel::Z | Channel::Rx | Channel::Ry => {
            ", or fit a model without vertical terms (--model 30)"
        }
        _ => "",
    }
}

/// Why a solver found nothing.
fn unsolved(error: &SolveError) -> String {
    match error {
        SolveError::NoPlanarMotion => "the log does not move the stage in X, Y and Rz independently, so the three probes cannot be separated: record movements along each of the three axes".to_owned(),
        SolveError::NoUsableStart => "every start of the search has a row beside a pole of 1/phi or a singular PM, so there is nothing to improve. Check the search ranges in stage.toml against the vertical motion in the log".to_owned(),
        SolveError::Unsupported { solver, model, projection } => format!(
            "solver {solver} cannot solve model ({model}) with --project {projection}: in this form only a model with slopes has unknowns left to search for: use --project delta or none, or --solver lm"
        ),
    }
}

/// Why the field model cannot be fitted.
pub(super) fn no_field(error: &FieldFitError) -> String {
    match error {
        FieldFitError::NotCarried(comparison) => compared(comparison),
        FieldFitError::Singular => "the log does not determine the field model: several parameters show only together. Record all six axes moving at once, each at a frequency of its own".to_owned(),
        FieldFitError::FarOff { parameter, value, unit, low, high } => {
            let [(value, unit), (low, low_unit), (high, high_unit)] =
                [value, low, high].map(|x| shown(*x, unit));
            format!(
                "{parameter} would be {value:.4} {unit}, far outside its search range from {low:.4} {low_unit} to {high:.4} {high_unit}: check the columns, the order and the signs of the sensors in the log and in stage.toml"
            )
        }
    }
}

/// Why the field model, or why not.
fn compared(comparison: &Comparison) -> String {
    let words = |[x, y, rz]: [f64; 3]| {
        format!("{x:.2} / {y:.2} / {rz:.2} times the noise floor in X / Y / Rz")
    };
    let (field, model_31) = (comparison.service.ratios(), comparison.service.ratios_31());
    let (field, model_31) = (words(field), words(model_31));
    if comparison.field {
        format!(
            "the field model: errors predicted over the range of the log are {field}, and with model (31) {model_31}"
        )
    } else if comparison.loses() {
        format!(
            "by this log the field model has errors of {field}; record all six axes moving at once, and for longer (host-fit plan makes such a run)"
        )
    } else {
        "the field model finds nothing that model (31) lacks".to_owned()
    }
}

/// Why a fit is of this model, in a line.
pub fn model_reason(fit: &Fit) -> String {
    let reason = match &fit.model_reason {
        ModelReason::Asked => "--model asks for it".to_owned(),
        ModelReason::OtherSolver => "--solver and --project choose how models of the paper are fitted; the field model has a way of its own".to_owned(),
        ModelReason::Compared(comparison) => compared(comparison),
        ModelReason::NoField(error) => error.to_string(),
    };
    match fit.model.kind {
        ModelKind::Field => reason,
        _ => format!("model ({}): {reason}", fit.model.name),
    }
}

/// Why a solver stopped.
pub fn stopped(stopped: &Stopped) -> String {
    match stopped {
        Stopped::Converged => "converged".to_owned(),
        Stopped::NoLowerCost => "no further step lowers the cost".to_owned(),
        Stopped::FieldModel { steps } => {
            format!("maximum a posteriori reached {steps} steps after model (31)")
        }
        Stopped::Search {
            reason,
            nan_costs,
            evaluations,
        } => format!(
            "{}; {nan_costs} of {evaluations} evaluations had no cost",
            search_stopped(*reason)
        ),
    }
}

/// Why a search stopped.
pub const fn search_stopped(reason: StopReason) -> &'static str {
    match reason {
        StopReason::Interrupted => "interrupted; the best so far is kept",
        StopReason::Generations => "all generations were run",
        StopReason::Evaluations => "the budget of evaluations was used",
        StopReason::Stall => "the best cost no longer fell",
    }
}
