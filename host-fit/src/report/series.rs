//! Rows of a log as the points of a chart: a bounded number whatever the length of the log.

use crate::diagnose::signals::times_s;
use crate::input::dataset::Dataset;
use std::ops::Range;

/// Columns of a chart: about one a pixel.
const COLUMNS: usize = 560;
/// Columns without a row after which a line ends.
const GAP: f64 = 6.0;

/// Time of every row, s: the logs one after the other, each from its first row.
pub(super) fn times(dataset: &Dataset, period_s: f64) -> Vec<f64> {
    let mut times: Vec<f64> = Vec::with_capacity(dataset.rows.len());
    for movements in dataset.movements.chunk_by(|a, b| a.log == b.log) {
        let first = times.len();
        let segments: Vec<Range<usize>> = (movements.iter())
            .map(|movement| movement.rows.start - first..movement.rows.end - first)
            .collect();
        let end = segments.last().map_or(0, |rows| rows.end);
        let start_s = times.last().map_or(0.0, |time| time + period_s);
        let log = times_s(&dataset.rows[first..first + end], &segments, period_s);
        times.extend(log.iter().map(|time| start_s + time));
    }
    times
}

/// Lines through rows in the order of their abscissae: of each column of the chart the smallest and
/// the largest value, so that no peak is lost. A line ends where rows are missing.
pub(super) fn lines(x: &[f64], y: impl Fn(usize) -> Option<f64>) -> Vec<Vec<(f64, f64)>> {
    let (Some(&first), Some(&last)) = (x.first(), x.last()) else {
        return Vec::new();
    };
    let per_column = (last - first).max(f64::MIN_POSITIVE) / COLUMNS as f64;
    let usual = (last - first) / x.len() as f64;
    let gap = GAP * per_column.max(usual);
    let mut lines = Vec::new();
    let mut line: Vec<(f64, f64)> = Vec::new();
    let mut column: Option<Column> = None;
    for (row, &x) in x.iter().enumerate() {
        let Some(y) = y(row) else {
            continue;
        };
        let number = ((x - first) / per_column) as usize;
        match &mut column {
            Some(here) if here.number == number => here.add((x, y)),
            before => {
                let last = before.take();
                let broken = last.as_ref().is_some_and(|last| x - last.end > gap);
                line.extend(last.iter().flat_map(Column::points));
                if broken {
                    lines.push(std::mem::take(&mut line));
                }
                column = Some(Column::new(number, (x, y)));
            }
        }
    }
    line.extend(column.iter().flat_map(Column::points));
    lines.push(line);
    lines.retain(|line| !line.is_empty());
    lines
}

/// The extremes of the rows that share a column.
struct Column {
    number: usize,
    end: f64,
    low: (f64, f64),
    high: (f64, f64),
}

impl Column {
    const fn new(number: usize, point: (f64, f64)) -> Self {
        Self {
            number,
            end: point.0,
            low: point,
            high: point,
        }
    }

    fn add(&mut self, point: (f64, f64)) {
        self.end = point.0;
        if point.1 < self.low.1 {
            self.low = point;
        }
        if point.1 > self.high.1 {
            self.high = point;
        }
    }

    /// Smallest and largest in the order of the rows; one where they are the same.
    fn points(&self) -> impl Iterator<Item = (f64, f64)> + use<> {
        let (first, second) = if self.low.0 <= self.high.0 {
            (self.low, self.high)
        } else {
            (self.high, self.low)
        };
        std::iter::once(first).chain((first != second).then_some(second))
    }
}

/// What the values of one interval of the abscissa have in common.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Bin {
    count: f64,
    x: f64,
    y: f64,
    y_squares: f64,
}

impl Bin {
    /// Mean of the abscissae and of the values.
    pub(super) fn mean(&self) -> (f64, f64) {
        (self.x / self.count, self.y / self.count)
    }

    /// Standard deviation of the values.
    pub(super) fn deviation(&self) -> f64 {
        let (_, mean) = self.mean();
        (self.y_squares / self.count - mean * mean).max(0.0).sqrt()
    }
}

/// Values gathered in `count` equal intervals of an abscissa between two ends; those with fewer
/// than a fiftieth of an equal share are left out.
pub(super) fn bins(
    points: impl Iterator<Item = (f64, f64)>,
    (low, high): (f64, f64),
    count: usize,
) -> Vec<Bin> {
    let mut bins = vec![Bin::default(); count];
    let mut all = 0.0;
    for (x, y) in points {
        let place = (x - low) / (high - low) * count as f64;
        if let Some(bin) = bins.get_mut((place as usize).min(count - 1)) {
            bin.count += 1.0;
            bin.x += x;
            bin.y += y;
            bin.y_squares += y * y;
        }
        all += 1.0;
    }
    bins.retain(|bin| bin.count > 0.0 && bin.count >= all / (50.0 * count as f64));
    bins
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_long_series_keeps_its_peaks_in_a_bounded_number_of_points() {
        let x: Vec<f64> = (0..200_000).map(f64::from).collect();
        let y = |row: usize| {
            Some(if row == 123_456 {
                7.0
            } else {
                (row as f64).sin()
            })
        };
        let lines = lines(&x, y);
        assert_eq!(lines.len(), 1);
        assert!(lines[0].len() <= 2 * (COLUMNS + 1), "{}", lines[0].len());
        assert!(lines[0].contains(&(123_456.0, 7.0)));
        assert!(lines[0].is_sorted_by(|a, b| a.0 < b.0));
    }

    #[test]
    fn a_line_ends_where_rows_are_missing() {
        let x: Vec<f64> = (0..100).chain(400..500).map(f64::from).collect();
        let found = lines(&x, |row| Some(row as f64));
        assert_eq!(found.iter().map(Vec::len).collect::<Vec<_>>(), [100, 100]);
        assert_eq!(lines(&x, |_| None), Vec::<Vec<(f64, f64)>>::new());
    }

    #[test]
    fn bins_hold_mean_and_deviation_worked_by_hand() {
        let points = [(0.1, 1.0), (0.3, 3.0), (1.0, 5.0)];
        let bins = bins(points.into_iter(), (0.0, 1.0), 2);
        assert_eq!(
            bins.iter().map(Bin::mean).collect::<Vec<_>>(),
            [(0.2, 2.0), (1.0, 5.0)]
        );
        assert_eq!(
            bins.iter().map(Bin::deviation).collect::<Vec<_>>(),
            [1.0, 0.0]
        );
    }
}
