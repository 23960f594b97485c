//! Faults in the signals of a log, found without a fit or with its residuals: missing and uneven rows, sensors that
//! stand still or saturate, jumps, lines in the spectrum.
//!
//! | module | what it does |
//! |---|---|
//! | `channels` | the signals of one log by channel, and places in it |
//! | `timing` | rows missing, uneven times |
//! | `still` | movements without motion, channels that repeat one value |
//! | `residual` | residuals of the Hall signals, and the error of a channel that explains them |
//! | `standing` | channels that show only their noise |
//! | `outliers` | rows that jump |
//! | `hum` | lines of one frequency |
//!
//! Each log is tested by itself. Rows that a test names are left out of later tests. A channel is named where it
//! explains the fault without the others.

mod channels;
mod hum;
mod outliers;
mod residual;
#[cfg(test)]
mod sample_for_tests;
mod standing;
mod still;
mod timing;

use channels::LogSignals;
use hallstage_input::channels::Column;
use hallstage_input::dataset::Dataset;
use hallstage_input::finding::Finding;
use hallstage_input::stage::Stage;
use hallstage_solver::estimator::parameters::FieldParameters;
use residual::Residuals;

/// Rows of a block: its median has no outlier, and its mean a third of the noise of a Hall probe, 0.5 um.
const BLOCK: usize = 10;
/// The faults in the signals, log after log, and the rows that no other test may use.
///
/// `fitted`: the parameters, and the lag of the reference, s.
pub fn signal_findings(
    dataset: &Dataset,
    stage: &Stage,
    columns: &[Column],
    fitted: (&FieldParameters, f64),
) -> (Vec<Finding>, Vec<usize>) {
    let (mut findings, mut bad) = (Vec::new(), Vec::new());
    for log in 0..dataset.logs.len() {
        let mut signals = LogSignals::new(dataset, stage, log, columns);
        findings.extend(log_findings(&mut signals, fitted));
        let unused = (0..signals.rows.len()).filter(|&row| !signals.usable[row]);
        bad.extend(unused.map(|row| signals.source.rows.start + row));
    }
    (findings, bad)
}

fn log_findings(
    log: &mut LogSignals,
    (parameters, lag_s): (&FieldParameters, f64),
) -> Vec<Finding> {
    let mut found = timing::timing(log);
    found.extend(still::idle(log));
    found.extend(still::repeats(log));
    let source = log.source;
    let tests = [standing::standing, outliers::outliers, hum::hum];
    for test in tests.into_iter().filter(|_| source.has_reference) {
        if let Some(residuals) = Residuals::new(log, parameters, lag_s) {
            found.extend(test(log, &residuals));
        }
    }
    let (rows, all, count) = (log.rows.len(), source.rows_read, log.dataset.logs.len());
    for found in &mut found {
        found.log = (count > 1).then(|| source.name());
        found.sample = (rows < all).then_some([rows, all]);
    }
    found
}
