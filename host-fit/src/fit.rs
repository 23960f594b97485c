//! The main job: a dataset to a judged calibration.
//!
//! dataset -> rows drawn -> problem -> solver -> standard errors -> parameter set -> judgement.
//! Nothing is written here.

mod field;

use crate::input::dataset::Dataset;
use crate::input::stage::Stage;
use crate::judge::identify::{FitFailure, check_described, check_determined, check_motion};
use crate::judge::statistics::AxisError;
use crate::judge::uncertainty::uncertainty;
use crate::judge::{Decoded, Judgement, Zeros};
use crate::problem::Problem;
use crate::problem::draw::{Draw, draw_rows};
use crate::problem::model::{COUNT, Model, ParameterId};
use crate::problem::parameters::Parameters;
use crate::solve::field::fit::{FieldFit, FieldFitError};
use crate::solve::{Solution, SolveError, Solver, SolverOptions};
use runtime::calibration::Origin;
use runtime::parameters::{FitRecord, ParameterError, Text};
use runtime::{Calibration, ModelKind, ParameterSet};

/// Room around the motion of the log in which the calibration still holds: offsets of
/// the reference and overshoot are well inside it.
const RANGE_MARGIN: f64 = 1.1;

/// What the user chose.
#[derive(Clone, Debug)]
pub struct FitSettings {
    /// The model.
    pub model: &'static Model,
    /// Rows to use; all if `None`.
    pub train: Option<usize>,
    /// How they are drawn.
    pub draw: Draw,
    /// How the problem is solved.
    pub solver: Solver,
    /// For the solver; its seed also draws the rows.
    pub options: SolverOptions,
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
        id.name(), id.term.unit
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
        /// Their names, by [`Dataset::movement_name`].
        movements: Vec<String>,
    },
    /// Several vertical terms stand at an end of their range.
    #[error(
        "{count} of the vertical terms stand at an end of their range: check the order and the signs of the \
         capacitive sensors in the log and in stage.toml"
    )]
    VerticalTermsAtLimit {
        /// How many.
        count: usize,
    },
    /// An error is far larger than noise makes it.
    #[error(
        "the largest error, {error_micro:.1} {unit} in {axis}, is {ratio:.0} times the rms: see movement {movement} at \
         t_us = {t_us}. If the row is wrong, take it out of the log and fit again"
    )]
    WildRow {
        /// The axis.
        axis: &'static str,
        /// um or urad.
        unit: &'static str,
        /// The error, um or urad.
        error_micro: f64,
        /// The error over the rms of its axis.
        ratio: f64,
        /// The movement, by [`Dataset::movement_name`].
        movement: String,
        /// Its time in the log, us.
        t_us: i64,
    },
    /// Rows that the decoder refused count in no error.
    #[error("{rows} rows have codes that the decoder refuses; they are not part of the errors")]
    Undecoded {
        /// How many.
        rows: usize,
    },
}

fn join(names: &[String]) -> String {
    const SHOWN: usize = 10;
    let dots = if names.len() > SHOWN { ", ..." } else { "" };
    names[..names.len().min(SHOWN)].join(", ") + dots
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
    /// The field model cannot be fitted to the log, or not so that it serves.
    #[error("{0}")]
    Field(#[from] FieldFitError),
    /// The fitted parameters put a row of the log next to a pole of 1/phi.
    #[error(
        "the {solver} search ended with a row of the log next to a pole of 1/phi, where nothing can be judged: let it run longer (--generations, --population), use --project delta or linear, or take the default solver"
    )]
    AtPole {
        /// Name of the solver.
        solver: &'static str,
    },
    /// The stage file has no range for a parameter that is fitted.
    #[error(
        "the table [search] of stage.toml has no range `{key}`, which model ({model}) needs: add it"
    )]
    NoRange {
        /// Its key.
        key: &'static str,
        /// Name of the model.
        model: &'static str,
    },
    /// The model has terms that no decoder of this program has.
    #[error(
        "no decoder of this program has all terms of model ({model}): it can be fitted, but not judged or used"
    )]
    NoDecoder {
        /// Name of the model.
        model: &'static str,
    },
    /// The fitted parameters cannot serve a decoder.
    #[error(
        "the fitted parameters cannot be used: {0}. Check the vertical motion in the log and the search ranges"
    )]
    Unusable(ParameterError),
}

