//! Faults in the signals of a log, found without a fit: missing and uneven rows, sensors that stand still or saturate.
//!
//! | module | what it does |
//! |---|---|
//! | `channels` | the signals of one log by channel, and places in it |
//! | `timing` | rows missing, uneven times |
//! | `still` | movements without motion, channels that repeat one value or show their noise alone |
//!
//! Each log is tested by itself. Rows that a test names are left out of later tests.

mod channels;
#[cfg(test)]
mod sample_for_tests;
mod still;
mod timing;

use channels::LogSignals;
use hallstage_input::channels::Column;
use hallstage_input::dataset::Dataset;
use hallstage_input::finding::Finding;
use hallstage_input::stage::Stage;

/// Rows of a block: its median has no outlier, and its mean a third of the noise of a Hall probe, 0.5 um.
const BLOCK: usize = 10;

/// The faults in the signals, log after log, and the rows that no other test may use.
pub fn signal_findings(
    dataset: &Dataset,
    stage: &Stage,
    columns: &[Column],
) -> (Vec<Finding>, Vec<usize>) {
    let (mut findings, mut bad) = (Vec::new(), Vec::new());
    for log in 0..dataset.logs.len() {
        let mut signals = LogSignals::new(dataset, stage, log, columns);
        findings.extend(log_findings(&mut signals));
        let outliers = std::mem::take(&mut signals.outliers).into_iter();
        signals.leave_out(outliers.map(|row| row..row + 1), 0);
        let unused = (0..signals.rows.len()).filter(|&row| !signals.usable[row]);
        bad.extend(unused.map(|row| signals.source.rows.start + row));
    }
    (findings, bad)
}

fn log_findings(log: &mut LogSignals) -> Vec<Finding> {
    let mut found = timing::timing(log);
    found.extend(still::idle(log));
    found.extend(still::repeats(log));
    found.extend(still::noise_alone(log));
    let (rows, all, count) = (log.rows.len(), log.source.rows_read, log.dataset.logs.len());
    for found in &mut found {
        found.log = (count > 1).then(|| log.source.name());
        found.sample = (rows < all).then_some([rows, all]);
    }
    found
}
