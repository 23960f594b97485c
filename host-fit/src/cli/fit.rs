//! `host-fit fit`.

use super::arguments::{Json, Logs, Threads};
use super::fit_options::FitOptions;
use super::interrupt;
use super::report::finish;
use crate::calibrate::FitOrder;
use crate::cli::error::HostError;
use crate::cli::terminal;
use crate::output::kept::CERTIFICATE;
use crate::output::{Outputs, blob_file, kept, posterior_file};
use crate::report::channels::channels;
use crate::report::parameters;
use crate::report::table::Table;
use crate::report::text::as_text;
use clap::Args;
use hallstage_calibration::recalibrate::Certificates;
use hallstage_calibration::words;
use hallstage_input::log::ReadOptions;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Arguments of `fit`.
#[derive(Debug, Args)]
pub(super) struct FitArgs {
    #[command(flatten)]
    logs: Logs,
    /// Where to write the parameter blob.
    #[arg(long, value_name = "params.bin")]
    out: PathBuf,
    #[command(flatten)]
    options: FitOptions,
    #[command(flatten)]
    pub(super) threads: Threads,
    #[command(flatten)]
    report: super::report::ReportArgs,
    #[command(flatten)]
    json: Json,
}

/// Fits a log and keeps the calibration.
pub(super) fn run(args: &FitArgs) -> Result<(), HostError> {
    let posterior = posterior_file::beside(&args.out);
    let outputs = [Some(&args.out), posterior.as_ref(), args.json.path.as_ref()];
    let outputs = outputs.map(|path| path.map(PathBuf::as_path));
    super::check_outputs(outputs, Some(&args.report), args.logs.inputs())?;
    if !args.options.force {
        let serial = args.options.serial.as_ref();
        kept::check_own_blob(&args.out, serial.map_or("", |serial| serial.as_str()))?;
        args.report.check_own(&args.json)?;
    }
    let created = args.report.created.clone().unwrap_or_default();
    let order = args.options.order(created, interrupt::watch());
    let job = FitJob {
        title: CERTIFICATE,
        order: order.map_err(HostError::from_mismatch)?,
        out: Some(&args.out),
    };
    job.run((&args.logs, &args.report, &args.json))
}

/// What `fit` and `check` do.
pub(super) struct FitJob<'a> {
    /// Title of the page.
    pub(super) title: &'static str,
    pub(super) order: FitOrder,
    /// Where the calibration goes, if it is kept.
    pub(super) out: Option<&'a Path>,
}

impl FitJob<'_> {
    /// Reads, fits, judges; then writes JSON, report and blob, in this order.
    pub(super) fn run(
        &self,
        (logs, page, json): (&Logs, &super::report::ReportArgs, &Json),
    ) -> Result<(), HostError> {
        let started = Instant::now();
        let stage = logs.stage.read()?;
        let log = logs.read(&stage, ReadOptions::FIT)?;
        let outcome = terminal::timed("fit and diagnosis", || self.order.run(&log, &stage));
        let outcome = outcome.map_err(HostError::from_calibrate)?;
        let log_and_stage = (&log, &stage);
        let report = outcome.report(&self.order, log_and_stage, started.elapsed().as_secs_f64());
        let subject = outcome.subject();
        let mut outputs = Outputs::default();
        match &report {
            Some(report) => json.add(&mut outputs, report)?,
            None => json.add(&mut outputs, &outcome.without_fit(&log))?,
        }
        let kept = self.out.filter(|_| outcome.has_blob);
        let kept = kept.zip(outcome.fitted.as_ref().ok());
        let mut known = outcome.known(&log.dataset);
        let mut warnings = words::messages(&log.warnings);
        let mut certificates = kept.map_or_else(Certificates::default, |(path, fit)| {
            kept::certificates(path, &fit.set, &[], &mut warnings)
        });
        page.add(&mut outputs, || {
            let what = (self.title, self.order.settings.serial.as_str());
            let mut source = page.source(what, logs, log_and_stage, subject);
            source.report = report.as_ref();
            if let Ok(fit) = &outcome.fitted {
                // The errors are of the rows of the fit.
                source.dataset = fit.rows(&log.dataset);
            }
            if let Some((path, fit)) = kept {
                let blob = blob_file::to_bytes(path, &fit.set)?;
                let provenance = &mut source.provenance;
                provenance.add_bytes(path, &blob, "parameter blob, written");
                source.warnings.clone_from(&warnings);
            }
            // Without a posterior an issued number is not kept.
            let has_place = kept.is_none() || known.is_some();
            source.certificates = has_place.then(|| certificates.clone());
            if let Some(number) = source.number() {
                certificates = std::mem::take(&mut certificates).with(number);
            }
            Ok(source.html()?)
        })?;
        if let Some(known) = &mut known {
            known.certificates = certificates;
        }
        if let Some((path, fit)) = kept {
            posterior_file::add_calibration(&mut outputs, path, &fit.set, known.as_ref())?;
        }
        let mut details = Vec::new();
        if let Some(report) = &report {
            let designed = [("designed", parameters::designed(&stage))];
            details = report.figures.tables();
            details.splice(1..1, parameters::tables(&report.parameters, &designed));
        }
        if self.out.is_none() {
            let channels = channels(&outcome.diagnosis.columns, &log.dataset);
            let table = Table::from_groups("channels", &channels);
            details.retain(|shown| *shown != table);
            terminal::print(&as_text(&[table]))?;
        }
        let refusal = outcome.refusal_message();
        if let (Some(cause), Some(_)) = (&refusal, kept) {
            terminal::warn(&[format!("written all the same, as --force asks: {cause}")]);
        }
        finish(outputs, &details, &warnings, &subject)?;
        match (refusal, kept, self.out) {
            (Some(cause), None, None) => Err(HostError::rejected(cause)),
            (Some(cause), None, Some(_)) => {
                let force = match &outcome.fitted {
                    Ok(_) => "; --force writes one that says so",
                    Err(_) => "",
                };
                let cause = format!("{cause} No parameter blob was written{force}.");
                Err(HostError::rejected(cause))
            }
            (_, Some((path, _)), _) if interrupt::is_requested() => {
                let kept = format!("{} holds the best so far", path.display());
                Err(HostError::interrupted(kept))
            }
            _ => Ok(()),
        }
    }
}
