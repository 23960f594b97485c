//! The report of a fit as one HTML file, written whether or not there is a calibration.

use super::before_after::{Errors, before_after};
use super::chart::Chart;
use super::figures::{Log, errors, fitting, residuals, signals};
use super::html::{PageError, STYLE, render};
use super::json::{Report, movement_zeros};
use super::provenance::Provenance;
use super::series::times;
use super::tables::{
    MOVEMENTS_MAX, MovementRow, ParameterRow, StageRow, movement_rows, parameter_rows, stage_rows,
};
use super::verdict::{End, Verdict};
use crate::diagnose::finding::Finding;
use crate::diagnose::signals::period_s;
use crate::fit::Fit;
use crate::input::dataset::Dataset;
use crate::input::stage::Stage;
use crate::judge::statistics::white_noise;
use serde::Serialize;

/// What a report is made of.
#[derive(Clone, Debug)]
pub struct Source<'a> {
    /// The stage.
    pub stage: &'a Stage,
    /// The rows.
    pub dataset: &'a Dataset,
    /// Where the figures come from.
    pub provenance: Provenance,
    /// What was found, the gravest first.
    pub findings: &'a [Finding],
    /// Warnings from reading the logs.
    pub warnings: &'a [String],
    /// The fit with its figures, if there is one.
    pub fit: Option<(&'a Fit, &'a Report)>,
    /// How the run ended.
    pub end: End<'a>,
}

/// One figure of the page.
#[derive(Clone, Debug, Serialize)]
struct Figure {
    caption: String,
    /// The drawing, which alone goes into the page without escaping.
    svg: String,
}

fn figures(charts: impl IntoIterator<Item = Chart>) -> Result<Vec<Figure>, PageError> {
    let figure = |chart: Chart| {
        Ok(Figure {
            svg: chart.svg()?,
            caption: chart.caption,
        })
    };
    charts.into_iter().map(figure).collect()
}

/// What the template shows.
#[derive(Clone, Debug, Serialize)]
struct Page<'a> {
    style: &'static str,
    provenance: &'a Provenance,
    verdict: Verdict,
    findings: &'a [Finding],
    /// Those that are no finding.
    warnings: &'a [String],
    report: Option<&'a Report>,
    /// Name of the model, and how zero deviations were treated.
    model: &'a str,
    zeros_in_words: &'static str,
    signals: Vec<Figure>,
    stages: Vec<StageRow>,
    /// Noise of X, Y (um), Rz (urad) from row to row.
    noise: Option<[f64; 3]>,
    before_after: Vec<Figure>,
    movements: Vec<MovementRow<'a>>,
    /// Whether the model has zero deviations.
    has_zeros: bool,
    movements_max: usize,
    by_movement: Vec<Figure>,
    residuals: Vec<Figure>,
    search: Vec<Figure>,
    parameters: Vec<ParameterRow>,
}

impl Source<'_> {
    /// The page.
    ///
    /// # Errors
    /// [`PageError`] when it cannot be drawn.
    pub fn html(&self) -> Result<String, PageError> {
        let Self {
            stage,
            dataset,
            fit,
            ..
        } = self;
        let segments: Vec<_> = dataset.movements.iter().map(|m| m.rows.clone()).collect();
        let period_s = period_s(&dataset.rows, &segments, stage.servo_period_s);
        let log = Log {
            times_s: times(dataset, period_s),
            dataset,
            period_s,
        };
        let stages = before_after(dataset, stage, fit.map(|(fit, _)| fit));
        let last = fit.and(stages.last());
        let noise = last.map(|last| white_noise(&last.by_row, &dataset.movements));
        let report = fit.map(|(_, report)| report);
        let of_movements = last.map(|last| errors::of_movements(&log, last));
        let of_movements = of_movements.unwrap_or_default();
        let zeros = fit.map_or_else(Vec::new, |(fit, _)| {
            movement_zeros(dataset, &dataset.movements, &fit.judgement.zeros)
        });
        let has_zeros = report.is_some_and(|report| report.delta == "fit");
        let range = stage.search.delta_m;
        let by_movement = last.map(|_| errors::by_movement(&of_movements));
        let by_movement = by_movement
            .into_iter()
            .chain(has_zeros.then(|| fitting::zero_deviations(&zeros, [range.low, range.high])));
        let page = Page {
            style: STYLE,
            provenance: &self.provenance,
            verdict: Verdict::new(self.end, self.findings, report.zip(noise)),
            findings: self.findings,
            warnings: self.warnings,
            report,
            model: report.map_or("", |report| &report.model_title),
            zeros_in_words: report.map_or("", |report| report.zeros_in_words),
            signals: figures(signals::charts(&log))?,
            stages: stage_rows(&stages),
            noise: noise.map(|noise| noise.map(|noise| noise * 1e6)),
            before_after: figures(over_time(&log, &stages, noise))?,
            movements: movement_rows(dataset, &of_movements, &zeros),
            has_zeros,
            movements_max: MOVEMENTS_MAX,
            by_movement: figures(by_movement)?,
            residuals: figures(last.zip(noise).into_iter().flat_map(|(last, noise)| {
                let against = residuals::against(&log, last, noise);
                let spectrum = residuals::spectrum(&log, last, noise);
                against
                    .into_iter()
                    .chain(spectrum)
                    .chain([errors::distribution(last)])
            }))?,
            search: figures(fit.and_then(|(fit, _)| fitting::search(&fit.solution.history)))?,
            parameters: report.map_or_else(Vec::new, |report| parameter_rows(report, stage)),
        };
        Ok(render("report.html", include_str!("report.html"), &page)?)
    }
}

/// The errors over time of every stage, with the noise behind those of the fit.
fn over_time(log: &Log, stages: &[Errors], noise: Option<[f64; 3]>) -> Vec<Chart> {
    let last = stages.len().saturating_sub(1);
    let chart = |(k, stage)| errors::over_time(log, stage, noise.filter(|_| k == last));
    stages.iter().enumerate().map(chart).collect()
}

#[cfg(test)]
#[path = "page_tests.rs"]
mod tests;
