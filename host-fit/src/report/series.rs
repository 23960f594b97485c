//! Rows of a log as the points of a chart: a bounded number whatever the length of the log.

/// Columns of a chart over time: about one a pixel.
const COLUMNS: usize = 560;
/// What the values of one interval of the abscissa have in common.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Column {
    /// How many they are.
    pub(super) count: f64,
    x: f64,
    y: f64,
    y_squares: f64,
    low: f64,
    high: f64,
}

impl Column {
    const EMPTY: Self = Self {
        count: 0.0,
        x: 0.0,
        y: 0.0,
        y_squares: 0.0,
        low: f64::INFINITY,
        high: f64::NEG_INFINITY,
    };

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

/// Values gathered in `count` equal intervals of an abscissa between two ends.
pub(super) fn columns(
    points: impl Iterator<Item = (f64, f64)>,
    (low, high): (f64, f64),
    count: usize,
) -> Vec<Column> {
    let mut columns = vec![Column::EMPTY; count];
    for (x, y) in points {
        let place = (x - low) / (high - low) * count as f64;
        if let Some(column) = columns.get_mut((place as usize).min(count - 1)) {
            column.count += 1.0;
            column.x += x;
            column.y += y;
            column.y_squares += y * y;
            column.low = column.low.min(y);
            column.high = column.high.max(y);
        }
    }
    columns
}

/// Values over an abscissa from 0 to `end` as a band from the smallest to the largest in each column, so
/// that no peak is lost: abscissa, lower end, upper end. There are at least two of the `count` values a column.
pub(super) fn band(
    points: impl Iterator<Item = (f64, f64)>,
    end: f64,
    count: usize,
) -> Vec<(f64, f64, f64)> {
    let columns = columns(points, (0.0, end), COLUMNS.min(count / 2).max(1));
    let full = columns.iter().filter(|column| column.count > 0.0);
    full.map(|column| (column.mean().0, column.low, column.high))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_long_series_keeps_its_peaks_in_a_bounded_number_of_points() {
        let y = |x: f64| if x == 123_456.0 { 7.0 } else { x.sin() };
        let points = (0..200_000).map(f64::from).map(|x| (x, y(x)));
        let band = band(points, 199_999.0, 200_000);
        assert_eq!(band.len(), COLUMNS);
        let peak = band.iter().find(|(.., high)| *high == 7.0);
        assert!((peak.expect("the peak").0 - 123_456.0).abs() < 360.0);
        assert!(band.is_sorted_by(|a, b| a.0 < b.0));
    }

    #[test]
    fn columns_hold_mean_and_deviation_worked_by_hand() {
        let points = [(0.1, 1.0), (0.3, 3.0), (1.0, 5.0)];
        let columns = columns(points.into_iter(), (0.0, 1.0), 2);
        let figures = |c: &Column| (c.mean(), c.deviation(), c.low, c.high);
        let figures: Vec<_> = columns.iter().map(figures).collect();
        assert_eq!(
            figures,
            [((0.2, 2.0), 1.0, 1.0, 3.0), ((1.0, 5.0), 0.0, 5.0, 5.0)]
        );
    }
}
