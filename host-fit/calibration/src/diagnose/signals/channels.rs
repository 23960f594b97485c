//! The signals of one log, channel by channel.

use crate::finding::{Code, Finding, Severity};
use crate::input::dataset::{Dataset, Row};
use crate::input::stage::Stage;
use crate::statistics;
use runtime::capacitive::vertical_rows;
use std::ops::Range;

/// Names of the Hall probes and the beams.
pub(super) const HALL: [&str; 3] = ["hall_a", "hall_b", "hall_c"];
pub(super) const BEAMS: [&str; 3] = ["ifm_x", "ifm_y1", "ifm_y2"];
/// Finer than any interferometer reads.
const BEAM_GRID_M: f64 = 1e-11;
const CAPACITIVE: [&str; 3] = ["cap_1", "cap_2", "cap_3"];

/// One channel of a log.
pub(super) struct Channel {
    pub(super) name: &'static str,
    /// By row, m.
    pub(super) values: Vec<f64>,
    /// m per code; 0 for a beam.
    pub(super) m_per_code: f64,
}

/// One log. Rows are numbered from its first.
pub(super) struct LogSignals<'a> {
    dataset: &'a Dataset,
    log: usize,
    pub(super) rows: &'a [Row],
    /// Its movements.
    pub(super) segments: Vec<Range<usize>>,
    /// Hall A, B, C; X, Y1, Y2; then the gaps where the log has codes.
    pub(super) channels: Vec<Channel>,
    /// Whether a row is used by the tests of residuals.
    pub(super) usable: Vec<bool>,
    /// Time since the start of the log, s; a movement whose time starts anew follows the one before.
    pub(super) time_s: Vec<f64>,
    /// Rows of the matrix that turns gaps (m) into Z, Rx, Ry.
    pub(super) gap_rows: [[f64; 3]; 3],
    /// Distance of the Y beams, m.
    pub(super) baseline_m: f64,
    /// Median time between rows, s.
    pub(super) period_s: f64,
    first: usize,
}

impl<'a> LogSignals<'a> {
    pub(super) fn new(dataset: &'a Dataset, stage: &Stage, log: usize) -> Self {
        let range = dataset.logs[log].rows.clone();
        let rows = &dataset.rows[range.clone()];
        let movements = dataset.movements.iter().filter(|m| m.log == log);
        let segments: Vec<Range<usize>> = movements
            .map(|m| m.rows.start - range.start..m.rows.end - range.start)
            .collect();
        let period_s = period_s(rows, &segments, stage.servo_period_s);
        Self {
            channels: channels(rows, stage),
            usable: vec![true; rows.len()],
            time_s: times_s(rows, &segments, period_s),
            // A checked stage has its sensors apart.
            gap_rows: vertical_rows(&stage.capacitive_probes_m).unwrap_or_default(),
            baseline_m: stage.y_baseline_m,
            first: range.start,
            dataset,
            log,
            rows,
            segments,
            period_s,
        }
    }

    pub(super) const fn len(&self) -> usize {
        self.rows.len()
    }

    /// How many rows last this long, at least one.
    pub(super) fn rows_in(&self, time_s: f64) -> usize {
        ((time_s / self.period_s).round() as usize).max(1)
    }

    /// Whether the tests of residuals use at least half of some rows.
    pub(super) fn is_mostly_used(&self, rows: &Range<usize>) -> bool {
        let used = self.usable[rows.clone()].iter().filter(|used| **used);
        2 * used.count() >= rows.len()
    }

    /// Leaves rows out, with those beside them, whose velocity is not that of the motion.
    pub(super) fn leave_out(&mut self, runs: impl IntoIterator<Item = Range<usize>>) {
        let rows = self.len();
        for run in runs {
            self.usable[run.start.saturating_sub(2)..(run.end + 2).min(rows)].fill(false);
        }
    }

    /// "movement 3 at t_us = 4000".
    pub(super) fn place(&self, row: usize) -> String {
        let Row { movement, t_us, .. } = self.rows[row];
        let movement = &self.dataset.movements[movement];
        let name = self.dataset.movement_name(movement);
        format!("movement {name} at t_us = {t_us}")
    }

    /// The first of many, in words.
    pub(super) fn places(&self, rows: &[usize]) -> String {
        const SHOWN: usize = 3;
        let shown: Vec<String> = rows
            .iter()
            .take(SHOWN)
            .map(|&row| self.place(row))
            .collect();
        let dots = if rows.len() > SHOWN { ", ..." } else { "" };
        shown.join(", ") + dots
    }

    /// A warning about the whole log, or several of its movements.
    pub(super) fn warning(&self, code: Code, message: String) -> Finding {
        let message = match self.dataset.logs.len() {
            1 => message,
            _ => format!("{}: {message}", self.dataset.logs[self.log].path.display()),
        };
        Finding::new(code, message).severe(Severity::Warn)
    }

    /// A warning about a place in the log.
    pub(super) fn warning_at(&self, code: Code, row: usize, message: String) -> Finding {
        let Row { movement, t_us, .. } = self.rows[row];
        let name = self
            .dataset
            .movement_name(&self.dataset.movements[movement]);
        self.warning(code, message).at(name, t_us)
    }

    pub(super) fn leave_out_undecoded(&mut self, errors: &[Option<[f64; 3]>]) {
        let errors = errors.get(self.first..).unwrap_or_default();
        for (usable, error) in self.usable.iter_mut().zip(errors) {
            *usable &= error.is_some();
        }
    }
}

