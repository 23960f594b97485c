//! The signals of one log, channel by channel.

use hallstage_input::channel::Channel;
use hallstage_input::channels::Column;
use hallstage_input::dataset::{Dataset, LogSource, Row};
use hallstage_input::finding::{Finding, Kind};
use hallstage_input::stage::Stage;
use hallstage_input::statistics;
use std::ops::Range;

/// One log. Rows are numbered from its first.
pub(super) struct LogSignals<'a> {
    pub(super) dataset: &'a Dataset,
    pub(super) stage: &'a Stage,
    pub(super) source: &'a LogSource,
    pub(super) rows: &'a [Row],
    /// Its movements.
    pub(super) segments: Vec<Range<usize>>,
    /// The values by channel and row, m, in the order of
    /// [`Channel::SINGLE`](hallstage_input::channel::Channel::SINGLE); gaps only if the log has codes.
    pub(super) channels: Vec<Vec<f64>>,
    /// The step of the values of each channel, m.
    pub(super) steps_m: [f64; 9],
    /// Whether later tests use a row.
    pub(super) usable: Vec<bool>,
    /// Median time between rows, s.
    pub(super) period_s: f64,
}

impl<'a> LogSignals<'a> {
    pub(super) fn new(
        dataset: &'a Dataset,
        stage: &'a Stage,
        log: usize,
        columns: &[Column],
    ) -> Self {
        let source = &dataset.logs[log];
        let (start, rows) = (source.rows.start, &dataset.rows[source.rows.clone()]);
        let movements = dataset.movements.iter().filter(|m| m.log == log);
        let segments: Vec<Range<usize>> = movements
            .map(|m| m.rows.start - start..m.rows.end - start)
            .collect();
        Self {
            channels: channels(rows, stage),
            steps_m: Channel::SINGLE.map(|channel| {
                let is_own = |column: &&Column| (column.log, column.channel) == (log, channel);
                columns
                    .iter()
                    .find(is_own)
                    .map_or(0.0, |column| column.step_m)
            }),
            usable: vec![true; rows.len()],
            period_s: (dataset.period_s(source.rows.clone())).unwrap_or(stage.servo_period_s),
            dataset,
            stage,
            source,
            rows,
            segments,
        }
    }

    /// Leaves runs of rows out, and `beside` rows on either side.
    pub(super) fn leave_out(
        &mut self,
        runs: impl IntoIterator<Item = Range<usize>>,
        beside: usize,
    ) {
        let end = self.rows.len();
        for run in runs {
            self.usable[run.start.saturating_sub(beside)..end.min(run.end + beside)].fill(false);
        }
    }

    /// A finding at a row.
    pub(super) fn found_at(&self, row: usize, kind: Kind) -> Finding {
        let Row { movement, t_us, .. } = self.rows[row];
        let movement = &self.dataset.movements[movement];
        Finding::new(kind).with_place(self.dataset.movement_name(movement), t_us)
    }
}

fn channels(rows: &[Row], stage: &Stage) -> Vec<Vec<f64>> {
    let mut channels = vec![Vec::new(); 9];
    for row in rows {
        // Equal beams differ by rounding after the way to a pose and back.
        let beams_m = row
            .beams_m(&stage.interferometer)
            .map(|beam_m| f64::from(beam_m as f32));
        let codes = row.frame.capacitive().into_iter().flatten();
        let gaps_m = codes.map(|code| f64::from(code) * stage.capacitive.m_per_count);
        let values = row.signal_m.into_iter().chain(beams_m).chain(gaps_m);
        for (channel, value) in channels.iter_mut().zip(values) {
            channel.push(value);
        }
    }
    channels.retain(|values| values.len() == rows.len());
    channels
}

/// The median; 0 if there are no values.
pub(super) fn median(values: impl Iterator<Item = f64>) -> f64 {
    statistics::median(&mut values.collect::<Vec<f64>>()).unwrap_or(0.0)
}

/// The medians of blocks of rows.
pub(super) fn levels(values: &[f64]) -> Vec<f64> {
    let blocks = values.chunks_exact(super::BLOCK);
    blocks.map(|block| median(block.iter().copied())).collect()
}
