//! The page of a planned run: its figures, the trajectory, and the errors along it.

use super::html::render;
use super::plan::{LABELS, PlanReport};
use super::plots::{DrawResult, PlotError, as_svg};
use crate::plan::Plan;
use minijinja::Error;
use plotters::prelude::*;
use serde::Serialize;

/// Points of a line of the trajectory.
const POINTS: usize = 2000;
/// Poses at which errors are looked at.
const POSES: usize = 400;

/// What the page shows.
#[derive(Clone, Debug, Serialize)]
pub struct PlanPage<'a> {
    /// The figures.
    pub report: &'a PlanReport,
    /// Label, error, floor and ratio of the planar axes.
    pub service: [(&'static str, f64, f64, f64); 3],
    /// Plot of the six axes over time.
    pub trajectory: String,
    /// Plot of the errors that the parameters leave, over time.
    pub errors: String,
}

impl<'a> PlanPage<'a> {
    /// The page of a plan.
    ///
    /// # Errors
    /// [`PlotError`] when the drawing library refuses.
    pub fn new(report: &'a PlanReport, plan: &Plan) -> Result<Self, PlotError> {
        let run = &plan.run;
        let times = |count: usize| (0..=count).map(move |k| run.seconds * k as f64 / count as f64);
        let axis = |k: usize| {
            let points = times(POINTS).map(|t| (t, run.axis_at(k, t)[0] * 1e6));
            (LABELS[k], points.collect())
        };
        let six: [Line; 6] = std::array::from_fn(axis);
        let errors: Vec<(f64, [f64; 3])> = times(POSES)
            .filter_map(|t| {
                let pose = run.pose_at(t);
                let expected = plan
                    .forecast
                    .posterior
                    .at_pose(pose.planar, pose.vertical)?;
                Some((
                    t,
                    [0, 1, 2].map(|k| expected.systematic[(k, k)].sqrt() * 1e6),
                ))
            })
            .collect();
        let of_axis = |k: usize| (LABELS[k], errors.iter().map(|(t, e)| (*t, e[k])).collect());
        let three: [Line; 3] = std::array::from_fn(of_axis);
        Ok(Self {
            report,
            service: report.service_rows(),
            trajectory: stacked("the run", &six, true)?,
            errors: stacked(
                "standard deviation of what the parameters add, along the run",
                &three,
                false,
            )?,
        })
    }

    /// The page as HTML.
    ///
    /// # Errors
    /// [`Error`] when the template names something that is not there.
    pub fn to_html(&self) -> Result<String, Error> {
        render("plan.html", include_str!("plan.html"), self)
    }
}

/// A label, and values over time in s.
type Line = (&'static str, Vec<(f64, f64)>);

/// Lines below each other over the same time; `signed` ones about zero, others from zero up.
fn stacked(title: &str, lines: &[Line], signed: bool) -> Result<String, PlotError> {
    as_svg(title, |svg| draw(svg, title, lines, signed))
}

fn draw(svg: &mut String, title: &str, lines: &[Line], signed: bool) -> DrawResult {
    let height = 60 + 110 * lines.len() as u32;
    let root = SVGBackend::with_string(svg, (1000, height)).into_drawing_area();
    root.fill(&WHITE)?;
    let root = root.titled(title, ("sans-serif", 18))?;
    for (k, panel) in root.split_evenly((lines.len(), 1)).iter().enumerate() {
        let (label, points) = &lines[k];
        let end_s = points.last().map_or(1.0, |(t, _)| *t);
        let largest = points
            .iter()
            .map(|(_, value)| value.abs())
            .fold(1e-3, f64::max)
            * 1.08;
        let last = k + 1 == lines.len();
        let mut chart = ChartBuilder::on(panel)
            .margin(6)
            .margin_right(20)
            .x_label_area_size(if last { 32 } else { 8 })
            .y_label_area_size(60)
            .build_cartesian_2d(0.0..end_s, if signed { -largest } else { 0.0 }..largest)?;
        chart
            .configure_mesh()
            .light_line_style(TRANSPARENT)
            .x_labels(if last { 11 } else { 0 })
            .x_desc(if last { "time, s" } else { "" })
            .y_desc(*label)
            .y_labels(3)
            .label_style(("sans-serif", 12))
            .axis_desc_style(("sans-serif", 13))
            .draw()?;
        let points = points.iter().copied();
        chart.draw_series(LineSeries::new(points, RGBColor(20, 90, 160)))?;
    }
    root.present()?;
    Ok(())
}