/// A calibration with everything that is known about it.
#[derive(Clone, Debug)]
pub struct Fit {
    /// The model.
    pub model: &'static Model,
    /// What the solver found; of the field model the parameters that Model (31) has too.
    pub solution: Solution,
    /// Standard errors of these; `None` as in
    /// [`Uncertainty`](crate::judge::uncertainty::Uncertainty).
    pub standard_error: [Option<f64>; COUNT],
    /// All of a fit of the field model.
    pub field: Option<FieldFit>,
    /// The calibration in `f64`.
    pub calibration: Calibration,
    /// What goes into the blob.
    pub set: ParameterSet,
    /// Fitness over the rows that the fit used, with the solver's own zero deviations.
    pub train_fitness: f64,
    /// Rows that the fit used.
    pub train_rows: usize,
    /// All rows, decoded by the target's decoder.
    pub decoded: Decoded,
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
pub fn fit(dataset: &Dataset, stage: &Stage, settings: &FitSettings) -> Result<Fit, FitError> {
    let (model, solver) = (settings.model, settings.solver);
    let count = settings.train.unwrap_or(dataset.rows.len());
    let selected = draw_rows(dataset, count, settings.draw, settings.options.seed);
    // The lever arms, the first term, take theirs from the coordinates.
    let ranged = &model.terms[1..model.fitted];
    if let Some(term) = ranged
        .iter()
        .find(|t| stage.search.of(t.range_key).is_none())
    {
        return Err(FitError::NoRange {
            key: term.range_key,
            model: model.name,
        });
    }
    check_motion(dataset, stage, selected.len(), model)?;
    if model.kind == ModelKind::Field {
        return field::fit(dataset, stage, settings, &selected);
    }
    let problem = Problem::new(dataset, &selected, stage, model);
    let solution = solver.solve(&problem, &settings.options)?;
    let parameters = &solution.parameters;
    let at_pole = FitError::AtPole {
        solver: solver.name(),
    };
    let uncertainty = uncertainty(&problem, parameters, &solution.at_limit).ok_or(at_pole)?;
    let calibration = calibration(dataset, stage, model, parameters)?;
    let vertical = calibration.calibrated_vertical;
    let determined = check_determined(&problem, parameters, &uncertainty, vertical);
    let judged = judged(dataset, stage, settings, &calibration, selected.len());
    if let Err(FitError::Unusable(_)) = judged {
        determined.clone()?;
    }
    // First this: a log that the model does not describe determines nothing, but for that reason.
    let Judged {
        set,
        decoded,
        judgement,
    } = judged?;
    determined?;
    let own_zeros = Zeros::Given(&solution.delta_m);
    Ok(Fit {
        model,
        warnings: warnings(dataset, &problem, &solution, &judgement),
        train_fitness: problem.fitness(solution.cost),
        train_rows: selected.len(),
        standard_error: uncertainty.standard_error,
        field: None,
        judgement_solver_zeros: decoded.judge(dataset, stage, own_zeros),
        solution,
        calibration,
        set,
        decoded,
        judgement,
    })
}

/// A calibration on all rows, by the target's decoder.
struct Judged {
    set: ParameterSet,
    decoded: Decoded,
    judgement: Judgement,
}

/// Judges a calibration, which must describe the dataset.
fn judged(
    dataset: &Dataset,
    stage: &Stage,
    settings: &FitSettings,
    calibration: &Calibration,
    train_rows: usize,
) -> Result<Judged, FitError> {
    let origin = Origin {
        serial: settings.serial.clone(),
        created: settings.created.clone(),
        logs_sha256: dataset.sha256,
        fit: FitRecord::default(),
    };
    let mut set = calibration.prepare(&origin).map_err(FitError::Unusable)?;
    let decoded = Decoded::new(&set, dataset);
    let judgement = decoded.judge(dataset, stage, Zeros::of_model(settings.model));
    check_described(dataset, &judgement.errors, settings.model)?;
    let axes = judgement.errors.axes;
    set.fit = FitRecord {
        rows: u32::try_from(dataset.rows.len()).unwrap_or(u32::MAX),
        train_rows: u32::try_from(train_rows).unwrap_or(u32::MAX),
        rms: axes.map(|a| a.rms as f32),
        peak: axes.map(|a| a.peak as f32),
    };
    Ok(Judged {
        set,
        decoded,
        judgement,
    })
}

fn warnings(
    dataset: &Dataset,
    problem: &Problem,
    solution: &Solution,
    judgement: &Judgement,
) -> Vec<FitWarning> {
    let mut warnings = Vec::new();
    for &id in &solution.at_limit {
        let value = solution.parameters.values[id.index];
        warnings.push(FitWarning::AtLimit { id, value });
    }
    let vertical = solution.at_limit.iter().filter(|id| id.is_slope()).count();
    if vertical > 1 {
        warnings.push(FitWarning::VerticalTermsAtLimit { count: vertical });
    }
    warnings.extend(wild_row(dataset, judgement));
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
    let missed: Vec<String> = missed
        .map(|(_, movement)| dataset.movement_name(movement))
        .collect();
    if problem.model.has_zero_deviation && !missed.is_empty() {
        warnings.push(FitWarning::MovementsMissed { movements: missed });
    }
    if judgement.undecoded > 0 {
        warnings.push(FitWarning::Undecoded {
            rows: judgement.undecoded,
        });
    }
    warnings
}

/// In a million rows of noise alone the largest is five times the rms.
const PEAK_TO_RMS_MAX: f64 = 8.0;

/// The row with the largest error in terms of its axis' rms, if that is too large for noise.
fn wild_row(dataset: &Dataset, judgement: &Judgement) -> Option<FitWarning> {
    const AXES: [(&str, &str); 3] = [("X", "um"), ("Y", "um"), ("Rz", "urad")];
    let axes = AXES.into_iter().zip(judgement.errors.axes);
    let ((axis, unit), error) = axes.max_by(|(_, a), (_, b)| {
        let ratio = |e: &AxisError| e.peak / e.rms.max(f64::MIN_POSITIVE);
        ratio(a).total_cmp(&ratio(b))
    })?;
    if error.peak <= PEAK_TO_RMS_MAX * error.rms {
        return None;
    }
    let row = dataset.rows.get(error.peak_row)?;
    Some(FitWarning::WildRow {
        axis,
        unit,
        error_micro: error.peak * 1e6,
        ratio: error.peak / error.rms,
        movement: dataset.movement_name(dataset.movements.get(row.movement)?),
        t_us: row.t_us,
    })
}

/// The calibration that `parameters` make with the stage's scales, calibrated over the motion
/// of the dataset and a tenth more.
///
/// # Errors
/// [`FitError::NoDecoder`].
pub fn calibration(
    dataset: &Dataset,
    stage: &Stage,
    model: &Model,
    parameters: &Parameters,
) -> Result<Calibration, FitError> {
    let mut planar = [0.0f64; 3];
    let mut vertical = [0.0f64; 3];
    for row in &dataset.rows {
        for axis in 0..3 {
            planar[axis] = planar[axis].max(row.reference[axis].abs());
            vertical[axis] = vertical[axis].max(row.vertical[axis].abs());
        }
    }
    let no_decoder = FitError::NoDecoder { model: model.name };
    Ok(Calibration {
        model: model.kind,
        geometry: parameters.geometry(),
        probes: model.probes(parameters).ok_or(no_decoder)?,
        hall_m_per_code: stage.hall.m_per_count,
        hall_window: stage.hall.window,
        capacitive_probes_m: stage.capacitive_probes_m,
        capacitive_m_per_code: stage.capacitive.m_per_count,
        capacitive_window: stage.capacitive.window,
        calibrated_planar: planar.map(|x| x * RANGE_MARGIN),
        calibrated_vertical: vertical.map(|x| x * RANGE_MARGIN),
        sensitivity_min: Calibration::SENSITIVITY_MIN,
    })
}
