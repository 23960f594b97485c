//! What the signals of a log tell by themselves, whatever model is fitted: missing and uneven
//! rows, sensors that stand still or saturate, jumps, lines in the spectrum, drifts.
//!
//! | module | what it does |
//! |---|---|
//! | `channels` | the signals of one log by channel |
//! | `places` | where in a log something was found |
//! | `row_by_row` | what all rows of a log tell by themselves: the modules that follow, to `frozen` |
//! | `timing` | rows missing, uneven times |
//! | `converters` | flat tops |
//! | `still` | movements that stand still, or end in a rest |
//! | `frozen` | channels that repeat one value |
//! | `standing` | channels that show no more than their noise |
//! | `residual` | what the motion does not explain of a Hall signal |
//! | `blame` | the channel whose error explains that |
//! | `outliers`, `steps` | rows that jump, signals that stay where they jumped |
//! | `spectrum`, `hum` | lines of one frequency |
//! | `drifts` | drift of a channel, and of the gain of a probe |
//! | `undescribed` | what the field model leaves beyond noise |
//!
//! Each log is tested alone, and what an earlier test names is left out of the later ones. A
//! channel is named where it alone explains what was found.

mod blame;
mod channels;
mod converters;
mod drifts;
mod frozen;
mod hum;
mod outliers;
mod places;
mod residual;
mod row_by_row;
#[cfg(test)]
mod sample;
mod spectrum;
mod standing;
mod steps;
mod still;
mod timing;
mod undescribed;

use crate::diagnose::finding::Finding;
use crate::input::dataset::Dataset;
use crate::input::stage::Stage;
use channels::LogSignals;
use places::Told;
use residual::Residuals;

pub(crate) use channels::{period_s, times_s};
pub(crate) use spectrum::{Spectrum, windows};

/// Fewest rows of a log whose residuals are tested.
const ROWS_MIN: usize = 1000;

/// What the signals of a dataset tell, log after log.
///
/// `errors`: decoded pose less reference by row, m, m, rad. Rows without one, which the decoder
/// refused, are left out of the tests of residuals. The residuals themselves are not taken from
/// there: a fit that a fault has bent spreads it over all channels.
pub fn signal_findings(
    dataset: &Dataset,
    stage: &Stage,
    errors: Option<&[Option<[f64; 3]>]>,
) -> Vec<Finding> {
    let mut findings = Vec::new();
    for log in 0..dataset.logs.len() {
        of_log(dataset, stage, errors, log, &mut findings);
    }
    findings
}

/// What the field model leaves of the Hall signals of a log, in terms of their white noise, of the probe
/// of which it leaves most: rms about the means over a second, in which the reference hardly drifts.
/// Infinite where the motion does not explain the signals; `None` without reference or rows.
pub(crate) fn residual_to_noise(dataset: &Dataset, stage: &Stage, log: usize) -> Option<f64> {
    let mut signals = LogSignals::new(dataset, stage, log);
    if !dataset.logs[log].has_reference || signals.len() < ROWS_MIN {
        return None;
    }
    let mut residuals = Residuals::new(&signals, stage);
    if let Some(with) = &residuals
        && !outliers::outliers(&mut signals, with).is_empty()
    {
        residuals = Residuals::new(&signals, stage);
    }
    Some(residuals.map_or(f64::INFINITY, |residuals| residuals.to_noise(&signals)))
}

fn of_log(
    dataset: &Dataset,
    stage: &Stage,
    errors: Option<&[Option<[f64; 3]>]>,
    log: usize,
    findings: &mut Vec<Finding>,
) {
    let mut signals = LogSignals::new(dataset, stage, log);
    findings.extend(row_by_row::findings(&mut signals, dataset, log, stage));
    let has_reference = dataset.logs[log].has_reference;
    if !has_reference || signals.len() < ROWS_MIN {
        return;
    }
    if let Some(errors) = errors {
        signals.leave_out_undecoded(errors);
    }
    let found = of_residuals(&mut signals, stage);
    let all = Told::new(dataset, log).rows;
    findings.extend(found.into_iter().map(|found| match signals.len() < all {
        true => Finding {
            message: format!(
                "{} (looked for in {} of {all} rows)",
                found.message,
                signals.len()
            ),
            ..found
        },
        false => found,
    }));
}

/// What the motion does not explain of the Hall signals.
fn of_residuals(signals: &mut LogSignals, stage: &Stage) -> Vec<Finding> {
    let mut findings = Vec::new();
    // The second time for steps that a larger one hid.
    let tests: [fn(&mut LogSignals, &Residuals) -> Vec<Finding>; 4] = [
        standing::standing,
        outliers::outliers,
        steps::steps,
        steps::steps,
    ];
    let Some(mut residuals) = Residuals::new(signals, stage) else {
        return findings;
    };
    for test in tests {
        let found = test(signals, &residuals);
        if !found.is_empty() {
            findings.extend(found);
            match Residuals::new(signals, stage) {
                Some(again) => residuals = again,
                None => return findings,
            }
        }
    }
    let hum = || hum::hum(signals, &residuals);
    let (hum, (drifts, left)) = rayon::join(hum, || drifts::findings(signals, &residuals));
    findings.extend(hum);
    findings.extend(drifts);
    if let Some(left) = left {
        undescribed::add(&mut findings, signals, &left, residuals.noise_m);
    }
    findings
}
