//! Rows missing, and rows at uneven times or another rate.

use super::channels::LogSignals;
use crate::diagnose::finding::{Code, Finding, Severity};
use crate::input::stage::Stage;

/// Deviation of the times of rows from even ones that is worth a warning, in periods: at 1 mm/s
/// and 2 ms it is 20 nm of motion.
const JITTER_MIN: f64 = 0.01;
/// Relative difference of the rate from the servo's that is: far above a crystal's.
const RATE_MIN: f64 = 0.005;
/// From here on, in servo periods, rows are thinned on purpose.
const THINNED_FROM: u32 = 5;
/// Share of missing rows from which they are worth a warning.
const MISSING_MIN: f64 = 1e-3;

pub(super) fn findings(log: &LogSignals, stage: &Stage) -> Vec<Finding> {
    let mut findings = Vec::new();
    let usual = usual_periods(log);
    findings.extend(missing(log, usual));
    findings.extend(uneven(log));
    findings.extend(other_rate(log, stage, usual));
    findings
}

/// Periods between two rows of a movement.
fn periods(log: &LogSignals, row: usize) -> u32 {
    let sequence = |row: usize| log.rows[row].frame.sequence();
    sequence(row).wrapping_sub(sequence(row - 1))
}

/// Periods from most rows to the next: more than one where the log was thinned, or written at
/// another rate.
fn usual_periods(log: &LogSignals) -> u32 {
    let all = log.segments.iter().flat_map(|s| s.start + 1..s.end);
    let mut periods: Vec<u32> = all.map(|row| periods(log, row)).collect();
    let middle = periods.len() / 2;
    if periods.is_empty() {
        return 1;
    }
    (*periods.select_nth_unstable(middle).1).max(1)
}

fn missing(log: &LogSignals, usual: u32) -> Option<Finding> {
    let mut rows = 0;
    let mut gaps = Vec::new();
    let mut longest = 0;
    for segment in &log.segments {
        for row in segment.start + 1..segment.end {
            let missed = (periods(log, row) / usual).saturating_sub(1);
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

fn other_rate(log: &LogSignals, stage: &Stage, usual: u32) -> Option<Finding> {
    let (mut time_s, mut count) = (0.0, 0.0);
    for segment in log.segments.iter().filter(|segment| segment.len() >= 2) {
        time_s += log.time_s[segment.end - 1] - log.time_s[segment.start];
        count += (segment.start + 1..segment.end)
            .map(|row| f64::from(periods(log, row)))
            .sum::<f64>();
    }
    let period_s = time_s / count * f64::from(usual);
    let other = (period_s / stage.servo_period_s - 1.0).abs();
    if !other.is_finite() || other <= RATE_MIN {
        return None;
    }
    let severity = if usual >= THINNED_FROM {
        Severity::Note
    } else {
        Severity::Warn
    };
    let message = format!(
        "rows are {:.1} us apart, the servo period of stage.toml is {:.1} us: correct servo.period_s, or log every period",
        period_s * 1e6,
        stage.servo_period_s * 1e6,
    );
    Some(Finding {
        severity,
        value: Some(period_s * 1e6),
        unit: Some("us"),
        ..log.warning(Code::Jitter, message)
    })
}

#[cfg(test)]
mod tests {
    use super::super::sample::{PERIOD_S, dataset, recording, warnings};
    use super::*;
    use crate::input::dataset::Dataset;
    use crate::simulate::random::{Purpose, Stream};

    fn only(dataset: &Dataset) -> (Code, Option<f64>) {
        let found = warnings(dataset);
        assert_eq!(found.len(), 1, "{found:#?}");
        (found[0].code, found[0].value)
    }

    /// Each row `periods(row)` periods after the start of its movement.
    fn at(mut dataset: Dataset, periods: impl Fn(usize) -> u32) -> Dataset {
        for movement in dataset.movements.clone() {
            for (k, row) in dataset.rows[movement.rows].iter_mut().enumerate() {
                row.t_us = (f64::from(periods(k)) * PERIOD_S * 1e6) as i64;
                row.frame = row.frame.with_sequence(periods(k));
            }
        }
        dataset
    }

    #[test]
    fn missing_rows_are_counted() {
        let sound = dataset(&recording());
        let mut gappy = sound.clone();
        let mut rows = sound.rows.into_iter().enumerate();
        gappy.rows.clear();
        for movement in &mut gappy.movements {
            let (start, count) = (gappy.rows.len(), movement.rows.len());
            let kept = rows.by_ref().take(count).filter(|(k, _)| k % 100 != 50);
            gappy.rows.extend(kept.map(|(_, row)| row));
            movement.rows = start..gappy.rows.len();
        }
        gappy.logs[0].rows = 0..gappy.rows.len();
        assert_eq!(only(&gappy), (Code::RowsMissing, Some(60.0)));
    }

    #[test]
    fn uneven_times_are_told_in_us() {
        let mut random = Stream::new(7, Purpose::Sensors, 0);
        let mut uneven = dataset(&recording());
        for row in &mut uneven.rows {
            row.t_us += random.between(-150.0, 150.0) as i64;
        }
        let (code, rms_us) = only(&uneven);
        assert_eq!(code, Code::Jitter);
        let rms_us = rms_us.expect("a size");
        assert!((80.0..93.0).contains(&rms_us), "{rms_us}");
    }

    #[test]
    fn another_rate_is_told_and_a_thinned_log_is_not_warned_of() {
        let slow = at(dataset(&recording()), |k| 2 * k as u32);
        let (code, period_us) = only(&slow);
        assert_eq!(code, Code::Jitter);
        assert!((period_us.expect("a period") - 4000.0).abs() < 0.1);
        let thinned = at(dataset(&recording()), |k| 10 * k as u32);
        assert_eq!(warnings(&thinned), []);
    }
}
