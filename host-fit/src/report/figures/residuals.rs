//! What the fit leaves, against everything that it may depend on, and its spectrum.

use super::{BAND, Log, PLANAR, noise_band};
use crate::diagnose::signals::{Spectrum, windows};
use crate::input::dataset::Row;
use crate::report::axis::Axis;
use crate::report::before_after::Errors;
use crate::report::chart::{Chart, Mark, Panel, Scale, Tone};
use crate::report::series::{Bin, bins};
use std::ops::Range;

/// Intervals of an abscissa.
const BINS: usize = 40;
/// Longest and shortest window of the spectrum, rows.
const WINDOW_MAX: usize = 4096;
const WINDOW_MIN: usize = 32;
/// Points of a spectrum, evenly over its logarithm.
const POINTS: f64 = 250.0;

/// A quantity of a row in um or urad, and its name.
type Quantity = (&'static str, fn(&Row) -> f64);

const QUANTITIES: [Quantity; 9] = [
    ("X, um", |row| row.reference[0] * 1e6),
    ("Y, um", |row| row.reference[1] * 1e6),
    ("Rz, urad", |row| row.reference[2] * 1e6),
    ("Z, um", |row| row.vertical[0] * 1e6),
    ("Rx, urad", |row| row.vertical[1] * 1e6),
    ("Ry, urad", |row| row.vertical[2] * 1e6),
    ("signal A, um", |row| row.signal_m[0] * 1e6),
    ("signal B, um", |row| row.signal_m[1] * 1e6),
    ("signal C, um", |row| row.signal_m[2] * 1e6),
];

/// Mean and standard deviation of the errors against the pose and the signals, beside the band of the
/// noise; one chart for each quantity that the log moves.
pub(in crate::report) fn against(log: &Log, errors: &Errors, noise: [f64; 3]) -> Vec<Chart> {
    let chart = |&(name, of): &Quantity| {
        let values = || log.dataset.rows.iter().map(of);
        let low = values().fold(f64::INFINITY, f64::min);
        let high = values().fold(f64::NEG_INFINITY, f64::max);
        let panel = |axis: usize| {
            let errors = errors
                .by_row
                .iter()
                .map(|error| Some(error.as_ref()?[axis] * 1e6));
            let points = values()
                .zip(errors)
                .filter_map(|(x, error)| Some((x, error?)));
            let bins = bins(points, (low, high), BINS);
            let marks = vec![
                Mark::Band(Tone::Data, bins.iter().map(spread).collect()),
                Mark::Line(Tone::Data, bins.iter().map(Bin::mean).collect()),
                Mark::Dots(Tone::Data, bins.iter().map(Bin::mean).collect()),
            ];
            let band = noise_band((low, high), noise[axis]);
            Panel {
                label: PLANAR[axis].to_owned(),
                scale: Scale::Symmetric,
                marks: marks.into_iter().chain(band).collect(),
            }
        };
        (high > low).then(|| Chart {
            caption: format!("Errors against {}", name.split(',').next().unwrap_or(name)),
            x_label: name.to_owned(),
            x: Axis::Linear(low, high),
            panels: [0, 1, 2].map(panel).into(),
        })
    };
    QUANTITIES.iter().filter_map(chart).collect()
}

/// Mean less and plus as many deviations as the band of the noise has.
fn spread(bin: &Bin) -> (f64, f64, f64) {
    let ((x, mean), half) = (bin.mean(), BAND * bin.deviation());
    (x, mean - half, mean + half)
}

/// Amplitude spectral density of the errors beside that of white noise; `None` where no movement is
/// long enough.
pub(in crate::report) fn spectrum(log: &Log, errors: &Errors, noise: [f64; 3]) -> Option<Chart> {
    let movements: Vec<Range<usize>> = (log.dataset.movements.iter())
        .map(|movement| movement.rows.clone())
        .collect();
    let longest = movements.iter().map(ExactSizeIterator::len).max()?;
    let length = (1usize << longest.checked_ilog2()?).min(WINDOW_MAX);
    if length < WINDOW_MIN {
        return None;
    }
    let lowest_hz = 1.0 / (length as f64 * log.period_s);
    let highest_hz = 0.5 / log.period_s;
    let panel = |axis: usize| {
        let values: Vec<f64> = (errors.by_row.iter())
            .map(|error| error.map_or(0.0, |error| error[axis] * 1e6))
            .collect();
        let spectrum = Spectrum::new(&values, &windows(&movements, length));
        // One side of the spectrum; the sum of squares of the taper is 3/8 of its length.
        let density = |power: f64| (2.0 * power * log.period_s / (0.375 * length as f64)).sqrt();
        let white = noise[axis] * 1e6 * (2.0 * log.period_s).sqrt();
        let white = vec![(lowest_hz, white), (highest_hz, white)];
        let bins = spectrum.power.iter().enumerate().skip(1);
        let bins = bins.map(|(bin, &power)| (bin as f64 * lowest_hz, density(power)));
        Panel {
            label: format!("{}/rtHz", PLANAR[axis]),
            scale: Scale::Logarithmic,
            marks: vec![
                Mark::Line(Tone::Noise, white),
                Mark::Line(Tone::Data, thinned(bins)),
            ],
        }
    };
    Some(Chart {
        caption: "Amplitude spectral density of the errors, and that of white noise".to_owned(),
        x_label: "frequency, Hz".to_owned(),
        x: Axis::Logarithmic(lowest_hz, highest_hz),
        panels: [0, 1, 2].map(panel).into(),
    })
}

/// The root mean square of the points that stand together on a logarithmic axis, at their middle.
fn thinned(points: impl Iterator<Item = (f64, f64)>) -> Vec<(f64, f64)> {
    let mut groups: Vec<(f64, f64, f64)> = Vec::new();
    let place = |x: f64| (x.log10() * POINTS / 4.0).floor();
    for (x, y) in points {
        match groups.last_mut() {
            Some((sum, squares, count)) if place(*sum / *count) == place(x) => {
                *sum += x;
                *squares += y * y;
                *count += 1.0;
            }
            _ => groups.push((x, y * y, 1.0)),
        }
    }
    let mean = |(sum, squares, count): (f64, f64, f64)| (sum / count, (squares / count).sqrt());
    groups.into_iter().map(mean).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_thinned_spectrum_keeps_its_level_and_shows_its_lines() {
        let points =
            |line: f64| (1..4096).map(move |k| (f64::from(k), if k == 3000 { line } else { 1.0 }));
        let flat = thinned(points(1.0));
        assert!(flat.len() < POINTS as usize && flat.iter().all(|(_, y)| (y - 1.0).abs() < 1e-12));
        let line = thinned(points(90.0));
        let (x, y) = line
            .into_iter()
            .max_by(|a, b| a.1.total_cmp(&b.1))
            .expect("points");
        assert!((x - 3000.0).abs() < 30.0 && y > 5.0, "{x} {y}");
    }
}
