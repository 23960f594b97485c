//! What `host-fit fit` tells: a summary for the terminal, and the report.

use super::FitArgs;
use crate::cli::error::HostError;
use crate::diagnose::finding::Finding;
use crate::fit::Fit;
use crate::input::log::LogReading;
use crate::input::stage::Stage;
use crate::output::{Outputs, make_folder};
use crate::problem::parameters::Parameters;
use crate::report::errors;
use crate::report::json::Report;
use crate::report::page::Source;
use crate::report::page_in;
use crate::report::provenance::Provenance;
use crate::report::text;
use crate::report::verdict::End;

/// The figures of a fit for a terminal.
pub(super) fn summary(fit: &Fit, report: &Report, stage: &Stage) -> String {
    let parameters = text::parameters(
        fit.model,
        &fit.solution.parameters,
        &Parameters::designed(stage),
        &fit.standard_error,
        None,
    );
    let beyond = match (&fit.field, &report.field) {
        (Some(field), Some(report)) => text::field(field) + &report.as_text(),
        _ => String::new(),
    };
    format!(
        "{}, {} rows in {} movements, {} fitted, {} skipped; solver {}: {} evaluations in {:.1} ms, {}\n\
         {}\n\
         train fitness {:.4}\n\n{}\n{parameters}{beyond}\n{}{}",
        fit.model.title(),
        report.rows,
        report.movements,
        report.train_rows,
        report.skipped_rows,
        report.solver.as_deref().unwrap_or("-"),
        fit.solution.evaluations,
        fit.solution.elapsed.as_secs_f64() * 1e3,
        fit.solution.stopped,
        report.model_reason.as_deref().unwrap_or("-"),
        fit.train_fitness,
        text::errors(
            &format!("errors over all rows, {}", report.zeros_in_words),
            fit.errors(),
            None
        ) + &errors::as_text(&report.logs),
        text::lag(
            fit.lag,
            report.reference_lag.is_some_and(|lag| lag.compensated)
        ),
        text::trust(report),
    )
}

/// Adds the report to the outputs, if one is asked for: of a fit with its figures and its blob, or
/// of a log that has none.
pub(super) fn add_report(
    outputs: &mut Outputs,
    args: &FitArgs,
    (log, stage): (&LogReading, &Stage),
    findings: &[Finding],
    fit: Option<(&Fit, &Report)>,
    (end, blob): (End, &[u8]),
) -> Result<(), HostError> {
    let Some(folder) = &args.report else {
        return Ok(());
    };
    let words = std::env::args_os().map(|word| word.to_string_lossy().into_owned());
    let mut provenance = Provenance {
        serial: args.serial.clone().unwrap_or_default().as_str().to_owned(),
        created: args.created.clone().unwrap_or_default().as_str().to_owned(),
        seed: args.seed,
        ..Provenance::new(words)
    };
    provenance.add_logs(&log.dataset);
    provenance.add_file(&args.stage, "stage as designed");
    if let Some(start) = &args.start {
        provenance.add_file(start, "parameters to start from");
    }
    if !matches!(end, End::Failed(_)) {
        provenance.add_bytes(&args.out, blob, "parameter blob, written");
    }
    let warnings = crate::cli::warnings_of(log);
    let source = Source {
        stage,
        dataset: &log.dataset,
        provenance,
        findings,
        warnings: &warnings,
        fit,
        end,
    };
    let page = source.html()?;
    make_folder(folder)?;
    Ok(outputs.add(&page_in(folder), page.as_bytes())?)
}
