//! The report of logs and what was made of them as one HTML page, written whether or not there is a
//! calibration: a certificate first, then what it rests on.

use super::charts::PlottedLog;
use super::errors::{RowErrors, designed, error_table, to_micro};
use super::figure::Figure;
use super::html::{Cause, Page, Section};
use super::parameters;
use super::provenance::Provenance;
use super::reference::reference;
use super::result::Report;
use super::table::Table;
use super::text::file_name;
use super::verdict::{End, Subject, Summary};
use crate::output::kept::CERTIFICATE;
use hallstage_calibration::judge::predicted::Validity;
use hallstage_calibration::judge::statistics::{PoseError, white_noise};
use hallstage_calibration::judge::verdict::Verdict;
use hallstage_calibration::recalibrate::Certificates;
use hallstage_calibration::words;
use hallstage_input::axis::{AXES, Axis, counted, sign};
use hallstage_input::dataset::Dataset;
use hallstage_input::stage::{Stage, TEXTS};
use hallstage_solver::estimator::model::Model;
use minijinja::Error;
use runtime::ModelKind;

/// The same until the fields of a certificate are filled in.
const REPORT: &str = "Calibration report";
const NO_DATE: &str = "not given; name it with --created";
const NO_SERIAL: &str = "without serial number";
/// Movements that the page lists.
const MOVEMENTS_MAX: usize = 1000;

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
    /// The report, if there is a fit or a blob.
    pub report: Option<&'a Report>,
    /// The calibration before it was brought up to date.
    pub as_found: Option<AsFound>,
    /// The certificates of the blob, and of those before it; `None` of a blob without a posterior, which keeps no number.
    pub certificates: Option<Certificates>,
}

/// A calibration before it was brought up to date.
#[derive(Clone, Debug)]
pub struct AsFound {
    /// Its errors by row, m, m, rad.
    pub by_row: RowErrors,
    /// Over these.
    pub errors: PoseError,
    /// Its errors and those of the new calibration, on the log and in service; the changes of the gains.
    pub tables: Vec<Table>,
}

