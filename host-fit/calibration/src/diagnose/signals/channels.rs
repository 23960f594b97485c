//! The signals of one log, channel by channel.

use hallstage_input::channel::Channel;
use hallstage_input::channels::{self, Column, runs, signals};
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
    /// [`Channel::SINGLE`](hallstage_input::channel::Channel::SINGLE); empty where the log does not have the channel.
    pub(super) channels: [Vec<f64>; 9],
    /// Rows that are outliers of a channel.
    pub(super) outliers: Vec<usize>,
    /// Their properties, where the log has the channel.
    pub(super) columns: [Option<&'a Column>; 9],
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
        columns: &'a [Column],
    ) -> Self {
        let source = &dataset.logs[log];
        let (start, rows) = (source.rows.start, &dataset.rows[source.rows.clone()]);
        let movements = dataset.movements.iter().filter(|m| m.log == log);
        let segments: Vec<Range<usize>> = movements
            .map(|m| m.rows.start - start..m.rows.end - start)
            .collect();
        let columns = Channel::SINGLE.map(|channel| {
            let is_own = |column: &&Column| (column.log, column.channel) == (log, channel);
            columns.iter().find(is_own)
        });
        let runs = runs(dataset, source);
        let (mut channels, mut outliers) = ([const { Vec::new() }; 9], Vec::new());
        for signal in signals(dataset, stage, source, &runs) {
            let channel = signal.channel as usize;
            let values_m = signal.values.iter().map(|value| value * signal.unit_m);
            channels[channel] = values_m.collect();
            if columns[channel].is_some_and(|column| column.slow.is_none()) {
                outliers.extend(channels::outliers(&signal).into_iter().map(|(row, _)| row));
            }
        }
        Self {
            channels,
            columns,
            outliers,
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

/// The median; 0 if there are no values.
pub(super) fn median(values: impl Iterator<Item = f64>) -> f64 {
    statistics::median(&mut values.collect::<Vec<f64>>()).unwrap_or(0.0)
}

/// The medians of blocks of rows.
pub(super) fn levels(values: &[f64]) -> Vec<f64> {
    let blocks = values.chunks_exact(super::BLOCK);
    blocks.map(|block| median(block.iter().copied())).collect()
}
