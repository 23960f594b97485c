//! Convergence and course of p: every generation as CSV, medians over the seeds as SVG.

use super::summary::Spread;
use super::{ARRIVED, Case, EXACT, Run};
use crate::report::plots::{DrawResult, PlotError, as_svg};
use crate::solve::search::kind::SearchKind;
use plotters::coord::Shift;
use plotters::prelude::*;
use std::fmt::Write;

/// Points of a plotted curve.
const POINTS: usize = 160;
/// Size of a plot in pixels.
const SIZE: (u32, u32) = (900, 520);

/// Every run in one line: `form,solver,seed,fitness,floor,evaluations,nan_costs,elapsed_s,
/// evaluations_to_1_percent,evaluations_to_floor,x_rms_um,y_rms_um,rz_rms_urad`; empty where there is none.
pub fn runs_csv(runs: &[Run]) -> String {
    let mut text = String::from(
        "form,solver,seed,fitness,floor,evaluations,nan_costs,elapsed_s,\
         evaluations_to_1_percent,evaluations_to_floor,x_rms_um,y_rms_um,rz_rms_urad\n",
    );
    for run in runs {
        let [arrived, exact] = [ARRIVED, EXACT].map(|share| {
            let evaluations = run.evaluations_to(share);
            evaluations.map_or(String::new(), |n| n.to_string())
        });
        let rms = run.rms.map_or([(); 3].map(|()| String::new()), |rms| {
            rms.map(|x| x.to_string())
        });
        // Writing to a string cannot fail.
        let _ = writeln!(
            text,
            "{},{},{},{},{},{},{},{:.6},{arrived},{exact},{}",
            run.form.name(),
            run.solver,
            run.seed,
            run.fitness,
            run.floor,
            run.evaluations,
            run.nan_costs,
            run.elapsed_s,
            rms.join(","),
        );
    }
    text
}

/// Every generation of every search in one line: `form,solver,seed,evaluations,fitness,p`.
pub fn history_csv(runs: &[Run]) -> String {
    let mut text = String::from("form,solver,seed,evaluations,fitness,p\n");
    for run in runs {
        for point in &run.history {
            let p = point.p.map_or(String::new(), |p| p.to_string());
            // Writing to a string cannot fail.
            let _ = writeln!(
                text,
                "{},{},{},{},{},{p}",
                run.form.name(),
                run.solver,
                run.seed,
                point.evaluations,
                point.best_cost
            );
        }
    }
    text
}

/// The value of the last checkpoint at or before a number of evaluations.
fn at(run: &Run, evaluations: f64, value: impl Fn(&Run, usize) -> Option<f64>) -> Option<f64> {
    let later = run
        .history
        .partition_point(|point| point.evaluations as f64 <= evaluations);
    value(run, later.checked_sub(1)?)
}

/// Medians over the seeds of one solver on a logarithmic grid of evaluations.
fn curve(
    runs: &[Run],
    grid: &[f64],
    value: impl Fn(&Run, usize) -> Option<f64> + Copy,
) -> Vec<(f64, f64)> {
    let point = |&evaluations: &f64| {
        let values = runs.iter().filter_map(|run| at(run, evaluations, value));
        let median = Spread::of(values)?.median;
        median.is_finite().then_some((evaluations, median))
    };
    grid.iter().filter_map(point).collect()
}

/// What is plotted over the evaluations.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Course {
    /// Best fitness over the floor.
    Convergence,
    /// p of the hybrids.
    P,
}

impl Course {
    fn value(self, run: &Run, generation: usize) -> Option<f64> {
        let point = run.history.get(generation)?;
        match self {
            Self::Convergence => Some(point.best_cost / run.floor),
            Self::P => point.p,
        }
    }
}

