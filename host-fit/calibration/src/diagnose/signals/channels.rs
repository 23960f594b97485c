//! The signals of one log, channel by channel.

use crate::diagnose::slopes::CHANNELS;
use crate::finding::{Code, Finding, Severity};
use crate::input::dataset::{Dataset, LogSource, Row};
use crate::input::stage::Stage;
use crate::statistics;
use std::ops::Range;

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
    pub(super) dataset: &'a Dataset,
    pub(super) stage: &'a Stage,
    pub(super) source: &'a LogSource,
    pub(super) rows: &'a [Row],
    /// Its movements.
    pub(super) segments: Vec<Range<usize>>,
    /// Hall A, B, C; X, Y1, Y2; then the gaps where the log has codes.
    pub(super) channels: Vec<Channel>,
    /// Whether a row is used by the tests that follow.
    pub(super) usable: Vec<bool>,
    /// Median time between rows, s.
    pub(super) period_s: f64,
    /// The first of them in the dataset.
    pub(super) first: usize,
}

impl<'a> LogSignals<'a> {
    pub(super) fn new(dataset: &'a Dataset, stage: &'a Stage, log: usize) -> Self {
        let source = &dataset.logs[log];
        let range = source.rows.clone();
        let rows = &dataset.rows[range.clone()];
        let movements = dataset.movements.iter().filter(|m| m.log == log);
        let segments: Vec<Range<usize>> = movements
            .map(|m| m.rows.start - range.start..m.rows.end - range.start)
            .collect();
        let period_s = period_s(rows, &segments, stage.servo_period_s);
        Self {
            channels: channels(rows, stage),
            usable: vec![true; rows.len()],
            first: range.start,
            dataset,
            stage,
            source,
            rows,
            segments,
            period_s,
        }
    }

    /// Leaves rows out, with those beside them, whose velocity is not that of the motion.
    pub(super) fn leave_out(&mut self, runs: impl IntoIterator<Item = Range<usize>>) {
        let end = self.rows.len();
        for run in runs {
            self.usable[run.start.saturating_sub(2)..end.min(run.end + 2)].fill(false);
        }
    }

    /// A warning about the whole log, or several of its movements.
    pub(super) fn warning(&self, code: Code, message: String) -> Finding {
        let message = match self.dataset.logs.len() {
            1 => message,
            _ => format!("{}: {message}", self.source.name()),
        };
        Finding::new(code, message).severe(Severity::Warn)
    }

    /// A warning about a place in the log.
    pub(super) fn warning_at(&self, code: Code, row: usize, message: String) -> Finding {
        let Row { movement, t_us, .. } = self.rows[row];
        let dataset = self.dataset;
        let movement = dataset.movement_name(&dataset.movements[movement]);
        let message = format!("{message}. See movement {movement} at t_us = {t_us}");
        self.warning(code, message).at(movement, t_us)
    }
}

fn channels(rows: &[Row], stage: &Stage) -> Vec<Channel> {
    let half_m = 0.5 * stage.y_baseline_m;
    // Through the pose and back equal beams differ by rounding.
    let beam = |beam_m: f64| Some(f64::from(beam_m as f32));
    let value = |channel: usize, row: &Row| {
        let [x, y, rz] = row.reference;
        match channel {
            0..3 => Some(row.signal_m[channel]),
            3 => beam(x),
            4 => beam(y + half_m * rz.tan()),
            5 => beam(y - half_m * rz.tan()),
            _ => {
                let codes = row.frame.capacitive()?;
                Some(f64::from(codes[channel - 6]) * stage.capacitive.m_per_count)
            }
        }
    };
    let per_code = [stage.hall.m_per_count, 0.0, stage.capacitive.m_per_count];
    let channel = |(k, name): (usize, &'static str)| {
        let values = rows.iter().map(|row| value(k, row));
        Some(Channel {
            name,
            values: values.collect::<Option<_>>()?,
            m_per_code: per_code[k / 3],
        })
    };
    let channels = CHANNELS.into_iter().enumerate();
    channels.map_while(channel).collect()
}

/// Median time between the rows of the segments, s; that of the servo where there are too few.
pub fn period_s(rows: &[Row], segments: &[Range<usize>], servo_period_s: f64) -> f64 {
    let steps = (segments.iter()).flat_map(|s| rows[s.clone()].windows(2));
    let steps_us = steps.map(|pair| (pair[1].t_us - pair[0].t_us) as f64);
    let median_us = statistics::median(&mut steps_us.collect::<Vec<f64>>());
    median_us.map_or(servo_period_s, |us| (us * 1e-6).max(1e-6))
}

/// The median; 0 of nothing.
pub(super) fn median(values: impl Iterator<Item = f64>) -> f64 {
    statistics::median(&mut values.collect::<Vec<f64>>()).unwrap_or(0.0)
}
