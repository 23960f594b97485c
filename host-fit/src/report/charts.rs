//! The charts of a report: the errors over time, against pose, signals and temperatures.

use super::axis::Axis;
use super::chart::{Chart, Mark, Tone};
use super::errors::RowErrors;
use super::series::{Column, band, columns};
use hallstage_input::dataset::{Dataset, Row};
use runtime::frame::MISSING_CODE;

/// Half the width of the band of the noise, standard deviations.
const BAND: f64 = 2.0;
/// With more movements their borders would merge.
const MOVEMENTS_SHOWN: usize = 150;
/// Intervals of a quantity that errors are shown against.
const BINS: usize = 40;

/// A quantity of a row in um or urad, and its name.
type Quantity = (&'static str, fn(&Row) -> f64);

fn celsius(row: &Row, sensor: usize) -> f64 {
    match row.frame.temperature_mc()[sensor] {
        MISSING_CODE => f64::NAN,
        read_mc => f64::from(read_mc) * 1e-3,
    }
}

/// What errors are shown against, where the log moves it: pose, signals, temperatures.
const QUANTITIES: [Quantity; 11] = [
    ("X, µm", |row| row.reference[0] * 1e6),
    ("Y, µm", |row| row.reference[1] * 1e6),
    ("Rz, µrad", |row| row.reference[2] * 1e6),
    ("signal A, µm", |row| row.signal_m[0] * 1e6),
    ("signal B, µm", |row| row.signal_m[1] * 1e6),
    ("signal C, µm", |row| row.signal_m[2] * 1e6),
    ("Z, µm", |row| row.vertical[0] * 1e6),
    ("Rx, µrad", |row| row.vertical[1] * 1e6),
    ("Ry, µrad", |row| row.vertical[2] * 1e6),
    ("mount, °C", |row| celsius(row, 0)),
    ("body, °C", |row| celsius(row, 1)),
];

/// The planar axes, as charts name them.
pub(super) const PLANAR: [&str; 3] = [QUANTITIES[0].0, QUANTITIES[1].0, QUANTITIES[2].0];

/// A log, and what is shown of it over time: row after row, without the gaps between them.
pub(super) struct PlottedLog<'a> {
    pub(super) dataset: &'a Dataset,
    /// Time between rows, s.
    pub(super) period_s: f64,
}

impl PlottedLog<'_> {
    /// Where movements begin, unless their borders would merge.
    fn borders(&self) -> Mark {
        let starts = self.dataset.movements.iter().skip(1).map(|m| m.rows.start);
        let starts = starts.map(|row| row as f64 * self.period_s);
        let few = self.dataset.movements.len() <= MOVEMENTS_SHOWN;
        Mark::Borders(Tone::Grid, starts.filter(|_| few).collect())
    }

    /// Errors over time (m, m, rad) on one scale, those before behind those after.
    pub(super) fn errors(
        &self,
        caption: &str,
        after: &RowErrors,
        before: Option<&RowErrors>,
    ) -> Chart {
        let rows = self.dataset.rows.len();
        let end_s = rows.max(1) as f64 * self.period_s;
        let panel = |axis: usize| {
            let series = |(tone, errors): (Tone, &RowErrors)| {
                let errors = errors.iter().enumerate();
                let values = errors.filter_map(|(row, error)| {
                    Some((row as f64 * self.period_s, error.as_ref()?[axis] * 1e6))
                });
                Mark::Band(tone, band(values, end_s, rows))
            };
            let all = before.map(|before| (Tone::Noise, before)).into_iter();
            let all = all.chain([(Tone::Data, after)]).map(series);
            (
                PLANAR[axis],
                std::iter::once(self.borders()).chain(all).collect(),
            )
        };
        Chart::new(caption, ("time of the rows, s", Axis(0.0, end_s)), panel)
    }

    /// Mean of the errors and two of their standard deviations about it against pose, signals and temperatures, beside
    /// the band of the noise (m, m, rad); one chart for each quantity that the log moves.
    pub(super) fn against(&self, errors: &RowErrors, noise: [f64; 3]) -> Vec<Chart> {
        let chart = |&(name, of): &Quantity| {
            let values = || self.dataset.rows.iter().map(of);
            let low = values().fold(f64::INFINITY, f64::min);
            let high = values().fold(f64::NEG_INFINITY, f64::max);
            let panel = |axis: usize| {
                let points = values().zip(errors);
                let points = points.filter(|(x, _)| x.is_finite());
                let points = points.filter_map(|(x, error)| Some((x, error.as_ref()?[axis] * 1e6)));
                let mut columns = columns(points, (low, high), BINS);
                let least = errors.len() as f64 / (50.0 * BINS as f64);
                columns.retain(|column| column.count > 0.0 && column.count >= least);
                let spread = |column: &Column| {
                    let ((x, mean), half) = (column.mean(), BAND * column.deviation());
                    (x, mean - half, mean + half)
                };
                let noise_end = |side: f64| {
                    let end = side * BAND * noise[axis] * 1e6;
                    Mark::Line(Tone::Second, vec![(low, end), (high, end)])
                };
                let marks = vec![
                    Mark::Band(Tone::Data, columns.iter().map(spread).collect()),
                    Mark::Line(Tone::Data, columns.iter().map(Column::mean).collect()),
                    noise_end(-1.0),
                    noise_end(1.0),
                ];
                (PLANAR[axis], marks)
            };
            let caption = format!("Errors against {}", name.split(',').next().unwrap_or(name));
            (high > low).then(|| Chart::new(caption, (name, Axis(low, high)), panel))
        };
        QUANTITIES.iter().filter_map(chart).collect()
    }
}
