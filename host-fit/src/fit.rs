//! The main job: a dataset to a judged calibration.
//!
//! dataset -> rows drawn -> problem -> solver -> standard errors -> parameter set -> judgement.
//! Nothing is written here.

use crate::dataset::Dataset;
use crate::identify::{FitFailure, check_described, check_determined, check_motion};
use crate::judge::{Judgement, Zeros, judge};
use crate::parameters::{ParameterId, Parameters};
use crate::problem::Problem;
use crate::solver::{Solution, SolveError, Solver, SolverOptions};
use crate::stage::Stage;
use crate::train::{Draw, draw_rows};
use crate::uncertainty::{Uncertainty, uncertainty};
use runtime::calibration::Origin;
use runtime::parameters::{FitRecord, ParameterError, Text};
use runtime::{Calibration, ModelKind, ParameterSet};

/// Room around the motion of the log in which the calibration is still vouched for: offsets of
/// the reference and overshoot are well inside it.
const RANGE_MARGIN: f64 = 1.1;

/// What the user chose, besides the solver.
#[derive(Clone, Debug, PartialEq)]
pub struct FitSettings {
    /// The model.
    pub model: ModelKind,
    /// Rows to use; all if `None`.
    pub train: Option<usize>,
    /// How they are drawn.
    pub draw: Draw,
    /// For the solver; its seed also draws the rows.
    pub solver: SolverOptions,
    /// Serial number of the stage, for the blob.
    pub serial: Text,
    /// Creation time, for the blob.
    pub created: Text,
}

/// Something that the user should know of a fit that is good nevertheless.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum FitWarning {
    /// A parameter stands at an end of its search range.
    #[error(
        "{} stands at an end of its search range ({value:.6} {}): widen the range in stage.toml, or check the log",
        id.name(), id.unit()
    )]
    AtLimit {
        /// The parameter.
        id: ParameterId,
        /// Its value, SI.
        value: f64,
    },
    /// Zero deviations were clipped to their range.
    #[error(
        "the zero deviation of {count} of {of} movements was clipped to its range: widen search.delta_m in stage.toml if \
         the interferometers are reset less exactly than that"
    )]
    ZeroDeviationClipped {
        /// Movements with a clipped one.
        count: usize,
        /// All movements.
        of: usize,
    },
    /// The draw has no row of some movements.
    #[error(
        "the draw of rows misses {} movement(s) ({}): their zero deviation is free, and the solver's own is taken as zero. \
         Use --draw stratified, or a larger --train",
        movements.len(), join(movements)
    )]
    MovementsMissed {
        /// Their numbers in the log.
        movements: Vec<i64>,
    },
    /// Rows that the decoder refused count in no error.
    #[error("{rows} rows have codes that the decoder refuses; they are not part of the errors")]
    Undecoded {
        /// How many.
        rows: usize,
    },
}

fn join(numbers: &[i64]) -> String {
    let shown: Vec<String> = numbers.iter().take(10).map(i64::to_string).collect();
    let dots = if numbers.len() > 10 { ", ..." } else { "" };
    shown.join(", ") + dots
}

/// Why there is no calibration.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum FitError {
    /// The log cannot determine the model, or the model does not describe the log.
    #[error(transparent)]
    Failed(#[from] FitFailure),
    /// The solver found nothing.
    #[error(transparent)]
    Solver(#[from] SolveError),
    /// The fitted parameters cannot serve a decoder.
    #[error(
        "the fitted parameters cannot be used: {0}. Check the vertical motion in the log and the search ranges"
    )]
    Unusable(ParameterError),
}

/// A calibration with everything that is known about it.
#[derive(Clone, Debug, PartialEq)]
pub struct Fit {
    /// The model.
    pub model: ModelKind,
    /// What the solver found.
    pub solution: Solution,
    /// How well the log determines it.
    pub uncertainty: Uncertainty,
    /// The calibration in `f64`.
    pub calibration: Calibration,
    /// What goes into the blob.
    pub set: ParameterSet,
    /// Fitness over the rows that the fit used, with the solver's own zero deviations.
    pub train_fitness: f64,
    /// Rows that the fit used.
    pub train_rows: usize,
    /// Over all rows, by the target's decoder; zero deviations refitted where the model has them.
    pub judgement: Judgement,
    /// The same with the solver's own zero deviations.
    pub judgement_solver_zeros: Judgement,
    /// What the user should know.
    pub warnings: Vec<FitWarning>,
}

