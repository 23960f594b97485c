//! A log that is too long to be held as rows: its samples in [`chunk`]s, and the [`excerpt`] of
//! them that a fit works on; or what is kept of it while it is [`passing`].

pub mod chunk;
pub mod excerpt;
pub mod passing;
pub mod pieces;

use super::dataset::{LogSource, Movement, Row, Scales};
use chunk::{Chunk, Sample};
use std::ops::Range;

/// Samples in the order of their rows.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Samples {
    chunks: Vec<Chunk>,
    /// The row after the last of each chunk.
    ends: Vec<usize>,
}

impl Samples {
    /// How many there are.
    pub fn len(&self) -> usize {
        self.ends.last().copied().unwrap_or(0)
    }

    /// The memory that they take, bytes, where the last chunk is like the others.
    pub fn bytes(&self) -> u64 {
        let row = self.chunks.last().map_or(0, Chunk::row_bytes);
        (self.chunks.capacity() * size_of::<Chunk>() + self.len() * row) as u64
    }

    /// Whether there are none.
    pub const fn is_empty(&self) -> bool {
        self.ends.is_empty()
    }

    /// Adds one.
    pub fn push(&mut self, sample: &Sample) {
        let end = self.len() + 1;
        if let (Some(chunk), Some(last)) = (self.chunks.last_mut(), self.ends.last_mut())
            && chunk.push(sample)
        {
            *last = end;
            return;
        }
        self.chunks.push(Chunk::new(sample));
        self.ends.push(end);
    }

    /// Those of some rows, at most to the last.
    pub fn of(&self, rows: Range<usize>) -> impl Iterator<Item = Sample> {
        let first = self.ends.partition_point(|&end| end <= rows.start);
        let pieces = (first..self.chunks.len())
            .map(|k| (&self.chunks[k], self.range(k)))
            .take_while(move |(_, range)| range.start < rows.end);
        pieces.flat_map(move |(chunk, range)| {
            let start = rows.start.max(range.start) - range.start;
            let end = rows.end.min(range.end) - range.start;
            (start..end).map(|k| chunk.at(k))
        })
    }

    /// That of a row below the length.
    fn at(&self, row: usize) -> Sample {
        let chunk = self.ends.partition_point(|&end| end <= row);
        self.chunks[chunk].at(row - self.range(chunk).start)
    }

    /// The rows of each chunk.
    pub fn ranges(&self) -> Vec<Range<usize>> {
        (0..self.chunks.len()).map(|k| self.range(k)).collect()
    }

    fn range(&self, chunk: usize) -> Range<usize> {
        let end = self.ends[chunk];
        end - self.chunks[chunk].len()..end
    }
}

/// All samples of one or more long logs.
#[derive(Clone, Debug, PartialEq)]
pub struct Whole {
    scales: Scales,
    samples: Samples,
    movements: Vec<Movement>,
    logs: Vec<LogSource>,
}

impl Whole {
    /// Samples with what turns them into rows, and the movements and logs that cover them in
    /// their order.
    pub const fn new(
        scales: Scales,
        samples: Samples,
        movements: Vec<Movement>,
        logs: Vec<LogSource>,
    ) -> Self {
        Self {
            scales,
            samples,
            movements,
            logs,
        }
    }

    /// How many rows there are.
    pub fn rows(&self) -> usize {
        self.samples.len()
    }

    /// The samples.
    pub const fn samples(&self) -> &Samples {
        &self.samples
    }

    /// The movements of the logs.
    pub fn movements(&self) -> &[Movement] {
        &self.movements
    }

    /// The logs.
    pub fn logs(&self) -> &[LogSource] {
        &self.logs
    }

    /// Time of a row within its log, us.
    pub fn t_us(&self, row: usize) -> Option<i64> {
        (row < self.rows()).then(|| self.samples.at(row).t_us)
    }

    /// A row below [`rows`](Self::rows), without its movement and sequence number.
    fn row(&self, row: usize) -> Row {
        self.scales.row(0, &self.samples.at(row))
    }

    /// Some rows of a movement; their sequence numbers are 0.
    pub fn rows_of(&self, movement: usize, rows: Range<usize>) -> impl Iterator<Item = Row> {
        let row = move |sample| self.scales.row(movement, &sample);
        self.samples.of(rows).map(row)
    }
}

#[cfg(test)]
mod fit_tests;
#[cfg(test)]
mod tests;
