//! `--report` of the commands that judge: where the page goes, and what stands on it besides figures.

use super::arguments::{Json, Logs, blob_text};
use crate::cli::error::HostError;
use crate::cli::terminal;
use crate::output::{OutputError, Outputs, kept, make_folder};
use crate::report::page::{Source, facts};
use crate::report::provenance::Provenance;
use crate::report::table::Table;
use crate::report::verdict::{Subject, Summary};
use crate::trend;
use clap::Args;
use hallstage_calibration::recalibrate::Certificates;
use hallstage_calibration::words;
use hallstage_input::log::LogReading;
use hallstage_input::stage::Stage;
use runtime::ParameterSet;
use runtime::parameters::Text;
use std::path::{Path, PathBuf};

/// Where the report of a command goes.
#[derive(Debug, Default, Args)]
pub(super) struct ReportArgs {
    /// Write a report into this folder: one page, DIR/index.html.
    #[arg(id = "report", long = "report", value_name = "DIR")]
    pub(super) folder: Option<PathBuf>,
    /// Who did it, for the report.
    #[arg(long, value_name = "NAME", requires = "report")]
    pub(super) operator: Option<String>,
    /// A line for the report, as --note "probe B=serial 1234"; may be given several times.
    #[arg(long = "note", value_name = "KEY=VALUE", requires = "report", value_parser = note)]
    pub(super) notes: Vec<(String, String)>,
    /// Date, or date and time, for blob and report: 2026-11-26 or 2026-11-26T10:00:00+01:00. The program
    /// does not look at the clock: the same command gives the same bytes.
    #[arg(long, value_name = "TIME", value_parser = date)]
    pub(super) created: Option<Text>,
}

fn note(text: &str) -> Result<(String, String), &'static str> {
    match text.split_once('=') {
        Some((key, value)) if !key.trim().is_empty() => {
            Ok((key.trim().to_owned(), value.trim().to_owned()))
        }
        _ => Err("expected KEY=VALUE"),
    }
}

fn date(text: &str) -> Result<Text, &'static str> {
    let is_date = trend::date(text).is_some();
    let text = blob_text(text)?;
    (is_date.then_some(text)).ok_or("write a date as 2026-11-26 or 2026-11-26T10:00:00+01:00")
}

impl ReportArgs {
    /// The one file of the report.
    pub(super) fn page(&self) -> Option<PathBuf> {
        Some(self.folder.as_ref()?.join("index.html"))
    }

    /// Refuses to replace a page of another program, a certificate, or a file that holds no figures.
    pub(super) fn check_own(&self, json: &Json) -> Result<(), OutputError> {
        json.check_own()?;
        let page = self.page();
        page.map_or(Ok(()), |page| kept::check_own_page(&page))
    }

    /// What a page says of logs, before there are errors.
    pub(super) fn source<'a>(
        &self,
        (title, serial): (&'static str, &str),
        logs: &Logs,
        (log, stage): (&'a LogReading, &'a Stage),
        subject: Subject<'a>,
    ) -> Source<'a> {
        let mut provenance = Provenance::new(std::env::args_os());
        provenance.add_logs(&log.dataset);
        provenance.add_file(&logs.stage.path, "stage as designed");
        Source {
            title,
            subject,
            facts: self.facts(serial),
            stage,
            dataset: &log.dataset,
            provenance,
            warnings: words::messages(&log.warnings),
            report: None,
            as_found: None,
            certificates: Some(Certificates::default()),
        }
    }

    /// What a person says of the run.
    pub(super) fn facts(&self, serial: &str) -> Vec<[String; 2]> {
        let (operator, created) = (self.operator.as_deref(), self.created.as_deref());
        facts(serial, operator, created, &self.notes)
    }

    /// Refuses a date before that of a blob that the run has read.
    pub(super) fn check_not_before(
        &self,
        blob: &Path,
        set: &ParameterSet,
    ) -> Result<(), HostError> {
        let created = self.created.as_deref().unwrap_or_default();
        match trend::is_before(created, &set.created) {
            true => Err(HostError::input(format!(
                "--created {created} is before {}, the date of {}",
                set.created,
                blob.display()
            ))),
            false => Ok(()),
        }
    }

    /// Adds the report to the outputs, if it is asked for.
    pub(super) fn add(
        &self,
        outputs: &mut Outputs,
        html: impl FnOnce() -> Result<String, HostError>,
    ) -> Result<(), HostError> {
        if let (Some(folder), Some(page)) = (&self.folder, self.page()) {
            let html = html()?;
            make_folder(folder)?;
            outputs.add(&page, html.as_bytes())?;
        }
        Ok(())
    }
}

/// Puts the outputs in their places and prints: tables with `--verbose`, what was written, warnings,
/// findings, the summary.
pub(super) fn finish(
    outputs: Outputs,
    details: &[Table],
    warnings: &[String],
    subject: &Subject,
) -> Result<(), HostError> {
    let written = outputs.commit()?;
    terminal::details(details)?;
    super::wrote(written)?;
    terminal::warn(warnings);
    terminal::show(&subject.diagnosis.findings);
    terminal::verdict(&Summary::new(subject))
}
