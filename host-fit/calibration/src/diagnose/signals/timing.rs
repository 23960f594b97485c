//! Rows missing, and rows at uneven times or another rate.

use super::channels::LogSignals;
use super::places::{Place, Told};
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
/// Gaps that are told one by one.
const SHOWN: usize = 3;

/// What the times of rows tell.
#[derive(Clone, Debug, Default)]
pub(super) struct Timing {
    missing: u64,
    longest: u32,
    gaps: usize,
    /// The first of them.
    shown: Vec<Place>,
    /// Sum of the squared deviations from even times, s^2, of so many rows.
    squares: f64,
    rows: f64,
    worst_s: f64,
    worst: Option<Place>,
    /// Length of the movements, s, and their periods.
    time_s: f64,
    periods: f64,
}

impl Timing {
    /// Of the rows of a log.
    pub(super) fn of(log: &LogSignals) -> Self {
        let mut timing = Self::default();
        timing.look_for_gaps(log);
        timing.compare_with_even(log);
        for segment in log.segments.iter().filter(|segment| segment.len() >= 2) {
            timing.time_s += log.time_s[segment.end - 1] - log.time_s[segment.start];
            timing.periods += (segment.start + 1..segment.end)
                .map(|row| f64::from(periods(log, row)))
                .sum::<f64>();
        }
        timing
    }

    /// What is wrong with them; `period_s` is the median time from row to row.
    pub(super) fn findings(&self, told: &Told, stage: &Stage, period_s: f64) -> Vec<Finding> {
        let mut findings = Vec::new();
        findings.extend(self.of_missing(told));
        findings.extend(self.of_uneven(told, period_s));
        findings.extend(self.of_other_rate(told, stage));
        findings
    }

    fn look_for_gaps(&mut self, log: &LogSignals) {
        for segment in &log.segments {
            for row in segment.start + 1..segment.end {
                let missed = periods(log, row).saturating_sub(1);
                if missed > 0 {
                    self.missing += u64::from(missed);
                    self.longest = self.longest.max(missed);
                    self.gaps += 1;
                    if self.shown.len() < SHOWN {
                        self.shown.push(log.at(row));
                    }
                }
            }
        }
    }
}

/// Periods of the log between two rows of a movement.
fn periods(log: &LogSignals, row: usize) -> u32 {
    let sequence = |row: usize| log.rows[row].frame.sequence();
    sequence(row).wrapping_sub(sequence(row - 1))
}

impl Timing {
    fn of_missing(&self, told: &Told) -> Option<Finding> {
        let first = self.shown.first()?;
        let rows = self.missing;
        let share = rows as f64 / (rows as f64 + told.rows as f64);
        let severity = if share < MISSING_MIN {
            Severity::Note
        } else {
            Severity::Warn
        };
        let message = format!(
            "{rows} rows are missing ({:.2} %) in {} gaps, the longest of {}; before {}{}: look for frames that the \
         recorder lost",
            share * 100.0,
            self.gaps,
            self.longest,
            told.places(&self.shown),
            if self.gaps > SHOWN { ", ..." } else { "" },
        );
        Some(Finding {
            severity,
            value: Some(rows as f64),
            unit: Some("rows"),
            ..told.warning_at(Code::RowsMissing, first, message)
        })
    }

    /// Times of the rows against even ones, in each movement.
    fn compare_with_even(&mut self, log: &LogSignals) {
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
                self.squares += off_s * off_s;
                self.rows += 1.0;
                if off_s.abs() > self.worst_s {
                    (self.worst_s, self.worst) = (off_s.abs(), Some(log.at(row)));
                }
            }
        }
    }

    fn of_uneven(&self, told: &Told, period_s: f64) -> Option<Finding> {
        let rms_s = f64::sqrt(self.squares / f64::max(self.rows, 1.0));
        if rms_s <= JITTER_MIN * period_s {
            return None;
        }
        let worst = self.worst.as_ref()?;
        let message = format!(
            "rows come at uneven times: {:.0} us rms off an even rate, at most {:.0} us ({}): have the servo's clock start \
         all converters and stamp the rows",
            rms_s * 1e6,
            self.worst_s * 1e6,
            told.place(worst),
        );
        Some(Finding {
            value: Some(rms_s * 1e6),
            unit: Some("us"),
            ..told.warning_at(Code::Jitter, worst, message)
        })
    }

    fn of_other_rate(&self, told: &Told, stage: &Stage) -> Option<Finding> {
        let period_s = self.time_s / self.periods;
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
        Some(Finding {
            severity,
            value: Some(period_s * 1e6),
            unit: Some("us"),
            ..told.warning(Code::Jitter, message)
        })
    }
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
