//! `host-fit trend`.

use super::arguments::{Json, StageFile};
use super::report::ReportArgs;
use crate::calibrate::other_scales;
use crate::cli::error::HostError;
use crate::cli::terminal;
use crate::output::{Outputs, blob_file, posterior_file};
use crate::report::provenance::Provenance;
use crate::report::text::as_text;
use crate::trend::{Trend, shown};
use clap::Args;
use std::path::PathBuf;

/// Arguments of `trend`.
#[derive(Debug, Args)]
pub(super) struct TrendArgs {
    /// Parameter blobs of one stage, made at different dates (--created 2026-11-26).
    #[arg(required = true, num_args = 2.., value_name = "params.bin")]
    blobs: Vec<PathBuf>,
    #[command(flatten)]
    stage: StageFile,
    #[command(flatten)]
    report: ReportArgs,
    #[command(flatten)]
    json: Json,
}

/// Shows how the calibrations of a stage change, and when a limit will be reached.
pub(super) fn run(args: &TrendArgs) -> Result<(), HostError> {
    let inputs = args.blobs.iter().chain([&args.stage.path]);
    let inputs = inputs.map(PathBuf::as_path);
    super::check_outputs([args.json.path.as_deref()], Some(&args.report), inputs)?;
    args.report.check_own(&args.json)?;
    let stage = args.stage.read()?;
    let mut provenance = Provenance::new(std::env::args_os());
    provenance.add_file(&args.stage.path, "stage as designed");
    let mut blobs = Vec::new();
    for path in &args.blobs {
        let set = blob_file::read(path)?;
        args.report.check_not_before(path, &set)?;
        let name = path.display().to_string();
        if let Some(problem) = other_scales(&set, &stage) {
            return Err(HostError::input(format!("{name}: {problem}")));
        }
        provenance.add_bytes(path, &blob_file::to_bytes(path, &set)?, "parameter blob");
        let known = posterior_file::read(&set, path)?;
        blobs.push((name, set, known));
    }
    let serial = blobs.first().map(|(_, set, _)| set.serial.clone());
    let trend = Trend::new(&blobs, &stage)?;
    let mut outputs = Outputs::default();
    let figures = shown::figures(&trend);
    args.json.add(&mut outputs, &figures)?;
    args.report.add(&mut outputs, || {
        let serial = serial.as_deref().unwrap_or_default();
        Ok(shown::page(&trend, args.report.facts(serial), provenance)?)
    })?;
    super::wrote(outputs.commit()?)?;
    terminal::warn(&shown::warnings(&trend));
    let answer = shown::answer(&trend);
    terminal::print(&format!("{answer}\n{}", as_text(&figures.tables())))
}
