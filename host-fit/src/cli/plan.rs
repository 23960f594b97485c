//! `host-fit plan`.

use super::arguments::{Json, StageFile, between};
use crate::cli::error::HostError;
use crate::cli::terminal;
use crate::output::{Outputs, kept};
use crate::report::plan::{figures, steps, tables, untold};
use crate::report::text::as_text;
use clap::Args;
use hallstage_calibration::plan::temperature::{COLD_S, protocol};
use hallstage_calibration::plan::{PERIODS_MAX, SECONDS_MAX, plan};
use hallstage_simulate::plan_file;
use std::path::PathBuf;

fn seconds(text: &str) -> Result<f64, String> {
    between(text, f64::MIN_POSITIVE, SECONDS_MAX, "a number of seconds")
        .map_err(|_| format!("expected a number of seconds above 0 and up to {SECONDS_MAX}"))
}

/// Arguments of `plan`.
#[derive(Debug, Args)]
pub(super) struct PlanArgs {
    #[command(flatten)]
    stage: StageFile,
    /// Length of the run in s; 20 s are plenty for a stage with usual limits.
    #[arg(long, value_name = "T", value_parser = seconds, allow_negative_numbers = true, required_unless_present = "temperature")]
    seconds: Option<f64>,
    /// Show also the logs that determine the temperature coefficients, and the errors to expect. The run is
    /// the first log, by default of 30 s.
    #[arg(long)]
    temperature: bool,
    /// Write the trajectory to this file: columns t_us,x_um,y_um,rz_urad,z_um,rx_urad,ry_urad, one row
    /// for every servo period; `-` for standard output.
    #[arg(long, value_name = "run.csv")]
    out: Option<PathBuf>,
    /// Replace a file that may hold a measurement.
    #[arg(long)]
    force: bool,
    #[command(flatten)]
    json: Json,
}

/// Plans a run within the limits of `[motion]` in the stage file, and writes trajectory and JSON.
pub(super) fn run(args: &PlanArgs) -> Result<(), HostError> {
    let outputs = [args.out.as_deref(), args.json.path.as_deref()];
    super::check_outputs(outputs, None, [args.stage.path.as_path()])?;
    if !args.force {
        (args.out.as_ref()).map_or(Ok(()), |path| kept::check_own(path, kept::PLAN))?;
        args.json.check_own()?;
    }
    let stage = args.stage.read()?;
    let (seconds, period_s) = (args.seconds.unwrap_or(COLD_S), stage.servo_period_s);
    if seconds / period_s > PERIODS_MAX {
        let problem = format!(
            "a run of {seconds} s has more than {PERIODS_MAX} servo periods of {period_s} s; make it shorter"
        );
        return Err(HostError::usage("--seconds", problem));
    }
    let plan = plan(&stage, seconds)?;
    let protocol = match args.temperature {
        true => protocol(&stage, seconds)?,
        false => Vec::new(),
    };
    let figures = figures(&plan, &protocol, &stage);
    let mut outputs = Outputs::default();
    if let Some(path) = &args.out {
        let csv = plan_file::to_csv(&plan.run.trajectory(period_s), period_s);
        outputs.add(path, csv.as_bytes())?;
    }
    args.json.add(&mut outputs, &figures)?;
    let written = outputs.commit()?;
    terminal::print(&as_text(&tables(&plan, &protocol, &stage)))?;
    terminal::print(&(untold(&plan, &stage) + &steps(&protocol)))?;
    super::wrote(written)
}
