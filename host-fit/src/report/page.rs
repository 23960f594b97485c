//! The report of logs and what was made of them as one HTML page, written whether or not there is a
//! calibration: a certificate first, then what it rests on.

use super::errors::{RowErrors, designed, error_table, micro};
use super::figures::Log;
use super::html::{Cause, Page, Section};
use super::json::{MovementZero, Report};
use super::parameters::{self, Parameter};
use super::provenance::Provenance;
use super::table::{self, Table};
use super::verdict::{Subject, Summary};
use hallstage_calibration::fit::Fit;
use hallstage_calibration::judge::predicted::Validity;
use hallstage_calibration::judge::statistics::{PoseError, white_noise};
use hallstage_input::dataset::Dataset;
use hallstage_input::stage::Stage;
use hallstage_solver::problem::model::Model;
use minijinja::Error;
use runtime::{ModelKind, ParameterSet};
use std::collections::BTreeMap;

/// Movements that the page lists.
const MOVEMENTS_MAX: usize = 1000;

const PAPER: &str = "The figures that the paper has, of this log: Fig. 9 (displacements and Hall signals) and Figs 10 to 12 \
     (errors with the designed values and after calibration) of Z. Chen et al., \"Calibration of the Hall Measurement System \
     for a 6-DOF Precision Stage Using Self-Adaptive Hybrid TLBO\", Sensors 2016.";

/// What a report is made of.
#[derive(Clone, Debug)]
pub struct Source<'a> {
    /// Title of the page.
    pub title: &'static str,
    /// What was judged, and how it ended.
    pub subject: Subject<'a>,
    /// What a person says of the run: name and text.
    pub facts: Vec<[String; 2]>,
    /// The stage.
    pub stage: &'a Stage,
    /// The rows.
    pub dataset: &'a Dataset,
    /// Where the figures come from.
    pub provenance: Provenance,
    /// Warnings from reading the logs.
    pub warnings: Vec<String>,
    /// The errors, if there is a fit or a blob.
    pub errors: Option<Errors<'a>>,
}

/// The errors of a fit, or of a blob.
#[derive(Clone, Debug)]
pub struct Errors<'a> {
    /// The blob.
    pub set: &'a ParameterSet,
    /// By row of the dataset, zero deviations taken off.
    pub by_row: RowErrors,
    /// Over these.
    pub figures: &'a PoseError,
    /// The movements of the logs.
    pub movements: &'a [MovementZero],
    /// The parameters by name.
    pub parameters: &'a BTreeMap<String, Parameter>,
    /// More figures.
    pub details: Vec<Table>,
}

impl<'a> Errors<'a> {
    /// Of a fit to a dataset.
    pub fn of_fit(fit: &'a Fit, dataset: &Dataset, report: &'a Report) -> Self {
        let judgement = &fit.judgement;
        Self {
            set: &fit.set,
            by_row: fit.decoded.errors_less(&judgement.zeros, dataset),
            figures: &judgement.errors,
            movements: &report.zero_deviations,
            parameters: &report.parameters,
            details: report.details(&["errors"]),
        }
    }
}

/// What a person says of a run, in the order of a certificate.
pub fn facts(
    serial: &str,
    operator: Option<&str>,
    created: Option<&str>,
    notes: &[(String, String)],
) -> Vec<[String; 2]> {
    let date = match created {
        None | Some("") => "not given; name it with --created",
        Some(date) => date,
    };
    let serial = if serial.is_empty() {
        "without serial number"
    } else {
        serial
    };
    let operator = operator.map(|name| ("operator", name));
    let notes = notes.iter().map(|(key, value)| (&**key, &**value));
    let facts = [("stage", serial)].into_iter().chain(operator);
    let facts = facts.chain([("date", date)]).chain(notes);
    facts
        .map(|(key, value)| [key.to_owned(), value.to_owned()])
        .collect()
}

