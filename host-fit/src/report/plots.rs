//! Plots of a calibration as SVG.

use crate::input::dataset::Dataset;
use plotters::prelude::*;

/// Why a plot could not be drawn.
#[derive(Debug, thiserror::Error)]
#[error("cannot draw the plot {title}: {cause}")]
pub struct PlotError {
    /// Its title.
    pub title: String,
    /// What the drawing library says.
    pub cause: String,
}

/// Columns of pixels into which rows are gathered.
const COLUMNS: usize = 1000;
const NAMES: [&str; 3] = ["X error, um", "Y error, um", "Rz error, urad"];

/// Pose errors over the rows of a dataset (m, m, rad; `None` where there was no pose), as bands
/// from the smallest to the largest error of neighbouring rows, with a line at each movement.
///
/// # Errors
/// [`PlotError`] when the drawing library refuses.
pub fn errors_over_rows(
    title: &str,
    errors: &[Option<[f64; 3]>],
    dataset: &Dataset,
) -> Result<String, PlotError> {
    as_svg(title, |svg| draw_errors(svg, title, errors, dataset))
}

/// What drawing gives: the library has an error type for each backend.
pub(crate) type DrawResult = Result<(), Box<dyn std::error::Error>>;

/// The SVG that `draw` writes.
pub(crate) fn as_svg(
    title: &str,
    draw: impl FnOnce(&mut String) -> DrawResult,
) -> Result<String, PlotError> {
    let mut svg = String::new();
    draw(&mut svg).map_err(|cause| PlotError {
        title: title.to_owned(),
        cause: cause.to_string(),
    })?;
    Ok(svg)
}

fn draw_errors(
    svg: &mut String,
    title: &str,
    errors: &[Option<[f64; 3]>],
    dataset: &Dataset,
) -> DrawResult {
    let root = SVGBackend::with_string(svg, (1000, 640)).into_drawing_area();
    root.fill(&WHITE)?;
    let root = root.titled(title, ("sans-serif", 18))?;
    for (axis, panel) in root.split_evenly((3, 1)).iter().enumerate() {
        let bands = bands(errors, axis);
        let largest = bands
            .iter()
            .flat_map(|(_, low, high)| [low.abs(), high.abs()])
            .fold(1e-3, f64::max);
        let mut chart = ChartBuilder::on(panel)
            .margin(6)
            .x_label_area_size(24)
            .y_label_area_size(60)
            .build_cartesian_2d(0..errors.len().max(1), -largest * 1.08..largest * 1.08)?;
        chart
            .configure_mesh()
            .light_line_style(TRANSPARENT)
            .x_desc(if axis == 2 { "row" } else { "" })
            .y_desc(NAMES[axis])
            .y_labels(5)
            .draw()?;
        for movement in &dataset.movements {
            let x = movement.rows.start;
            let ends = [(x, -largest * 1.08), (x, largest * 1.08)];
            chart.draw_series(std::iter::once(PathElement::new(ends, BLACK.mix(0.08))))?;
        }
        let bars = bands
            .iter()
            .map(|&(x, low, high)| PathElement::new([(x, low), (x, high)], RGBColor(20, 90, 160)));
        chart.draw_series(bars)?;
    }
    root.present()?;
    Ok(())
}

/// (row, smallest, largest) of each column, in um or urad.
fn bands(errors: &[Option<[f64; 3]>], axis: usize) -> Vec<(usize, f64, f64)> {
    let width = errors.len().div_ceil(COLUMNS).max(1);
    let mut bands = Vec::with_capacity(COLUMNS);
    for (column, chunk) in errors.chunks(width).enumerate() {
        let values = chunk.iter().flatten().map(|error| error[axis] * 1e6);
        let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| {
            (low.min(x), high.max(x))
        });
        if low <= high {
            bands.push((column * width, low, high));
        }
    }
    bands
}

/// How errors of X, Y, Rz are distributed, each in units of its own rms, beside the bell curve.
///
/// # Errors
/// [`PlotError`] when the drawing library refuses.
pub fn distribution(title: &str, errors: &[Option<[f64; 3]>]) -> Result<String, PlotError> {
    as_svg(title, |svg| draw_distribution(svg, title, errors))
}

fn draw_distribution(svg: &mut String, title: &str, errors: &[Option<[f64; 3]>]) -> DrawResult {
    const BIN: f64 = 0.2;
    const REACH: f64 = 5.0;
    let root = SVGBackend::with_string(svg, (1000, 320)).into_drawing_area();
    root.fill(&WHITE)?;
    let mut chart = ChartBuilder::on(&root)
        .caption(title, ("sans-serif", 18))
        .margin(6)
        .x_label_area_size(32)
        .y_label_area_size(60)
        .build_cartesian_2d(-REACH..REACH, 0.0..0.5)?;
    chart
        .configure_mesh()
        .light_line_style(TRANSPARENT)
        .x_desc("error / rms")
        .y_desc("density")
        .draw()?;
    let grid = || (-50..=50).map(|k| f64::from(k) * 0.1);
    let bell = grid().map(|x| (x, (-0.5 * x * x).exp() / std::f64::consts::TAU.sqrt()));
    chart
        .draw_series(LineSeries::new(bell, BLACK.mix(0.4)))?
        .label("normal")
        .legend(|(x, y)| PathElement::new([(x, y), (x + 18, y)], BLACK.mix(0.4)));
    let colours = [
        RGBColor(20, 90, 160),
        RGBColor(190, 80, 20),
        RGBColor(30, 130, 60),
    ];
    for (axis, (colour, name)) in colours.into_iter().zip(["X", "Y", "Rz"]).enumerate() {
        let values: Vec<f64> = errors.iter().flatten().map(|error| error[axis]).collect();
        let n = values.len().max(1) as f64;
        let rms = (values.iter().map(|x| x * x).sum::<f64>() / n).sqrt();
        let mut counts = vec![0u32; (2.0 * REACH / BIN) as usize];
        for x in values {
            let bin = ((x / rms + REACH) / BIN).floor();
            if let Some(count) = counts.get_mut(bin as usize) {
                *count += u32::from(bin >= 0.0);
            }
        }
        let points = counts.iter().enumerate().map(|(bin, &count)| {
            let x = (bin as f64 + 0.5) * BIN - REACH;
            (x, f64::from(count) / (n * BIN))
        });
        chart
            .draw_series(LineSeries::new(points, colour))?
            .label(name)
            .legend(move |(x, y)| PathElement::new([(x, y), (x + 18, y)], colour));
    }
    chart
        .configure_series_labels()
        .border_style(BLACK.mix(0.3))
        .draw()?;
    root.present()?;
    Ok(())
}
