//! Rows missing, and rows at uneven times or another rate.

use super::channels::LogSignals;
use crate::diagnose::finding::{Code, Finding, Severity};
use crate::input::stage::Stage;

/// Deviation of the times of rows from even ones that is worth a warning, in periods: at 1 mm/s
/// and 2 ms it is 20 nm of motion.
const JITTER_MIN: f64 = 0.01;
/// Relative difference of the rate from the servo's that is: far above a crystal's.
const RATE_MIN: f64 = 0.005;
/// Share of missing rows from which they are worth a warning.
const MISSING_MIN: f64 = 1e-3;

pub(super) fn findings(log: &LogSignals, stage: &Stage) -> Vec<Finding> {
    let mut findings = Vec::new();
    findings.extend(missing(log));
    findings.extend(uneven(log));
    findings.extend(other_rate(log, stage));
    findings
}

/// Periods between two rows of a movement.
fn periods(log: &LogSignals, row: usize) -> u32 {
    let sequence = |row: usize| log.rows[row].frame.sequence();
    sequence(row).wrapping_sub(sequence(row - 1))
}

fn missing(log: &LogSignals) -> Option<Finding> {
    let mut rows = 0;
    let mut gaps = Vec::new();
    let mut longest = 0;
    for segment in &log.segments {
        for row in segment.start + 1..segment.end {
            let missed = periods(log, row).saturating_sub(1);
            if missed > 0 {
                rows += u64::from(missed);
                longest = longest.max(missed);
                gaps.push(row);
            }
        }
    }
    let &first = gaps.first()?;
    let share = rows as f64 / (rows as f64 + log.len() as f64);
    let severity = if share < MISSING_MIN {
        Severity::Note
    } else {
        Severity::Warn
    };
    let message = format!(
        "{rows} rows are missing ({:.2} %) in {} gaps, the longest of {longest}; before {}: look for frames that the \
         recorder lost",
        share * 100.0,
        gaps.len(),
        log.places(&gaps),
    );
    Some(Finding {
        severity,
        value: Some(rows as f64),
        unit: Some("rows"),
        ..log.warning_at(Code::RowsMissing, first, message)
    })
}

/// Times of the rows against even ones, in each movement.
fn uneven(log: &LogSignals) -> Option<Finding> {
    let (mut squares, mut rows) = (0.0, 0.0);
    let (mut worst_s, mut worst) = (0.0, 0);
    for segment in log.segments.iter().filter(|segment| segment.len() >= 10) {
        let sequence = |row: usize| {
            let [first, this] = [segment.start, row].map(|r| log.rows[r].frame.sequence());
            f64::from(this.wrapping_sub(first))
        };
        // A line through the times: a rate that is only another one is not uneven.
        let n = segment.len() as f64;
        let mean_k = segment.clone().map(sequence).sum::<f64>() / n;
        let mean_s = log.time_s[segment.clone()].iter().sum::<f64>() / n;
        let (mut kk, mut kt) = (0.0, 0.0);
        for row in segment.clone() {
            let k = sequence(row) - mean_k;
            kk += k * k;
            kt += k * (log.time_s[row] - mean_s);
        }
        let period_s = kt / kk;
        for row in segment.clone() {
            let off_s = log.time_s[row] - mean_s - period_s * (sequence(row) - mean_k);
            squares += off_s * off_s;
            rows += 1.0;
            if off_s.abs() > worst_s {
                (worst_s, worst) = (off_s.abs(), row);
            }
        }
    }
    let rms_s = f64::sqrt(squares / f64::max(rows, 1.0));
    if rms_s <= JITTER_MIN * log.period_s {
        return None;
    }
    let message = format!(
        "rows come at uneven times: {:.0} us rms off an even rate, at most {:.0} us ({}): have the servo's clock start \
         all converters and stamp the rows",
        rms_s * 1e6,
        worst_s * 1e6,
        log.place(worst),
    );
    Some(Finding {
        value: Some(rms_s * 1e6),
        unit: Some("us"),
        ..log.warning_at(Code::Jitter, worst, message)
    })
}

fn other_rate(log: &LogSignals, stage: &Stage) -> Option<Finding> {
    let (mut time_s, mut count) = (0.0, 0.0);
    for segment in log.segments.iter().filter(|segment| segment.len() >= 2) {
        time_s += log.time_s[segment.end - 1] - log.time_s[segment.start];
        count += (segment.start + 1..segment.end)
            .map(|row| f64::from(periods(log, row)))
            .sum::<f64>();
    }
    let period_s = time_s / count;
    let other = (period_s / stage.servo_period_s - 1.0).abs();
    if !other.is_finite() || other <= RATE_MIN {
        return None;
    }
    let message = format!(
        "rows are {:.1} us apart, the servo period of stage.toml is {:.1} us: correct servo.period_s, or log every period",
        period_s * 1e6,
        stage.servo_period_s * 1e6,
    );
    Some(Finding {
        value: Some(period_s * 1e6),
        unit: Some("us"),
        ..log.warning(Code::Jitter, message)
    })
}