/// A plot of one form as SVG: the medians over the seeds, a line for each solver.
///
/// # Errors
/// [`PlotError`] when the drawing library refuses.
pub fn plot(runs: &[Run], form: Case, course: Course) -> Result<String, PlotError> {
    let title = match course {
        Course::Convergence => format!("best fitness over the floor, form {}", form.name()),
        Course::P => format!("p of the hybrids, form {}", form.name()),
    };
    as_svg(&title, |svg| draw(svg, &title, runs, form, course))
}

fn draw(svg: &mut String, title: &str, runs: &[Run], form: Case, course: Course) -> DrawResult {
    let most = runs.iter().map(|run| run.evaluations).max().unwrap_or(1);
    let least = runs
        .iter()
        .filter_map(|run| Some(run.history.first()?.evaluations))
        .min()
        .unwrap_or(1)
        .max(1) as f64;
    let step = (most as f64 / least)
        .max(1.0)
        .powf(1.0 / (POINTS - 1) as f64);
    let grid: Vec<f64> = (0..POINTS).map(|k| least * step.powi(k as i32)).collect();
    let same = |a: &Run, b: &Run| a.form == b.form && a.solver == b.solver;
    let curves: Vec<(&str, Vec<(f64, f64)>)> = runs
        .chunk_by(same)
        .filter(|runs| runs.iter().any(|run| run.form == form))
        .map(|runs| {
            let name = runs.first().map_or("", |run| run.solver);
            (name, curve(runs, &grid, |run, k| course.value(run, k)))
        })
        .filter(|(_, points)| !points.is_empty())
        .collect();
    let root = SVGBackend::with_string(svg, SIZE).into_drawing_area();
    root.fill(&WHITE)?;
    let x = (least..(most as f64).max(least * 2.0)).log_scale();
    match course {
        Course::Convergence => {
            let highest = curves
                .iter()
                .flat_map(|(_, points)| points.iter().map(|p| p.1))
                .fold(2.0, f64::max);
            // A floor of one would put the end of every good search on the edge.
            chart(
                &root,
                title,
                "fitness / floor",
                x,
                (0.9..highest).log_scale(),
                &curves,
            )?;
        }
        Course::P => chart(&root, title, "p", x, 0.0..1.0, &curves)?,
    }
    root.present()?;
    Ok(())
}

fn chart<X, Y>(
    root: &DrawingArea<SVGBackend<'_>, Shift>,
    title: &str,
    y_name: &str,
    x: X,
    y: Y,
    curves: &[(&str, Vec<(f64, f64)>)],
) -> DrawResult
where
    X: plotters::coord::ranged1d::AsRangedCoord<Value = f64>,
    Y: plotters::coord::ranged1d::AsRangedCoord<Value = f64>,
    X::CoordDescType: plotters::coord::ranged1d::ValueFormatter<f64>,
    Y::CoordDescType: plotters::coord::ranged1d::ValueFormatter<f64>,
{
    let mut chart = ChartBuilder::on(root)
        .caption(title, ("sans-serif", 18))
        .margin(8)
        .x_label_area_size(36)
        .y_label_area_size(64)
        .build_cartesian_2d(x, y)?;
    chart
        .configure_mesh()
        .light_line_style(TRANSPARENT)
        .x_desc("evaluations")
        .y_desc(y_name)
        .x_label_formatter(&|x| format!("{x:.0}"))
        .y_label_formatter(&|y| format!("{y:.1}"))
        .draw()?;
    for (name, points) in curves {
        // The same colour for a solver in every plot.
        let place = SearchKind::NAMES.iter().position(|other| other == name);
        let colour = Palette99::pick(place.unwrap_or(SearchKind::NAMES.len())).to_rgba();
        let style = colour.stroke_width(2);
        chart
            .draw_series(LineSeries::new(points.iter().copied(), style))?
            .label(*name)
            .legend(move |(x, y)| PathElement::new([(x, y), (x + 18, y)], style));
    }
    chart
        .configure_series_labels()
        .position(SeriesLabelPosition::LowerLeft)
        .background_style(WHITE.mix(0.8))
        .border_style(BLACK.mix(0.3))
        .draw()?;
    Ok(())
}
