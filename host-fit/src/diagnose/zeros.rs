//! Zero deviations beyond their range.

use super::finding::{Code, Finding};
use super::warning;
use crate::input::dataset::{Dataset, Movement};
use crate::input::stage::Stage;
use crate::problem::Problem;
use crate::problem::parameters::Parameters;
use crate::solve::least_squares::coordinates::point_of;
use crate::solve::least_squares::multistart::zero_deviations;

/// How far beyond its range a zero deviation is worth a warning, in parts of the range's width.
const BEYOND_MIN: f64 = 0.1;
/// Names shown of the movements.
const SHOWN: usize = 5;

/// The movements whose zero deviation leaves its range in `stage`, by a fit of `problem`, whose stage
/// has no range for it.
pub(super) fn clipped(
    dataset: &Dataset,
    stage: &Stage,
    problem: &Problem,
    parameters: &Parameters,
) -> Option<Finding> {
    let range = &stage.search.delta_m;
    let point = point_of(parameters)?;
    let zeros = zero_deviations(problem, parameters, &point);
    let beyond = |delta: f64| (delta - range.clip(delta)).abs() - BEYOND_MIN * range.width();
    let largest = |delta: [f64; 3]| delta.map(f64::abs).into_iter().fold(0.0, f64::max);
    let mut beyond: Vec<(&Movement, f64)> = (dataset.movements.iter().zip(&zeros))
        .filter(|(_, zero)| zero.delta_m.iter().any(|delta| beyond(*delta) > 0.0))
        .map(|(movement, zero)| (movement, largest(zero.delta_m)))
        .collect();
    // An excerpt may hold several runs of a movement.
    let is_again = |later: &Movement, earlier: &Movement| {
        (later.log, later.index) == (earlier.log, earlier.index)
    };
    beyond.dedup_by(|(later, more), (earlier, most)| {
        let again = is_again(later, earlier);
        if again {
            *most = most.max(*more);
        }
        again
    });
    let again = dataset
        .movements
        .windows(2)
        .filter(|pair| is_again(&pair[1], &pair[0]));
    let movements = dataset.movements.len() - again.count();
    let beyond: Vec<(String, f64)> = (beyond.into_iter())
        .map(|(movement, most)| (dataset.movement_name(movement), most))
        .collect();
    let (worst, most) = beyond.iter().max_by(|(_, a), (_, b)| a.total_cmp(b))?;
    let most_um = most * 1e6;
    let names: Vec<&str> = beyond
        .iter()
        .take(SHOWN)
        .map(|(name, _)| name.as_str())
        .collect();
    let dots = if beyond.len() > SHOWN { ", ..." } else { "" };
    Some(Finding {
        message: format!(
            "the zero deviation of {} of {} movements ({}{dots}) leaves its range of {:.0} to {:.0} um, at most by movement \
             {worst}, {most_um:.1} um at a probe: reset the interferometers nearer to zero before each movement, or widen \
             search.delta_m in stage.toml to [-{wide}e-6, {wide}e-6]",
            beyond.len(),
            movements,
            names.join(", "),
            range.low * 1e6,
            range.high * 1e6,
            wide = (1.2 * most_um / 10.0).ceil() * 10.0,
        ),
        movement: Some(worst.clone()),
        value: Some(most_um),
        unit: Some("um"),
        ..warning(Code::ZeroClipped)
    })
}
