//! White noise from fifth differences: motion up to some hertz is far below the noise there.

use super::signal::Signal;
use crate::statistics::median;

/// Standard deviation of normal noise over the median of its magnitude.
const NORMAL: f64 = 1.4826;
/// Variance of the fifth differences of white noise of variance one.
const POWER: f64 = 252.0;

/// Fifth differences of a run.
pub(super) fn fifth_differences(run: &[f64]) -> impl Iterator<Item = f64> {
    run.windows(6)
        .map(|v| (v[5] - v[0]) - 5.0 * (v[4] - v[1]) + 10.0 * (v[3] - v[2]))
}

/// The standard deviation of the white noise, in the unit of the values.
pub(super) fn white(signal: &Signal) -> Option<f64> {
    of_runs(signal.runs())
}

/// The standard deviation of the white noise of consecutive values, in their unit; `None` for fewer than six.
pub fn white_noise(values: &[f64]) -> Option<f64> {
    of_runs([values].into_iter())
}

fn of_runs<'r>(runs: impl Iterator<Item = &'r [f64]>) -> Option<f64> {
    let differences = runs.flat_map(fifth_differences).map(f64::abs);
    let middle = median(&mut differences.collect::<Vec<f64>>())?;
    Some(NORMAL * middle / POWER.sqrt())
}
