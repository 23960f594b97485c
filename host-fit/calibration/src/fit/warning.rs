//! What a user should know of a fit that is good nevertheless.

use crate::judge::Judgement;
use crate::judge::lag::ReferenceLag;
use crate::judge::statistics::AxisError;
use hallstage_input::dataset::Dataset;
use hallstage_input::finding::{Code, Finding};
use hallstage_solver::problem::Problem;
use hallstage_solver::problem::terms::shown;
use hallstage_solver::problem::zero_deviation::ZeroDeviation;
use hallstage_solver::solve::Solution;

/// The axes of the pose: key, name, unit.
const POSE: [(&str, &str, &str); 3] = [("x", "X", "um"), ("y", "Y", "um"), ("rz", "Rz", "urad")];

/// Warn of a lag from this part of a servo period on, ...
const LAG_MIN: f64 = 0.1;
/// ... and from this many of its standard errors.
const LAG_ERRORS_MIN: f64 = 3.0;
/// In a million rows of noise alone the largest error is five times the rms.
const PEAK_TO_RMS_MAX: f64 = 8.0;

/// Movements whose zero deviation is beyond its range, and rows that were not decoded.
pub fn of_counts(zeros: &[ZeroDeviation], undecoded: usize) -> impl Iterator<Item = Finding> {
    let count = zeros.iter().filter(|zero| zero.is_beyond).count();
    let deltas = zeros.iter().flat_map(|zero| zero.delta_m);
    let most_um = deltas.fold(0.0, |most: f64, delta| most.max(delta.abs() * 1e6));
    let beyond = (count > 0).then(|| {
        let message = format!(
            "the zero deviation of {count} of {} movements is beyond its range (largest {most_um:.1} um): widen search.delta_m in stage.toml if the \
             interferometers are reset less exactly than that",
            zeros.len()
        );
        Finding::new(Code::ZeroClipped, message).of(count as f64, "movements")
    });
    beyond.into_iter().chain(of_undecoded(undecoded))
}

/// Rows that the decoder refused, which count in no error.
pub fn of_undecoded(rows: usize) -> Option<Finding> {
    let message = || {
        format!("{rows} rows have codes that the decoder refuses; they are not part of the errors")
    };
    (rows > 0).then(|| Finding::new(Code::Saturated, message()).of(rows as f64, "rows"))
}

/// A lag of the reference that is large and beyond doubt.
pub(super) fn of_lag(lag: &ReferenceLag, period_s: f64) -> Option<Finding> {
    let lag_s = lag.value_s;
    let least = (LAG_MIN * period_s).max(LAG_ERRORS_MIN * lag.standard_error_s);
    (lag_s.abs() > least).then(|| {
        let lags = if lag_s > 0.0 { "lags behind" } else { "is ahead of" };
        let message = format!(
            "the reference {lags} the probes by {:.0} us, {:.2} servo periods, which the fit has taken off: set the delay of \
             the interferometers",
            lag_s.abs() * 1e6,
            lag_s.abs() / period_s
        );
        Finding::new(Code::ReferenceLag, message).on("ifm").of(lag_s * 1e6, "us")
    })
}

/// All warnings of a fit but that of a lag.
pub(super) fn warnings(
    dataset: &Dataset,
    selected: &[usize],
    problem: &Problem,
    solution: &Solution,
    judgement: &Judgement,
) -> Vec<Finding> {
    let mut warnings = Vec::new();
    for id in &solution.at_limit {
        let value = solution.parameters.values[id.index];
        let (value_shown, unit) = shown(value, id.term.unit);
        let message = format!(
            "{} stands at an end of its search range or beyond ({value_shown:.6} {unit}): check the scales and signs of that probe \
             and of the beams; where they are right, widen the range in stage.toml",
            id.name()
        );
        let channel = ["hall_a", "hall_b", "hall_c"][id.probe];
        let found = Finding::new(Code::TermsAtLimit, message);
        warnings.push(found.on(channel).of(value, id.term.unit));
    }
    let vertical = solution.at_limit.iter().filter(|id| id.is_slope()).count();
    if vertical > 1 {
        let message = format!(
            "{vertical} of the vertical terms stand at an end of their range: check the order and the signs of the capacitive \
             sensors in the log and in stage.toml"
        );
        warnings.push(Finding::new(Code::TermsAtLimit, message).of(vertical as f64, ""));
    }
    warnings.extend(wild_row(dataset, judgement));
    if problem.model.has_zero_deviation {
        warnings.extend(missed(dataset, selected));
    }
    warnings.extend(of_counts(&judgement.zeros, judgement.undecoded));
    warnings
}

/// Movements of which the draw has no row.
fn missed(dataset: &Dataset, selected: &[usize]) -> Option<Finding> {
    const SHOWN: usize = 10;
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
    let dots = if missed.len() > SHOWN { ", ..." } else { "" };
    (!missed.is_empty()).then(|| {
        let message = format!(
            "the draw of rows misses {} movement(s) ({}{dots}): their zero deviation is free, and the solver's own is taken as \
             zero. Use --draw stratified, or a larger --train",
            missed.len(),
            missed[..missed.len().min(SHOWN)].join(", ")
        );
        Finding::new(Code::RowsMissing, message).of(missed.len() as f64, "movements")
    })
}

/// The row with the largest error in terms of its axis' rms, if that is too large for noise.
fn wild_row(dataset: &Dataset, judgement: &Judgement) -> Option<Finding> {
    let axes = POSE.into_iter().zip(judgement.errors.axes);
    let ((key, axis, unit), error) = axes.max_by(|(_, a), (_, b)| {
        let ratio = |e: &AxisError| e.peak / e.rms.max(f64::MIN_POSITIVE);
        ratio(a).total_cmp(&ratio(b))
    })?;
    if error.peak <= PEAK_TO_RMS_MAX * error.rms {
        return None;
    }
    let row = dataset.rows.get(error.peak_row)?;
    let movement = dataset.movement_name(dataset.movements.get(row.movement)?);
    let (peak, t_us) = (error.peak * 1e6, row.t_us);
    let message = format!(
        "the largest error, {peak:.1} {unit} in {axis}, is {:.0} times the rms: see movement {movement} at t_us = {t_us}. If \
         the row is wrong, take it out of the log and fit again",
        error.peak / error.rms
    );
    let found = Finding::new(Code::Outliers, message).on(key);
    Some(found.at(movement, t_us).of(peak, unit))
}
