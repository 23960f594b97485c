//! The page of a planned run: its figures, the trajectory, and the errors along it.

use super::axis::Axis;
use super::chart::{Chart, Mark, Panel, Scale, Tone};
use super::html::{PageError, STYLE, render};
use super::plan::{LABELS, PlanReport};
use super::plots::PlotError;
use crate::plan::Plan;
use crate::problem::terms::shown;
use serde::Serialize;

/// Points of a line of the trajectory.
const POINTS: usize = 1000;
/// Poses at which errors are looked at.
const POSES: usize = 400;

/// What the page shows.
#[derive(Clone, Debug, Serialize)]
pub struct PlanPage<'a> {
    style: &'static str,
    /// The figures.
    pub report: &'a PlanReport,
    /// Label, error, floor and ratio of the planar axes.
    pub service: [(&'static str, f64, f64, f64); 3],
    /// Name of each parameter, its standard error with the unit, and the part of its prior.
    pub parameters: Vec<(&'a str, f64, &'static str, Option<f64>)>,
    /// Plots of the axes over time, three by three.
    pub trajectory: [String; 2],
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
        let svg = |caption: &str, scale, lines: [Line; 3]| {
            let panel = |(label, points): Line| Panel {
                label: label.to_owned(),
                scale,
                marks: vec![Mark::Line(Tone::Data, points)],
            };
            Chart {
                caption: caption.to_owned(),
                x_label: "time, s".to_owned(),
                x: Axis::Linear(0.0, run.seconds),
                panels: lines.map(panel).into(),
            }
            .svg()
        };
        let parameters = report.parameters.iter().map(|(name, parameter)| {
            let (error, unit) = shown(parameter.standard_error, parameter.unit);
            (name.as_str(), error, unit, parameter.of_prior)
        });
        Ok(Self {
            parameters: parameters.collect(),
            style: STYLE,
            report,
            service: report.service_rows(),
            trajectory: [
                svg("the run", Scale::Symmetric, [0, 1, 2].map(axis))?,
                svg("the run", Scale::Symmetric, [3, 4, 5].map(axis))?,
            ],
            errors: svg("errors", Scale::FromZero, [0, 1, 2].map(of_axis))?,
        })
    }

    /// The page as HTML.
    ///
    /// # Errors
    /// [`PageError::Template`] when the template names something that is not there.
    pub fn to_html(&self) -> Result<String, PageError> {
        Ok(render("plan.html", include_str!("plan.html"), self)?)
    }
}

/// A label, and values over time in s.
type Line = (&'static str, Vec<(f64, f64)>);
