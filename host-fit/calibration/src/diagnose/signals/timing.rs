//! Rows missing, and rows at uneven times or another rate.

use super::channels::LogSignals;
use crate::finding::{Code, Finding, Severity};
use std::ops::Range;

/// Part of the rows that may be missing, of the servo period that the period of a log may be off, and of its own
/// period that the times of rows may be off, rms: at 1 mm/s and 2 ms the last is 20 nm of motion.
const TOLERANCE: f64 = 0.01;

/// What the times of rows show against a line over their sequence, the same in all movements.
pub(super) fn timing(log: &LogSignals) -> Vec<Finding> {
    let steps = |from: usize, to: usize| {
        let [from, to] = [from, to].map(|row| log.rows[row].frame.sequence());
        f64::from(to.wrapping_sub(from))
    };
    let centred = |segment: &Range<usize>| {
        let time_s = |row: usize| (log.rows[row].t_us - log.rows[segment.start].t_us) as f64 * 1e-6;
        let point = |row: usize| [steps(segment.start, row), time_s(row)];
        let points: Vec<[f64; 2]> = segment.clone().map(point).collect();
        let mean = |k: usize| points.iter().map(|p| p[k]).sum::<f64>() / points.len() as f64;
        let [k, t] = [0, 1].map(mean);
        points.into_iter().map(move |p| [p[0] - k, p[1] - t])
    };
    let points: Vec<[f64; 2]> = log.segments.iter().flat_map(centred).collect();
    let sum = |of: &dyn Fn(&[f64; 2]) -> f64| points.iter().map(of).sum::<f64>();
    let period_s = sum(&|[k, t]| k * t) / sum(&|[k, _]| k * k);
    let count = log.rows.len() as f64;
    let rms_s = (sum(&|[k, t]| (t - period_s * k).powi(2)) / count).sqrt();

    let rows = log.segments.iter().flat_map(|s| s.start + 1..s.end);
    let gaps: Vec<usize> = rows.filter(|&row| steps(row - 1, row) > 1.0).collect();
    let mut found = Vec::new();
    if let Some(&first) = gaps.first() {
        let rows: f64 = gaps.iter().map(|&row| steps(row - 1, row) - 1.0).sum();
        let share = rows / (rows + count);
        let message = format!(
            "{rows} rows are missing ({:.2} %) in {} gaps: look for frames that the recorder lost",
            share * 100.0,
            gaps.len(),
        );
        let missing = log.warning_at(Code::RowsMissing, first, message);
        found.push(missing.severe(severity(share)).of(rows, "rows"));
    }
    let rms_us = rms_s * 1e6;
    if rms_s > TOLERANCE * log.period_s {
        let message = format!(
            "rows come at uneven times, {rms_us:.0} us rms off an even rate: have the servo's clock start all converters and \
             stamp the rows"
        );
        found.push(log.warning(Code::Jitter, message).of(rms_us, "us"));
    }
    let servo_periods = period_s / log.stage.servo_period_s;
    if (servo_periods - 1.0).abs() > TOLERANCE {
        let count = servo_periods.round().max(1.0);
        let off = (servo_periods / count - 1.0).abs();
        let what = match severity(off) {
            Severity::Note => format!("the log is thinned, to one of {count} servo periods: "),
            _ => String::new(),
        };
        let message = format!(
            "{what}rows are {:.1} us apart, the servo period of stage.toml is {:.1} us: log every period, or correct \
             servo.period_s",
            period_s * 1e6,
            log.stage.servo_period_s * 1e6,
        );
        let rate = log.warning(Code::Jitter, message);
        found.push(rate.severe(severity(off)).of(period_s * 1e6, "us"));
    }
    found
}

fn severity(off: f64) -> Severity {
    match off > TOLERANCE {
        true => Severity::Warn,
        false => Severity::Note,
    }
}

#[cfg(test)]
mod tests {
    use super::super::sample_for_tests::{PERIOD_S, dataset, found, recording};
    use super::*;
    use crate::input::dataset::Dataset;
    use crate::simulate::random::{Purpose, Stream};

    fn only(dataset: &Dataset) -> (Code, Severity, f64) {
        let found = found(dataset);
        assert_eq!(found.len(), 1, "{found:#?}");
        let value = found[0].value.expect("a size");
        (found[0].code, found[0].severity, value)
    }

    /// One row of so many is missing.
    fn without_one_of(count: usize) -> Dataset {
        let sound = dataset(&recording());
        let mut gappy = sound.clone();
        let mut rows = sound.rows.into_iter().enumerate();
        gappy.rows.clear();
        for movement in &mut gappy.movements {
            let (start, all) = (gappy.rows.len(), movement.rows.len());
            let kept = rows.by_ref().take(all);
            let kept = kept.filter(|(k, _)| k % count != count / 2);
            gappy.rows.extend(kept.map(|(_, row)| row));
            movement.rows = start..gappy.rows.len();
        }
        gappy.logs[0].rows = 0..gappy.rows.len();
        gappy
    }

    /// With so many servo periods from row to row.
    fn every(periods: f64) -> Dataset {
        let mut dataset = dataset(&recording());
        for movement in dataset.movements.clone() {
            for (k, row) in dataset.rows[movement.rows].iter_mut().enumerate() {
                row.t_us = (k as f64 * periods * PERIOD_S * 1e6) as i64;
            }
        }
        dataset
    }

    #[test]
    fn missing_rows_are_counted_and_many_a_warning() {
        let found = [200, 50].map(|count| only(&without_one_of(count)));
        let missing = |severity, rows| (Code::RowsMissing, severity, rows);
        assert_eq!(
            found,
            [
                missing(Severity::Note, 30.0),
                missing(Severity::Warn, 120.0)
            ]
        );
    }

    #[test]
    fn uneven_times_are_reported_in_us() {
        let mut random = Stream::new(7, Purpose::Sensors, 0);
        let mut uneven = dataset(&recording());
        for row in &mut uneven.rows {
            row.t_us += random.between(-150.0, 150.0) as i64;
        }
        let (code, severity, rms_us) = only(&uneven);
        assert_eq!((code, severity), (Code::Jitter, Severity::Warn));
        assert!((80.0..93.0).contains(&rms_us), "{rms_us}");
    }

    #[test]
    fn another_rate_is_a_warning_and_that_of_a_thinned_log_a_note() {
        for (periods, severity) in [
            (0.5, Severity::Warn),
            (5.5, Severity::Warn),
            (4.0, Severity::Note),
        ] {
            let (code, found, period_us) = only(&every(periods));
            assert_eq!((code, found), (Code::Jitter, severity), "{periods}");
            assert!((period_us - 2000.0 * periods).abs() < 0.1, "{period_us}");
        }
    }
}