impl Source<'_> {
    /// The page.
    ///
    /// # Errors
    /// [`Error`] as in [`Page::html`].
    pub fn html(&self) -> Result<String, Error> {
        let (stage, dataset) = (self.stage, self.dataset);
        let log = Log {
            dataset,
            period_s: (dataset.period_s(0..dataset.rows.len())).unwrap_or(stage.servo_period_s),
        };
        let before = designed(dataset, stage);
        let mut sections = Vec::new();
        if let Some(errors) = &self.errors {
            sections.extend(self.of_errors(&log, errors, before.as_ref()));
        }
        sections.push(Section {
            title: "Provenance",
            tables: vec![self.provenance.0.clone()],
            ..Section::default()
        });
        let before =
            before.map(|(rows, _)| log.errors("Errors with the designed values", &rows, None));
        let after = self.errors.as_ref();
        let after =
            after.map(|errors| log.errors("Errors after calibration", &errors.by_row, None));
        sections.push(Section {
            title: "Appendix: figures of the paper",
            notes: vec![PAPER.to_owned()],
            charts: log
                .signals()
                .into_iter()
                .chain(before)
                .chain(after)
                .collect(),
            ..Section::default()
        });
        let page = Page {
            title: self.title,
            verdict: Summary::new(&self.subject),
            facts: self.facts(),
            causes: Cause::of(&self.subject.diagnosis.findings),
            warnings: &self.warnings,
            sections,
        };
        page.html()
    }

    /// What a certificate says besides the verdict: who, when, of what, and what it is valid for.
    fn facts(&self) -> Vec<[String; 2]> {
        let mut facts = self.facts.clone();
        let mut add = |name: &str, text: String| facts.push([name.to_owned(), text]);
        if let Some(Errors { set, .. }) = &self.errors {
            let c = &set.constants;
            let [x, y, rz] = c.calibrated_planar.map(|x| f64::from(x) * 1e6);
            let [z, rx, ry] = c.calibrated_vertical.map(|x| f64::from(x) * 1e6);
            add(
                "valid for",
                format!(
                    "X ±{x:.0} um, Y ±{y:.0} um, Rz ±{rz:.0} urad, Z ±{z:.0} um, Rx ±{rx:.0} urad, Ry ±{ry:.0} urad, {}",
                    match set.model {
                        ModelKind::Field => "all axes moving",
                        _ => "movements like those of the log",
                    }
                ),
            );
            add("model", Model::of(set.model).title());
        }
        add("temperature", self.temperature());
        add(
            "reference",
            "laser interferometers X, Y1, Y2, as logged".to_owned(),
        );
        let (rows, movements) = self.dataset.read();
        let logs = self
            .dataset
            .logs
            .iter()
            .map(|log| table::file_name(&log.path));
        let logs: Vec<String> = logs.collect();
        let movements = match movements {
            1 => "one movement".to_owned(),
            several => format!("{several} movements"),
        };
        add(
            "log",
            format!("{}: {rows} rows in {movements}", logs.join(", ")),
        );
        facts
    }

    /// Temperatures of the log, and how far from that of calibration the errors hold.
    fn temperature(&self) -> String {
        let all = 0..self.dataset.rows.len();
        let range = |sensor: usize| {
            let [low, high] = self.dataset.temperature_range_mc(sensor, all.clone())?;
            let [low, high] = [low, high].map(|mc| f64::from(mc) * 1e-3);
            Some(format!(
                "{} {low:.1} to {high:.1} degC",
                ["mount", "body"][sensor]
            ))
        };
        let mut parts: Vec<String> = (0..2).filter_map(range).collect();
        if parts.is_empty() {
            parts.push("not logged".to_owned());
        }
        if let Some(Validity { within_k, .. }) = self.subject.diagnosis.validity {
            parts.push(format!(
                "errors hold within {within_k:.1} K of that of calibration"
            ));
        }
        parts.join("; ")
    }

    /// What there is to show of errors.
    fn of_errors(
        &self,
        log: &Log,
        errors: &Errors,
        before: Option<&(RowErrors, PoseError)>,
    ) -> [Section; 5] {
        let noise = white_noise(&errors.by_row, &self.dataset.movements);
        let after = format!("after: {}", Model::of(errors.set.model).title());
        let rows = [
            before.map(|(_, errors)| ("before: designed values, Model (15)", micro(errors))),
            Some((after.as_str(), micro(errors.figures))),
            Some(("noise from row to row", noise.map(|x| [x * 1e6, f64::NAN]))),
        ];
        let before = before.map(|(rows, _)| rows);
        let of_log = Section {
            title: "Errors on the log",
            notes: vec![
                "Decoded by the code of the target; zero deviations refitted where the model has them.".to_owned(),
            ],
            tables: vec![error_table("", rows.into_iter().flatten())],
            charts: vec![
                log.errors("Before (grey) and after (blue), on one scale", &errors.by_row, before),
                log.errors("After, enlarged", &errors.by_row, None),
            ],
        };
        let mut against = log.against(&errors.by_row, noise);
        against.extend(log.spectrum(&errors.by_row, noise));
        let residuals = Section {
            title: "Errors against pose, signals and frequency",
            notes: vec![
                "Line: mean of the errors. Band: two of their standard deviations. Orange lines: two standard deviations of the \
                 noise from row to row. Where the mean leaves zero over a long way, the model lacks something."
                    .to_owned(),
            ],
            charts: against,
            ..Section::default()
        };
        let designed = [("designed", parameters::designed(self.stage))];
        let mut tables = parameters::tables(errors.parameters, &designed);
        for table in &mut tables {
            table.columns.push("meaning".to_owned());
            for row in &mut table.rows {
                row.push(parameters::meaning(&row[0]));
            }
        }
        let parameters = Section {
            title: "Parameters",
            notes: vec![
                "In brackets the standard error, in units of the last digits. u is the displacement along the line of a probe, w \
                 across it, z its height, in mm."
                    .to_owned(),
            ],
            tables,
            ..Section::default()
        };
        let mut movements = table::list("movements", errors.movements);
        movements.rows.truncate(MOVEMENTS_MAX);
        let movements = Section {
            title: "Movements",
            tables: vec![movements],
            ..Section::default()
        };
        let trust = Section {
            title: "More figures",
            tables: errors.details.clone(),
            ..Section::default()
        };
        [of_log, residuals, parameters, movements, trust]
    }
}

#[cfg(test)]
#[path = "page_tests.rs"]
mod tests;
