//! `host-fit check`.

use super::arguments::{Json, Logs};
use super::fit::FitJob;
use super::interrupt;
use super::report::ReportArgs;
use crate::calibrate::{ErrorLimits, FitOrder};
use crate::cli::error::HostError;
use crate::cli::terminal;
use clap::Args;
use hallstage_calibration::fit::{FitSettings, ModelChoice};

/// Arguments of `check`.
#[derive(Debug, Args)]
#[command(mut_arg("paths", |paths| paths.required(false)))]
#[command(mut_arg("report", |report| report.requires("paths")))]
#[command(mut_arg("json", |json| json.requires("paths")))]
pub(super) struct CheckArgs {
    #[command(flatten)]
    logs: Logs,
    #[command(flatten)]
    report: ReportArgs,
    #[command(flatten)]
    json: Json,
}

/// Fits and keeps nothing; without a log it reads the stage file alone.
pub(super) fn run(args: &CheckArgs) -> Result<(), HostError> {
    let json = args.json.path.as_deref();
    super::check_outputs([json], Some(&args.report), args.logs.inputs())?;
    args.report.check_own(&args.json)?;
    if args.logs.paths.is_empty() {
        args.logs.stage.read()?;
        return terminal::print("no fault found in the stage file\n");
    }
    let mut settings = FitSettings::new(ModelChoice::Auto);
    settings.options.watch = interrupt::watch();
    let job = FitJob {
        title: "Check of a log",
        order: FitOrder {
            settings,
            limits: ErrorLimits::default(),
            is_kept: false,
        },
        out: None,
    };
    job.run((&args.logs, &args.report, &args.json))
}
