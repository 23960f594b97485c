//! What the signals of a log show by themselves, whatever model is fitted: missing and uneven
//! rows, sensors that stand still or saturate, jumps, lines in the spectrum.
//!
//! | module | what it does |
//! |---|---|
//! | `channels` | the signals of one log by channel, and places in it |
//! | `timing` | rows missing, uneven times |
//! | `repeats` | channels that repeat one value: flat tops, frozen registers |
//! | `still` | movements that stand still, or end in a rest |
//! | `standing` | channels that show no more than their noise |
//! | `residual` | residuals of the Hall signals, and the channel that explains them |
//! | `outliers` | rows that jump |
//! | `spectrum`, `hum` | lines of one frequency |
//!
//! Each log is tested alone, and what an earlier test names is left out of the later ones. A
//! channel is named where it alone explains what was found.

mod channels;
mod hum;
mod outliers;
mod repeats;
mod residual;
#[cfg(test)]
mod sample_for_tests;
mod spectrum;
mod standing;
mod still;
mod timing;

use crate::finding::Finding;
use crate::input::dataset::Dataset;
use crate::input::stage::Stage;
use crate::solve::field::parameters::FieldParameters;
use channels::LogSignals;
use residual::Residuals;

pub use channels::period_s;
pub(super) use channels::robust_deviation;
pub use spectrum::{Spectrum, windows};

/// Fewest rows of a log whose residuals are tested.
const ROWS_MIN: usize = 1000;

/// What the signals of a dataset show, log after log, and the rows that no other test is to use.
///
/// `fitted`: the parameters, and the lag of the reference, s. `errors`: decoded pose less reference by row,
/// m, m, rad; rows without one, which the decoder refused, are left out of the tests of residuals.
pub fn signal_findings(
    dataset: &Dataset,
    stage: &Stage,
    fitted: (&FieldParameters, f64),
    errors: Option<&[Option<[f64; 3]>]>,
) -> (Vec<Finding>, Vec<usize>) {
    let (mut findings, mut bad) = (Vec::new(), Vec::new());
    for log in 0..dataset.logs.len() {
        let mut signals = LogSignals::new(dataset, stage, log);
        findings.extend(of_log(&mut signals, dataset, stage, fitted, errors, log));
        let first = dataset.logs[log].rows.start;
        let unusable = (0..signals.len()).filter(|&row| !signals.usable[row]);
        bad.extend(unusable.map(|row| first + row));
    }
    (findings, bad)
}

fn of_log(
    signals: &mut LogSignals,
    dataset: &Dataset,
    stage: &Stage,
    fitted: (&FieldParameters, f64),
    errors: Option<&[Option<[f64; 3]>]>,
    log: usize,
) -> Vec<Finding> {
    let has_reference = dataset.logs[log].has_reference;
    let mut found: Vec<Finding> = timing::timing(signals, stage).collect();
    found.extend(repeats::flat_tops(signals));
    if has_reference {
        found.extend(still::rests(signals));
    }
    found.extend(repeats::frozen(signals, has_reference));
    if has_reference && signals.len() >= ROWS_MIN {
        if let Some(errors) = errors {
            signals.leave_out_undecoded(errors);
        }
        found.extend(of_residuals(signals, fitted));
    }
    let all = dataset.logs[log].rows_read;
    if signals.len() < all {
        for found in &mut found {
            let rows = signals.len();
            found.message += &format!(" (looked for in {rows} of {all} rows)");
        }
    }
    found
}

/// What the motion does not explain of the Hall signals.
fn of_residuals(
    signals: &mut LogSignals,
    (parameters, lag_s): (&FieldParameters, f64),
) -> Vec<Finding> {
    let tests: [fn(&mut LogSignals, &Residuals) -> Vec<Finding>; 3] =
        [standing::standing, outliers::outliers, hum::hum];
    let mut findings = Vec::new();
    let mut residuals = None;
    for test in tests {
        residuals = residuals.or_else(|| Residuals::new(signals, parameters, lag_s));
        let Some(here) = &residuals else { break };
        let found = test(signals, here);
        if !found.is_empty() {
            residuals = None;
        }
        findings.extend(found);
    }
    findings
}