/// Fits, checks and judges.
///
/// # Errors
/// See [`FitError`].
pub fn fit(
    dataset: &Dataset,
    stage: &Stage,
    solver: &dyn Solver,
    settings: &FitSettings,
) -> Result<Fit, FitError> {
    let count = settings.train.unwrap_or(dataset.rows.len());
    let selected = draw_rows(dataset, count, settings.draw, settings.solver.seed);
    check_motion(dataset, stage, selected.len(), settings.model)?;
    let problem = Problem::new(dataset, &selected, stage, settings.model);
    let solution = solver.solve(&problem, &settings.solver)?;
    let uncertainty = uncertainty(&problem, &solution.parameters, &solution.at_limit)
        .ok_or(SolveError::NoUsableStart)?;
    check_determined(stage, &solution.parameters, &uncertainty)?;

    let calibration = calibration(dataset, stage, settings.model, &solution.parameters);
    let mut origin = Origin {
        serial: settings.serial.clone(),
        created: settings.created.clone(),
        logs_sha256: dataset.sha256,
        fit: FitRecord::default(),
    };
    let unjudged = calibration.prepare(&origin).map_err(FitError::Unusable)?;
    let judgement = judge(&unjudged, dataset, stage, Zeros::of_model(settings.model));
    check_described(dataset, &judgement.errors, settings.model)?;
    let judgement_solver_zeros = judge(&unjudged, dataset, stage, Zeros::Given(&solution.delta_m));
    let axes = judgement.errors.axes;
    origin.fit = FitRecord {
        rows: u32::try_from(dataset.rows.len()).unwrap_or(u32::MAX),
        train_rows: u32::try_from(selected.len()).unwrap_or(u32::MAX),
        rms: axes.map(|a| a.rms as f32),
        peak: axes.map(|a| a.peak as f32),
    };
    let set = calibration.prepare(&origin).map_err(FitError::Unusable)?;
    Ok(Fit {
        model: settings.model,
        warnings: warnings(dataset, &problem, &solution, &judgement),
        train_fitness: problem.fitness(solution.cost),
        train_rows: selected.len(),
        solution,
        uncertainty,
        calibration,
        set,
        judgement,
        judgement_solver_zeros,
    })
}

fn warnings(
    dataset: &Dataset,
    problem: &Problem,
    solution: &Solution,
    judgement: &Judgement,
) -> Vec<FitWarning> {
    let mut warnings = Vec::new();
    let values = solution.parameters.to_array();
    for (id, value) in ParameterId::all().zip(values) {
        if solution.at_limit.contains(&id) {
            warnings.push(FitWarning::AtLimit { id, value });
        }
    }
    let clipped = judgement.zeros.iter().filter(|zero| zero.clipped).count();
    if clipped > 0 {
        warnings.push(FitWarning::ZeroDeviationClipped {
            count: clipped,
            of: dataset.movements.len(),
        });
    }
    let mut present = vec![false; dataset.movements.len()];
    for group in &problem.groups {
        present[group.movement] = true;
    }
    let missed = present
        .iter()
        .zip(&dataset.movements)
        .filter(|(present, _)| !**present);
    let missed: Vec<i64> = missed.map(|(_, movement)| movement.index).collect();
    if problem.model.has_zero_deviation() && !missed.is_empty() {
        warnings.push(FitWarning::MovementsMissed { movements: missed });
    }
    if judgement.undecoded > 0 {
        warnings.push(FitWarning::Undecoded {
            rows: judgement.undecoded,
        });
    }
    warnings
}

/// The calibration that `parameters` make with the stage's scales, vouched for over the motion
/// of the dataset and a tenth more.
pub fn calibration(
    dataset: &Dataset,
    stage: &Stage,
    model: ModelKind,
    parameters: &Parameters,
) -> Calibration {
    let mut planar = [0.0f64; 3];
    let mut vertical = [0.0f64; 3];
    for row in &dataset.rows {
        for axis in 0..3 {
            planar[axis] = planar[axis].max(row.reference[axis].abs());
            vertical[axis] = vertical[axis].max(row.vertical[axis].abs());
        }
    }
    Calibration {
        model,
        geometry: parameters.geometry,
        sensitivity: parameters.sensitivity,
        hall_m_per_code: stage.hall.m_per_count,
        hall_window: stage.hall.window,
        capacitive_probes_m: stage.capacitive_probes_m,
        capacitive_m_per_code: stage.capacitive.m_per_count,
        capacitive_window: stage.capacitive.window,
        calibrated_planar: planar.map(|x| x * RANGE_MARGIN),
        calibrated_vertical: vertical.map(|x| x * RANGE_MARGIN),
        sensitivity_min: Calibration::SENSITIVITY_MIN,
    }
}