fn channels(rows: &[Row], stage: &Stage) -> Vec<Channel> {
    let half_m = 0.5 * stage.y_baseline_m;
    let mut channels = Vec::with_capacity(9);
    for (i, name) in HALL.into_iter().enumerate() {
        channels.push(Channel {
            name,
            values: rows.iter().map(|row| row.signal_m[i]).collect(),
            m_per_code: stage.hall.m_per_count,
        });
    }
    // Through the pose and back equal beams would differ by rounding.
    let on_grid = |beam_m: f64| (beam_m / BEAM_GRID_M).round() * BEAM_GRID_M;
    let mut beams = [(); 3].map(|()| Vec::with_capacity(rows.len()));
    for row in rows {
        let [x, y, rz] = row.reference;
        let apart_m = half_m * rz.tan();
        for (values, beam_m) in beams.iter_mut().zip([x, y + apart_m, y - apart_m]) {
            values.push(on_grid(beam_m));
        }
    }
    channels.extend(BEAMS.into_iter().zip(beams).map(|(name, values)| Channel {
        name,
        values,
        m_per_code: 0.0,
    }));
    let m_per_code = stage.capacitive.m_per_count;
    for (i, name) in CAPACITIVE.into_iter().enumerate() {
        let gap = |row: &Row| Some(f64::from(row.frame.capacitive()?[i]) * m_per_code);
        if let Some(values) = rows.iter().map(gap).collect() {
            channels.push(Channel {
                name,
                values,
                m_per_code,
            });
        }
    }
    channels
}

/// Median time between the rows of the segments, s; that of the servo where there are too few.
pub fn period_s(rows: &[Row], segments: &[Range<usize>], servo_period_s: f64) -> f64 {
    let steps = (segments.iter()).flat_map(|s| rows[s.clone()].windows(2));
    let steps_us = steps.map(|pair| (pair[1].t_us - pair[0].t_us) as f64);
    let median_us = statistics::median(&mut steps_us.collect::<Vec<f64>>());
    median_us.map_or(servo_period_s, |us| (us * 1e-6).max(1e-6))
}

/// Time since the first row, s; a movement whose time starts anew follows the one before.
pub fn times_s(rows: &[Row], segments: &[Range<usize>], period_s: f64) -> Vec<f64> {
    let mut times_s: Vec<f64> = Vec::with_capacity(rows.len());
    for segment in segments {
        let rows_here = &rows[segment.clone()];
        let Some(first) = rows_here.first() else {
            continue;
        };
        let start_s = match (times_s.last(), segment.start.checked_sub(1)) {
            (Some(&before_s), Some(before)) if rows[before].t_us < first.t_us => {
                before_s + (first.t_us - rows[before].t_us) as f64 * 1e-6
            }
            (Some(&before_s), _) => before_s + period_s,
            (None, _) => 0.0,
        };
        times_s.extend((rows_here.iter()).map(|r| start_s + (r.t_us - first.t_us) as f64 * 1e-6));
    }
    times_s
}

/// The median; 0 of nothing.
pub(super) fn median(values: &mut [f64]) -> f64 {
    statistics::median(values).unwrap_or(0.0)
}

/// Standard deviation of normal numbers about zero from their median magnitude.
pub(super) fn robust_deviation(values: impl Iterator<Item = f64>) -> f64 {
    let mut magnitudes: Vec<f64> = values.map(f64::abs).collect();
    1.4826 * median(&mut magnitudes)
}

/// Largest less smallest.
pub(super) fn spread(values: &[f64]) -> f64 {
    let high = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let low = values.iter().copied().fold(f64::INFINITY, f64::min);
    (high - low).max(0.0)
}

/// Speeds of X, Y, Rz by row, per s: the middle two of the four slopes around each row of a segment: a jump or a step, which is no
/// speed, spoils two at most.
pub(super) fn speeds(log: &LogSignals) -> Vec<[f64; 3]> {
    let mut speeds = vec![[0.0; 3]; log.len()];
    for segment in &log.segments {
        for row in segment.clone() {
            let first = row.saturating_sub(1).max(segment.start + 1);
            let ends = first..(row + 3).min(segment.end);
            speeds[row] = [0, 1, 2].map(|i| {
                let mut slopes = [0.0; 4];
                let slopes = &mut slopes[..ends.len()];
                for (slope, end) in slopes.iter_mut().zip(ends.clone()) {
                    let moved = log.rows[end].reference[i] - log.rows[end - 1].reference[i];
                    *slope = moved / (log.time_s[end] - log.time_s[end - 1]).max(1e-6);
                }
                slopes.sort_unstable_by(f64::total_cmp);
                let middle = slopes.len().saturating_sub(1) / 2..slopes.len() / 2 + 1;
                let middle = slopes.get(middle).unwrap_or_default();
                middle.iter().sum::<f64>() / middle.len().max(1) as f64
            });
        }
    }
    speeds
}

/// A signal less its mean over each segment, of the rows that are used.
pub(super) fn signals_less_means(log: &LogSignals, k: usize) -> Vec<f64> {
    let mut out = Vec::with_capacity(log.len());
    for segment in &log.segments {
        let values = || {
            let rows = segment.clone().filter(|&row| log.usable[row]);
            rows.map(|row| log.channels[k].values[row])
        };
        let mean = values().sum::<f64>() / values().count().max(1) as f64;
        out.extend(values().map(|value| value - mean));
    }
    out
}

/// White noise times `scale`, from second differences, which hardly know the motion.
pub(super) fn white_noise(log: &LogSignals, values: &[f64], scale: f64) -> f64 {
    let rows = log.segments.iter().flat_map(|s| s.start + 2..s.end);
    let used = rows.filter(|&row| (row - 2..=row).all(|row| log.usable[row]));
    let differences = used.map(|row| values[row] - 2.0 * values[row - 1] + values[row - 2]);
    robust_deviation(differences) / 6f64.sqrt() * scale
}
