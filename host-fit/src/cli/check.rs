//! `host-fit check`.

use crate::cli::error::HostError;
use crate::cli::terminal;
use crate::diagnose;
use crate::diagnose::finding::{Code, Finding, Severity};
use crate::diagnose::trusted::{Trusted, trusted};
use crate::fit::{Fit, FitError, FitSettings, ModelChoice, fit};
use crate::input::log;
use crate::input::log::{LogReading, ReadOptions};
use crate::input::stage::Stage;
use crate::interrupt;
use crate::judge::identify::FitFailure;
use crate::report::text;
use crate::solve::{Projection, SolverOptions};
use clap::Args;
use serde::Serialize;
use std::path::PathBuf;

/// Arguments of `check`.
#[derive(Debug, Args)]
pub(super) struct CheckArgs {
    /// Logs: CSV or CSV.gz, one or more.
    #[arg(required = true, value_name = "LOG")]
    logs: Vec<PathBuf>,
    /// The stage as designed.
    #[arg(long, value_name = "stage.toml")]
    stage: PathBuf,
    /// Logs without a column for the movement: begin one every so many seconds, not only after gaps
    /// in time.
    #[arg(long, value_name = "SECONDS", value_parser = super::args::movement_seconds)]
    split: Option<f64>,
    /// Write what was found as JSON; `-` for standard output.
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// What is said of a log of which no calibration is kept.
#[derive(Debug, Serialize)]
pub(super) struct Checked {
    rows: usize,
    movements: usize,
    skipped_rows: usize,
    /// Why there is no fit; null if there is one.
    failure: Option<String>,
    warnings: Vec<String>,
    findings: Vec<Finding>,
    /// The inputs whose errors no log shows, with what 1 % costs; empty without a fit.
    trusted_inputs: Vec<Trusted>,
}

impl Checked {
    pub(super) fn new(
        log: &LogReading,
        fitted: Result<&Fit, &FitError>,
        findings: Vec<Finding>,
    ) -> Self {
        Self {
            rows: log.dataset.named().0,
            movements: log.dataset.named().1,
            skipped_rows: log.skipped_rows,
            failure: fitted.err().map(ToString::to_string),
            warnings: super::warnings_of(log),
            findings,
            trusted_inputs: fitted.map_or_else(|_| Vec::new(), |fit| trusted(&fit.set)),
        }
    }
}

/// The end of a run whose fit failed, with what the diagnosis found.
pub(super) fn failed(error: FitError, findings: &[Finding]) -> HostError {
    let spoils = |found: &Finding| {
        let harmless = [Code::TermsAtLimit, Code::Jitter, Code::RowsMissing];
        found.severity >= Severity::Warn && !harmless.contains(&found.code)
    };
    let explained = match &error {
        // What it says may be wrong is for logs of which nothing is known.
        FitError::Failed(FitFailure::NotDescribed { .. }) => findings.iter().any(spoils),
        _ => diagnose::is_explained(findings),
    };
    let findings = diagnose::messages(findings, Severity::Warn);
    match error {
        error if findings.is_empty() => HostError::Fit(error),
        _ if explained => HostError::Refused { findings },
        error => HostError::FitDiagnosed { error, findings },
    }
}

/// Reads and fits, keeps nothing, and tells what was found.
pub(super) fn run(args: &CheckArgs) -> Result<(), HostError> {
    let mut inputs = vec![args.stage.as_path()];
    inputs.extend(args.logs.iter().map(PathBuf::as_path));
    super::keep_apart(&[args.json.as_deref()], &inputs)?;
    interrupt::watch();
    let stage = Stage::from_file(&args.stage)?;
    let options = ReadOptions {
        split_s: args.split,
        ..ReadOptions::FIT
    };
    let log = terminal::timed("reading", || log::read(&args.logs, &stage, &options))?;
    let mut options = SolverOptions::new(Projection::Linear, 1);
    options.interrupt = Some(interrupt::watch());
    let settings = FitSettings {
        options,
        ..FitSettings::new(ModelChoice::Auto)
    };
    let fitted = terminal::timed("fit", || fit(&log.dataset, &stage, &settings));
    if interrupt::requested() {
        return Err(HostError::Interrupted {
            kept: "nothing was written".to_owned(),
        });
    }
    let findings = terminal::timed("diagnosis", || {
        diagnose::of_log(&log.dataset, &stage, fitted.as_ref())
    });
    let checked = Checked::new(&log, fitted.as_ref(), findings);
    if let Some(path) = &args.json {
        super::write_json(&checked, path)?;
    }
    terminal::print(&format!(
        "{} rows in {} movements\n",
        checked.rows, checked.movements
    ))?;
    if let Ok(fit) = &fitted {
        terminal::print(&text::errors(
            &format!("errors of {}", fit.model.title()),
            fit.errors(),
            None,
        ))?;
    }
    terminal::print(&as_text(&checked.findings))?;
    terminal::print(&text::trusted(&checked.trusted_inputs))?;
    super::wrote([args.json.clone()])?;
    terminal::warn(&checked.warnings);
    if let Err(error) = fitted {
        return Err(failed(error, &checked.findings));
    }
    let findings = diagnose::messages(&checked.findings, Severity::Refuse);
    if findings.is_empty() {
        Ok(())
    } else {
        Err(HostError::Refused { findings })
    }
}

fn as_text(findings: &[Finding]) -> String {
    if findings
        .iter()
        .all(|finding| finding.severity == Severity::Note)
    {
        return "nothing is wrong with it\n".to_owned() + &lines(findings);
    }
    lines(findings)
}

fn lines(findings: &[Finding]) -> String {
    let line = |finding: &Finding| {
        let severity = match finding.severity {
            Severity::Note => "note",
            Severity::Warn => "warning",
            Severity::Refuse => "refused",
        };
        format!("{severity}: {}\n", finding.message)
    };
    findings.iter().map(line).collect()
}
