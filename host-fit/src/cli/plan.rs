//! `host-fit plan`.

use crate::cli::error::HostError;
use crate::cli::terminal;
use crate::input::stage::Stage;
use crate::output::{Outputs, check_writable, make_folder};
use crate::plan::plan;
use crate::report;
use crate::report::plan::PlanReport;
use crate::report::plan_page::PlanPage;
use crate::simulate::plan_file;
use clap::Args;
use std::path::PathBuf;

/// Longest run, s: nothing is gained beyond a few minutes.
const SECONDS_MAX: f64 = 600.0;
/// Most rows of a run.
const ROWS_MAX: f64 = 2e6;

fn seconds(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(seconds) if seconds > 0.0 && seconds <= SECONDS_MAX => Ok(seconds),
        _ => Err(format!(
            "expected a number of seconds above 0 and up to {SECONDS_MAX}"
        )),
    }
}

/// Arguments of `plan`.
#[derive(Debug, Args)]
pub(super) struct PlanArgs {
    /// The stage as designed; its optional table [motion] says how it may move.
    #[arg(long, value_name = "stage.toml")]
    stage: PathBuf,
    /// Length of the run; 20 are plenty for a stage of the usual limits.
    #[arg(long, value_name = "T", value_parser = seconds, allow_negative_numbers = true)]
    seconds: f64,
    /// Where to write the trajectory: columns t_us,x_um,y_um,rz_urad,z_um,rx_urad,ry_urad, one row
    /// for every servo period; `-` for standard output.
    #[arg(long, value_name = "run.csv")]
    out: Option<PathBuf>,
    /// Write a page with plots into this folder.
    #[arg(long, value_name = "DIR")]
    report: Option<PathBuf>,
    /// Write the figures as JSON; `-` for standard output.
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// Plans; then writes trajectory, JSON and page, in this order.
pub(super) fn run(args: &PlanArgs) -> Result<(), HostError> {
    let (out, json) = (args.out.as_deref(), args.json.as_deref());
    let page = args.report.as_deref().map(report::page_in);
    super::keep_apart(&[out, json, page.as_deref()], &[&args.stage])?;
    for path in [out, json].into_iter().flatten() {
        check_writable(path)?;
    }
    if let Some(folder) = args.report.as_deref().filter(|folder| folder.exists()) {
        make_folder(folder)?;
    }
    let stage = Stage::from_file(&args.stage)?;
    if args.seconds / stage.servo_period_s > ROWS_MAX {
        return Err(HostError::Usage {
            argument: "--seconds",
            problem: format!(
                "a run of {} s has more than {ROWS_MAX} servo periods of {} s; make it shorter",
                args.seconds, stage.servo_period_s
            ),
        });
    }
    let plan = plan(&stage, args.seconds)?;
    let figures = PlanReport::new(&plan, &stage);
    let mut outputs = Outputs::default();
    if let Some(path) = out {
        let trajectory = plan.run.trajectory(stage.servo_period_s);
        let csv = plan_file::to_csv(&trajectory, stage.servo_period_s);
        outputs.add(path, csv.as_bytes())?;
    }
    if let Some(path) = json {
        outputs.add(path, super::json(&figures)?.as_bytes())?;
    }
    if let (Some(folder), Some(path)) = (&args.report, &page) {
        let page = PlanPage::new(&figures, &plan)?.to_html()?;
        make_folder(folder)?;
        outputs.add(path, page.as_bytes())?;
    }
    outputs.commit()?;
    terminal::print(&figures.text())?;
    super::wrote([args.out.clone(), args.json.clone(), page])
}
