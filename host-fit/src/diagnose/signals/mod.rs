//! What the signals of a log tell by themselves, whatever model is fitted: missing and uneven
//! rows, sensors that stand still or saturate, jumps, lines in the spectrum, drifts.
//!
//! | module | what it does |
//! |---|---|
//! | [`channels`] | the signals of one log by channel |
//! | [`timing`] | rows missing, uneven times |
//! | [`converters`] | flat tops |
//! | [`still`] | channels and movements that stand still |
//! | [`residual`] | what the motion does not explain of a Hall signal |
//! | [`jumps`] | outliers and steps, and the channel that jumps |
//! | [`spectrum`] | hum |
//! | [`drifts`] | drift of a probe and of its gain |
//!
//! Each log is tested alone, and what an earlier test names is left out of the later ones. A
//! channel is named where it alone explains what was found.

mod channels;
mod converters;
mod drifts;
mod jumps;
mod residual;
mod spectrum;
mod still;
mod timing;

use crate::diagnose::finding::Finding;
use crate::input::dataset::Dataset;
use crate::input::stage::Stage;
use channels::LogSignals;
use residual::{Residuals, Units};

pub(crate) use channels::{period_s, times_s};
pub(crate) use spectrum::Spectrum;

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

fn of_log(
    dataset: &Dataset,
    stage: &Stage,
    errors: Option<&[Option<[f64; 3]>]>,
    log: usize,
    findings: &mut Vec<Finding>,
) {
    let mut signals = LogSignals::new(dataset, stage, log);
    findings.extend(timing::findings(&signals, stage));
    findings.extend(converters::saturated(&mut signals));
    findings.extend(still::frozen(&mut signals));
    let has_reference = dataset.logs[log].has_reference;
    if !has_reference || signals.len() < ROWS_MIN {
        return;
    }
    if let Some(errors) = errors {
        signals.leave_out_undecoded(errors);
    }
    findings.extend(still::idle_and_crashed(&signals));
    let units = Units::of(&signals);
    let Some(mut residuals) = Residuals::new(&signals, &units) else {
        return;
    };
    let still = still::standing(&mut signals, &residuals);
    if !still.is_empty() {
        findings.extend(still);
        match Residuals::new(&signals, &units) {
            Some(again) => residuals = again,
            None => return,
        }
    }
    for test in [jumps::outliers, jumps::steps] {
        let jumps = test(&mut signals, &residuals);
        if !jumps.is_empty() {
            findings.extend(jumps);
            match Residuals::new(&signals, &units) {
                Some(again) => residuals = again,
                None => return,
            }
        }
    }
    findings.extend(spectrum::hum(&signals, &residuals));
    findings.extend(drifts::findings(&signals, &residuals));
}
