//! What rows tell by themselves: missing and uneven rows, flat tops, movements and channels that stand
//! still.

use super::channels::LogSignals;
use super::converters::flat_tops;
use super::frozen::{frozen, most_repeats, of_frozen};
use super::still::Rests;
use super::timing::Timing;
use crate::finding::Finding;
use crate::input::stage::Stage;

/// What they tell of a log. Rows that are named are left out of what follows.
pub(super) fn findings(log: &mut LogSignals, has_reference: bool, stage: &Stage) -> Vec<Finding> {
    let most_repeats = most_repeats(log, has_reference);
    let mut findings = Timing::of(log).findings(&log.told, stage, log.period_s);
    findings.extend(flat_tops(log));
    if has_reference {
        let rests = Rests::of(log);
        findings.extend(rests.findings(&log.told, log.period_s));
    }
    let frozen = frozen(log, &most_repeats);
    findings.extend(of_frozen(&log.told, &log.channels, &frozen, log.period_s));
    findings
}
