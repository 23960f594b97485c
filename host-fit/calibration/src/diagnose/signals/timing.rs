//! Rows missing, and rows at uneven times or another rate.

use super::channels::LogSignals;
use crate::finding::{Code, Finding, Severity};
use crate::input::stage::Stage;

/// Deviation of the times of rows from even ones that is worth a warning, in periods: at 1 mm/s
/// and 2 ms it is 20 nm of motion.
const JITTER_MIN: f64 = 0.01;
/// Relative difference of the rate from the servo's that is: far above a crystal's.
const RATE_MIN: f64 = 0.005;
/// From here on, in servo periods, rows are thinned on purpose.
const THINNED_FROM: f64 = 5.0;
/// Share of missing rows from which they are worth a warning.
const MISSING_MIN: f64 = 1e-3;

/// What the times of rows show.
pub(super) fn timing(log: &LogSignals, stage: &Stage) -> impl Iterator<Item = Finding> {
    let found = [missing(log), uneven(log), other_rate(log, stage)];
    found.into_iter().flatten()
}

/// Periods of the log from one row to a later one of its movement.
fn periods(log: &LogSignals, from: usize, to: usize) -> u32 {
    let [from, to] = [from, to].map(|row| log.rows[row].frame.sequence());
    to.wrapping_sub(from)
}

/// Time from one row to a later one of its movement, s.
fn seconds(log: &LogSignals, from: usize, to: usize) -> f64 {
    (log.rows[to].t_us - log.rows[from].t_us) as f64 * 1e-6
}

fn missing(log: &LogSignals) -> Option<Finding> {
    let rows = log.segments.iter().flat_map(|s| s.start + 1..s.end);
    let missed = |row: usize| periods(log, row - 1, row).saturating_sub(1);
    let gaps: Vec<usize> = rows.filter(|&row| missed(row) > 0).collect();
    let longest = gaps.iter().map(|&row| missed(row)).max()?;
    let rows: f64 = gaps.iter().map(|&row| f64::from(missed(row))).sum();
    let share = rows / (rows + log.len() as f64);
    let message = format!(
        "{rows} rows are missing ({:.2} %) in {} gaps, the longest of {longest}; before {}: look for frames that the \
         recorder lost",
        share * 100.0,
        gaps.len(),
        log.places(&gaps),
    );
    let severity = match share < MISSING_MIN {
        true => Severity::Note,
        false => Severity::Warn,
    };
    let found = log.warning_at(Code::RowsMissing, gaps[0], message);
    Some(found.severe(severity).of(rows, "rows"))
}

/// Times of the rows against even ones, in each movement.
fn uneven(log: &LogSignals) -> Option<Finding> {
    let (mut squares, mut rows) = (0.0, 0.0);
    let mut worst = (0.0, 0);
    for segment in log.segments.iter().filter(|segment| segment.len() >= 10) {
        let number = |row: usize| f64::from(periods(log, segment.start, row));
        // A line through the times: a rate that is only another one is not uneven.
        let n = segment.len() as f64;
        let mean_k = segment.clone().map(number).sum::<f64>() / n;
        let time_s = |row: usize| seconds(log, segment.start, row);
        let mean_s = segment.clone().map(time_s).sum::<f64>() / n;
        let (mut kk, mut kt) = (0.0, 0.0);
        for row in segment.clone() {
            let k = number(row) - mean_k;
            kk += k * k;
            kt += k * (time_s(row) - mean_s);
        }
        for row in segment.clone() {
            let off_s = time_s(row) - mean_s - kt / kk * (number(row) - mean_k);
            squares += off_s * off_s;
            if off_s.abs() > worst.0 {
                worst = (off_s.abs(), row);
            }
        }
        rows += n;
    }
    let rms_s = (squares / f64::max(rows, 1.0)).sqrt();
    (rms_s > JITTER_MIN * log.period_s).then(|| {
        let message = format!(
            "rows come at uneven times: {:.0} us rms off an even rate, at most {:.0} us ({}): have the servo's clock start \
             all converters and stamp the rows",
            rms_s * 1e6,
            worst.0 * 1e6,
            log.place(worst.1),
        );
        let found = log.warning_at(Code::Jitter, worst.1, message);
        found.of(rms_s * 1e6, "us")
    })
}

fn other_rate(log: &LogSignals, stage: &Stage) -> Option<Finding> {
    let ends = log.segments.iter().filter(|segment| segment.len() >= 2);
    let ends = ends.map(|segment| (segment.start, segment.end - 1));
    let time_s: f64 = ends.clone().map(|(a, b)| seconds(log, a, b)).sum();
    let period_s = time_s
        / ends
            .map(|(a, b)| f64::from(periods(log, a, b)))
            .sum::<f64>();
    let servo_periods = period_s / stage.servo_period_s;
    let is = |count: f64| (servo_periods / count - 1.0).abs() <= RATE_MIN;
    if !servo_periods.is_finite() || is(1.0) {
        return None;
    }
    let count = servo_periods.round();
    let severity = match count >= THINNED_FROM && is(count) {
        true => Severity::Note,
        false => Severity::Warn,
    };
    let rates = format!(
        "rows are {:.1} us apart, the servo period of stage.toml is {:.1} us",
        period_s * 1e6,
        stage.servo_period_s * 1e6,
    );
    let message = match is(count) && count >= 2.0 {
        true => format!(
            "the log is thinned, to one of {count} servo periods ({rates}): nothing is known of the rows between; log \
             every period, or correct servo.period_s"
        ),
        false => format!("{rates}: correct servo.period_s, or log every period"),
    };
    let found = log.warning(Code::Jitter, message).severe(severity);
    Some(found.of(period_s * 1e6, "us"))
}

#[cfg(test)]
mod tests {
    use super::super::sample_for_tests::{PERIOD_S, dataset, recording, warnings};
    use super::*;
    use crate::input::dataset::Dataset;
    use crate::simulate::random::{Purpose, Stream};

    fn only(dataset: &Dataset) -> (Code, Option<f64>) {
        let found = warnings(dataset);
        assert_eq!(found.len(), 1, "{found:#?}");
        (found[0].code, found[0].value)
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
    fn uneven_times_are_reported_in_us() {
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
    fn another_rate_is_reported_and_a_thinned_log_is_not_warned_of() {
        for periods in [2.0, 5.5] {
            let (code, period_us) = only(&every(periods));
            assert_eq!(code, Code::Jitter);
            let period_us = period_us.expect("a period");
            assert!((period_us - 2000.0 * periods).abs() < 0.1, "{period_us}");
        }
        let thinned = &warnings(&every(4.0))[0];
        assert!(
            thinned.message.contains("one of 4 servo periods"),
            "{thinned:?}"
        );
        assert_eq!(warnings(&every(10.0)), []);
    }
}