/// What a person says of a run, in the order of a certificate.
pub fn facts(
    serial: &str,
    operator: Option<&str>,
    created: Option<&str>,
    notes: &[(String, String)],
) -> Vec<[String; 2]> {
    let date = match created {
        None | Some("") => NO_DATE,
        Some(date) => date,
    };
    let serial = if serial.is_empty() { NO_SERIAL } else { serial };
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
        let log = PlottedLog {
            dataset,
            period_s: (dataset.period_s(0..dataset.rows.len())).unwrap_or(stage.servo_period_s),
        };
        let mut sections = Vec::new();
        if let Some(report) = self.report {
            sections.extend(self.sections(&log, report));
        }
        sections.push(Section {
            title: "Provenance",
            tables: vec![self.provenance.0.clone()],
            ..Section::default()
        });
        let document = || self.provenance.document(&self.facts);
        let (title, number) = match (self.title, self.number()) {
            (title, Some(number)) => (title, number),
            (CERTIFICATE, None) => (REPORT, document()),
            (title, None) => (title, document()),
        };
        let page = Page {
            title,
            number,
            first: (self.as_found.as_ref()).map_or(Vec::new(), |of| of.tables.clone()),
            verdict: Summary::new(&self.subject),
            facts: self.facts(),
            causes: Some(Cause::grouped(&self.subject.diagnosis.findings)),
            warnings: &self.warnings,
            sections,
        };
        page.html()
    }

    /// The number of the certificate; `None` of a page that is none.
    pub fn number(&self) -> Option<String> {
        let [number, ..] = &self.stage.certificate.texts;
        self.is_certificate().then(|| number.clone())
    }

    /// Whether it is a certificate: of a calibration that can be used, with all fields and a number of its own.
    fn is_certificate(&self) -> bool {
        self.title == CERTIFICATE
            && self.subject.end == End::Written
            && self.subject.diagnosis.verdict != Some(Verdict::Refused)
            && self.missing().is_empty()
    }

    /// What a certificate by ISO/IEC 17025, 7.8 lacks.
    fn missing(&self) -> Vec<&'static str> {
        let texts = TEXTS.iter().zip(&self.stage.certificate.texts);
        let texts = texts.filter_map(|(key, text)| text.is_empty().then_some(*key));
        let placeholders = [(NO_DATE, "date"), (NO_SERIAL, "serial number")];
        let is_open = |text: &str| self.facts.iter().any(|[_, given]| given == text);
        let open = placeholders
            .iter()
            .filter_map(|(text, name)| is_open(text).then_some(*name));
        let [number, ..] = &self.stage.certificate.texts;
        let number = match &self.certificates {
            None => Some("a posterior, which keeps the number"),
            Some(of) => (!number.is_empty() && of.has(number)).then_some("a number of its own"),
        };
        texts.chain(open).chain(number).collect()
    }

    /// The facts of a certificate besides the verdict: laboratory, operator, date, stage, range of validity.
    fn facts(&self) -> Vec<[String; 2]> {
        let table = &self.stage.certificate;
        let is_certificate = self.is_certificate();
        // Only the certificate has its number.
        let from = usize::from(!is_certificate);
        let texts = TEXTS[from..].iter().zip(&table.texts[from..]);
        let texts = texts.filter(|(_, text)| !text.is_empty());
        let texts = texts.map(|(key, text)| [key.replace('_', " "), text.clone()]);
        let mut facts: Vec<[String; 2]> = texts.collect();
        let missing = self.missing();
        let is_begun = !facts.is_empty();
        if !is_certificate {
            facts.insert(
                0,
                ["number".to_owned(), self.provenance.document(&self.facts)],
            );
        }
        let Certificates { own, before } = &self.certificates.clone().unwrap_or_default();
        let of_blob = "certificate of the blob";
        let fact = match (self.title == CERTIFICATE, before.last()) {
            (true, before) => before.map(|of| ["latest certificate before", of].map(str::to_owned)),
            (false, _) if !own.is_empty() => Some([of_blob, own].map(str::to_owned)),
            (false, before) => before.map(|of| {
                let none = format!("none; the latest before it is {of}");
                [of_blob.to_owned(), none]
            }),
        };
        if let Some(fact) = fact {
            facts.insert(1, fact);
        }
        facts.extend(self.facts.iter().cloned());
        let mut add = |name: &str, text: String| facts.push([name.to_owned(), text]);
        if self.title == CERTIFICATE && is_begun && !missing.is_empty() {
            add("missing for a certificate", missing.join(", "));
        }
        if is_begun {
            add(
                "scope",
                "the results hold for this stage, in the state of the log".to_owned(),
            );
        }
        if let Some(rule) = self.subject.decision.text() {
            add("decision rule", rule);
        }
        if let Some(Report { set, .. }) = self.report {
            let c = &set.constants;
            let ends = [c.calibrated_planar, c.calibrated_vertical].concat();
            let range = |(axis, end): (&Axis, f32)| {
                format!("{} ±{:.0} {}", axis.name, end * 1e6, sign(axis.micro))
            };
            let mut ranges: Vec<String> = AXES.iter().zip(ends).map(range).collect();
            ranges.push(match set.model {
                ModelKind::Field => "all axes moving".to_owned(),
                _ => "movements like the log".to_owned(),
            });
            add("valid for", ranges.join(", "));
        }
        add("temperature", self.temperature());
        let up_to = self.subject.diagnosis.up_to.as_ref();
        if let Some(up_to) = up_to.filter(|_| self.subject.is_field) {
            add("motion", words::up_to(up_to));
        }
        add("reference", reference(self.stage));
        let (rows, movements) = self.dataset.read();
        let logs = self.dataset.logs.iter().map(|log| file_name(&log.path));
        let logs: Vec<String> = logs.collect();
        let movements = counted(movements, "movement");
        let what = format!("{}: {rows} rows in {movements}", logs.join(", "));
        add("log", what);
        facts
    }

    /// Temperatures of the log, and how far from the temperature of calibration the errors hold.
    fn temperature(&self) -> String {
        let all = 0..self.dataset.rows.len();
        let range = |sensor: usize| {
            let [low, high] = self.dataset.temperature_range_mc(sensor, all.clone())?;
            let [low, high] = [low, high].map(|mc| f64::from(mc) * 1e-3);
            Some(format!(
                "{} {low:.1} to {high:.1} °C",
                ["mount", "body"][sensor]
            ))
        };
        let mut parts: Vec<String> = (0..2).filter_map(range).collect();
        if parts.is_empty() {
            parts.push("not logged".to_owned());
        }
        if let Some(Validity { within_k, .. }) = self.subject.diagnosis.validity {
            parts.push(format!(
                "errors hold within {within_k:.1} K of the temperature of calibration"
            ));
        }
        parts.join("; ")
    }

    /// Errors, parameters, movements and all other figures.
    fn sections(&self, log: &PlottedLog, report: &Report) -> [Section; 5] {
        let noise = white_noise(&report.by_row, &self.dataset.movements);
        let after = format!("after: {}", Model::from_kind(report.set.model).title());
        let (what, before) = match &self.as_found {
            Some(found) => {
                let before = (found.by_row.clone(), found.errors);
                ("before: as found", Some(before))
            }
            None => {
                let before = designed(self.dataset, self.stage);
                ("before: designed values, Model (15)", before)
            }
        };
        let rows = [
            before.as_ref().map(|(_, errors)| (what, to_micro(errors))),
            Some((after.as_str(), to_micro(&report.over_rows))),
            Some(("noise from row to row", noise.map(|x| [x * 1e6, f64::NAN]))),
        ];
        let before = before.as_ref().map(|(rows, _)| rows);
        let on_log = Section {
            title: "Errors on the log",
            notes: vec![
                "Decoded by the code of the target; zero deviations refitted where the model has them.".to_owned(),
            ],
            tables: vec![error_table("", rows.into_iter().flatten())],
            charts: vec![
                log.errors("Before (grey) and after (blue), on one scale", &report.by_row, before),
                log.errors("After, enlarged", &report.by_row, None),
            ],
        };
        let residuals = Section {
            title: "Errors against pose and signals",
            notes: vec![
                "Line: mean of the errors. Band: two standard deviations of the errors. Orange lines: two standard deviations \
                 of the noise from row to row. Where the mean leaves zero over a long way, the model lacks something."
                    .to_owned(),
            ],
            charts: log.against(&report.by_row, noise),
            ..Section::default()
        };
        let designed = [("designed", parameters::designed(self.stage))];
        let mut tables = parameters::tables(&report.parameters, &designed);
        for table in &mut tables {
            let names = table.rows.iter().map(|(name, _)| parameters::meaning(name));
            table.remarks = names.collect();
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
        let movements = &report.movements[..report.movements.len().min(MOVEMENTS_MAX)];
        let movements = Section {
            title: "Movements",
            tables: vec![Table::from_groups("movements", movements)],
            ..Section::default()
        };
        // The budget stands on the first page.
        let mut figures = report.figures.clone();
        figures.set("budget", Figure::None);
        let more = Section {
            title: "More figures",
            tables: figures.tables(),
            ..Section::default()
        };
        [on_log, residuals, parameters, movements, more]
    }
}

#[cfg(test)]
#[path = "page_tests.rs"]
mod tests;
