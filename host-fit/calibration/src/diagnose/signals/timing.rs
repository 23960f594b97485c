//! Rows missing, and rows at uneven times or another rate.

use super::channels::LogSignals;
use crate::diagnose::limits::severity_of_share;
use crate::diagnose::units;
use hallstage_input::finding::{Finding, Kind, Severity};

/// Missing rows and uneven times, from times and sequence numbers. Severity is by the share of the rows or of the
/// period: 2 % of 2 ms at 1 mm/s is 40 nm of motion.
pub(super) fn timing(log: &LogSignals) -> Vec<Finding> {
    // Each row with the servo periods and the time (us) since the row before.
    let step = |row: usize| {
        let [before, here] = [row - 1, row].map(|row| &log.rows[row]);
        let periods = (here.frame.sequence()).wrapping_sub(before.frame.sequence());
        (row, f64::from(periods), (here.t_us - before.t_us) as f64)
    };
    let rows = log.segments.iter().flat_map(|s| s.start + 1..s.end);
    let steps: Vec<(usize, f64, f64)> = rows.map(step).collect();
    if steps.is_empty() {
        return Vec::new();
    }
    let sum = |of: &dyn Fn(f64, f64) -> f64| steps.iter().map(|&(_, k, us)| of(k, us)).sum::<f64>();
    let period_us = sum(&|_, us| us) / sum(&|k, _| k).max(1.0);
    // A step has the errors of two times.
    let squares = sum(&|k, us| (us - period_us * k).powi(2));
    let rms_us = (squares / (2 * steps.len()) as f64).sqrt();

    let mut found = Vec::new();
    let gaps: Vec<_> = steps.iter().filter(|(_, k, _)| *k > 1.0).collect();
    if let Some((first, ..)) = gaps.first() {
        let missing: f64 = gaps.iter().map(|(_, k, _)| k - 1.0).sum();
        let share = missing / (missing + log.rows.len() as f64);
        let kind = Kind::RowsMissing {
            rows: missing,
            percent: 100.0 * share,
            gaps: gaps.len(),
        };
        let lost = log.found_at(*first, kind);
        found.push(lost.with_severity(severity_of_share(share).min(Severity::Warn)));
    }
    if severity_of_share(rms_us / period_us) > Severity::Note {
        found.push(Finding::new(Kind::UnevenTimes { rms_us }));
    }
    let servo_us = log.stage.servo_period_s * 1e6;
    let servo_periods = period_us / servo_us;
    if let Some(unit) = units::of_times(servo_periods) {
        found.push(unit);
    } else if severity_of_share((servo_periods - 1.0).abs()) > Severity::Note {
        let whole = servo_periods.round().max(1.0);
        let severity = severity_of_share((servo_periods / whole - 1.0).abs()).min(Severity::Warn);
        let periods = (severity == Severity::Note).then_some(whole);
        let kind = Kind::OtherRate {
            period_us,
            servo_us,
            periods,
        };
        found.push(Finding::new(kind).with_severity(severity));
    }
    found
}

#[cfg(test)]
mod tests {
    use super::super::sample_for_tests::{PERIOD_S, dataset, found, recording};
    use super::*;
    use hallstage_input::dataset::Dataset;
    use hallstage_input::finding::Code;
    use hallstage_simulate::random::{Purpose, Stream};

    fn only(dataset: &Dataset) -> (Code, Severity, f64) {
        let found = found(dataset);
        assert_eq!(found.len(), 1, "{found:#?}");
        let value = found[0].value().expect("a size");
        (found[0].code(), found[0].severity, value)
    }

    #[test]
    fn missing_rows_are_counted_and_many_a_warning() {
        let sound = dataset(&recording());
        for (one_of, severity, missing) in
            [(200, Severity::Note, 30.0), (50, Severity::Warn, 120.0)]
        {
            let mut gappy = sound.without(&[]);
            gappy.rows.clear();
            for movement in &mut gappy.movements {
                let start = gappy.rows.len();
                let kept = movement
                    .rows
                    .clone()
                    .filter(|row| row % one_of != one_of / 2);
                gappy.rows.extend(kept.map(|row| sound.rows[row]));
                movement.rows = start..gappy.rows.len();
            }
            gappy.logs[0].rows = 0..gappy.rows.len();
            assert_eq!(only(&gappy), (Code::RowsMissing, severity, missing));
        }
    }

    #[test]
    fn uneven_times_and_another_rate_are_warnings_and_the_rate_of_a_thinned_log_a_note_unless_it_is_a_unit()
     {
        let mut random = Stream::new(7, Purpose::Sensors, 0);
        let mut uneven = dataset(&recording());
        for row in &mut uneven.rows {
            row.t_us += random.between(-150.0, 150.0) as i64;
        }
        let (code, severity, rms_us) = only(&uneven);
        assert_eq!((code, severity), (Code::Jitter, Severity::Warn));
        assert!((80.0..93.0).contains(&rms_us), "{rms_us}");
        for (periods, severity) in [
            (0.5, Some(Severity::Warn)),
            (5.5, Some(Severity::Warn)),
            (4.0, Some(Severity::Note)),
            (1000.0, None),
        ] {
            let mut every = dataset(&recording());
            for movement in every.movements.clone() {
                for (k, row) in every.rows[movement.rows].iter_mut().enumerate() {
                    row.t_us = (k as f64 * periods * PERIOD_S * 1e6) as i64;
                }
            }
            let found = only(&every);
            let Some(severity) = severity else {
                assert_eq!(found, (Code::ScaleWrong, Severity::Refuse, periods));
                continue;
            };
            assert_eq!((found.0, found.1), (Code::Jitter, severity), "{periods}");
            assert!((found.2 - 2000.0 * periods).abs() < 0.1, "{periods}");
        }
    }
}
