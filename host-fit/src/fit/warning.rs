//! What a user should know of a fit that is good nevertheless.

use crate::input::dataset::Dataset;
use crate::input::stage::{AXES, Stage};
use crate::judge::Judgement;
use crate::judge::lag::ReferenceLag;
use crate::judge::statistics::{AxisError, PoseError};
use crate::problem::Problem;
use crate::problem::model::ParameterId;
use crate::problem::terms::shown;
use crate::problem::zero_deviation::ZeroDeviation;
use crate::solve::Solution;

/// Something that the user should know of a fit that is good nevertheless.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum FitWarning {
    /// A parameter stands at an end of its search range.
    #[error(
        "{} stands at an end of its search range or beyond ({:.6} {}): widen the range in stage.toml, or check the log",
        id.name(), shown(*value, id.term.unit).0, shown(*value, id.term.unit).1
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
    /// The reference shows an earlier (or later) pose than the probes.
    #[error(
        "the reference {} the probes by {:.0} us, {:.2} servo periods: fit with --compensate-lag, or set the delay of the \
         interferometers", if *lag_s > 0.0 { "lags behind" } else { "is ahead of" }, lag_s.abs() * 1e6, lag_s.abs() / period_s
    )]
    ReferenceLags {
        /// Its lag, s; negative where it is ahead.
        lag_s: f64,
        /// Servo period, s.
        period_s: f64,
    },
    /// The log of a fit of the field model moves an axis less than half as far as service.
    #[error(
        "the log moves {axis} by {moved_micro:.0} {unit} to either side, service by {service_micro:.0} ([motion] in \
         stage.toml): errors beyond the log's range are larger than predicted; `host-fit plan` makes a run of full range"
    )]
    NarrowLog {
        /// The axis.
        axis: &'static str,
        /// um or urad.
        unit: &'static str,
        /// How far the log goes, um or urad.
        moved_micro: f64,
        /// How far service goes, um or urad.
        service_micro: f64,
    },
    /// Rows of a long log that were not fitted have other errors than those that were.
    #[error(
        "over all rows the error in {axis} is {all_micro:.2} {unit} rms, over those that were fitted {fitted_micro:.2}: a \
         movement so long that the reference drifts, or a fault elsewhere in the log; run `host-fit check` on parts of it"
    )]
    RestDiffers {
        /// The axis.
        axis: &'static str,
        /// um or urad.
        unit: &'static str,
        /// rms over all rows, um or urad.
        all_micro: f64,
        /// rms over the rows that were fitted, um or urad.
        fitted_micro: f64,
    },
    /// The field model was tried, and no parameters of it describe the log.
    #[error(
        "Model (31) was taken because the field model did not settle, as it does on every sound log: once all six axes move, \
         errors will be several times those of a sound fit. Find what is wrong with the log, or fit a part of it"
    )]
    FieldUnsettled,
    /// Rows that the decoder refused count in no error.
    #[error("{rows} rows have codes that the decoder refuses; they are not part of the errors")]
    Undecoded {
        /// How many.
        rows: usize,
    },
}

/// Lag that is worth a warning, in servo periods.
const LAG_MIN: f64 = 0.1;
/// The same in standard errors.
const LAG_ERRORS_MIN: f64 = 3.0;

/// A log that moves an axis over less than this part of its range in service is told.
const RANGE_MIN: f64 = 0.5;

/// Errors over all rows that are this many times those over an excerpt are told.
const REST_MAX: f64 = 1.5;

impl FitWarning {
    /// Of the axis in which errors over all rows are farthest above those over the excerpt fitted.
    pub(super) fn of_rest(fitted: &PoseError, all: &PoseError) -> Option<Self> {
        let ratio = |axis: usize| all.axes[axis].rms / fitted.axes[axis].rms;
        let worst = (0..3).max_by(|&a, &b| ratio(a).total_cmp(&ratio(b)))?;
        (ratio(worst) > REST_MAX).then(|| Self::RestDiffers {
            axis: ["X", "Y", "Rz"][worst],
            unit: ["um", "um", "urad"][worst],
            all_micro: all.axes[worst].rms * 1e6,
            fitted_micro: fitted.axes[worst].rms * 1e6,
        })
    }

    /// Of the movements whose zero deviation was clipped, and of the rows that were not decoded.
    pub(super) fn of_counts(zeros: &[ZeroDeviation], undecoded: usize) -> Vec<Self> {
        let (count, of) = (
            zeros.iter().filter(|zero| zero.clipped).count(),
            zeros.len(),
        );
        let clipped = (count > 0).then_some(Self::ZeroDeviationClipped { count, of });
        let rows = undecoded;
        let undecoded = (rows > 0).then_some(Self::Undecoded { rows });
        clipped.into_iter().chain(undecoded).collect()
    }

    /// Whether it is one of [`of_counts`](Self::of_counts).
    pub(crate) const fn is_count(&self) -> bool {
        matches!(
            self,
            Self::ZeroDeviationClipped { .. } | Self::Undecoded { .. }
        )
    }

    /// Whether it is one of [`of_ranges`](Self::of_ranges).
    pub(super) const fn is_of_range(&self) -> bool {
        matches!(self, Self::NarrowLog { .. })
    }

    /// Of the axes that the log moves (X, Y, Rz and Z, Rx, Ry: largest magnitudes, m, rad) far less
    /// than service does.
    pub(super) fn of_ranges(stage: &Stage, planar: [f64; 3], vertical: [f64; 3]) -> Vec<Self> {
        let moved = planar.into_iter().chain(vertical);
        let axes = AXES.iter().zip(&stage.motion.axes).zip(moved);
        axes.filter(|((_, motion), moved)| *moved < RANGE_MIN * motion.service)
            .map(|(((axis, _), motion), moved)| Self::NarrowLog {
                axis,
                unit: if axis.starts_with('r') { "urad" } else { "um" },
                moved_micro: moved * 1e6,
                service_micro: motion.service * 1e6,
            })
            .collect()
    }

    /// Of a lag that is large and beyond doubt.
    pub(super) fn of_lag(lag: &ReferenceLag, period_s: f64) -> Option<Self> {
        let lag_s = lag.value_s;
        let least = (LAG_MIN * period_s).max(LAG_ERRORS_MIN * lag.standard_error_s);
        (lag_s.abs() > least).then_some(Self::ReferenceLags { lag_s, period_s })
    }
}

fn join(names: &[String]) -> String {
    const SHOWN: usize = 10;
    let dots = if names.len() > SHOWN { ", ..." } else { "" };
    names[..names.len().min(SHOWN)].join(", ") + dots
}

/// All warnings of a fit but that of a lag.
pub(super) fn warnings(
    dataset: &Dataset,
    selected: &[usize],
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
    let mut present = vec![false; dataset.movements.len()];
    for &row in selected {
        present[dataset.rows[row].movement] = true;
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
    warnings.extend(FitWarning::of_counts(&judgement.zeros, judgement.undecoded));
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
