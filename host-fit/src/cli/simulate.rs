//! `host-fit simulate`.

use super::arguments::{StageFile, between, choice};
use crate::cli::error::HostError;
use crate::cli::terminal;
use crate::output::{Outputs, kept, packed};
use clap::Args;
use hallstage_input::axis::counted;
use hallstage_simulate::assembly::Magnets;
use hallstage_simulate::dynamics::MotionEffects;
use hallstage_simulate::log_text::{log_csv, truth_csv};
use hallstage_simulate::plan_file;
use hallstage_simulate::protocol::{Protocol, Run};
use hallstage_simulate::recording::record_stage;
use std::path::PathBuf;

/// Arguments of `simulate`.
#[derive(Debug, Args)]
pub(super) struct SimulateArgs {
    #[command(flatten)]
    stage: StageFile,
    /// Run this trajectory: columns t_us,x_um,y_um,rz_urad,z_um,rx_urad,ry_urad, one row for
    /// every servo period.
    #[arg(long, value_name = "run.csv")]
    plan: Option<PathBuf>,
    /// Run this protocol.
    #[arg(long, value_parser = choice::<Protocol>(), conflicts_with = "plan")]
    protocol: Option<Protocol>,
    /// Begin the run at this hour of a working day (work begins at 0): -0.2 is cold, 3.5 warm. The log then
    /// has the temperature columns that the stage file names.
    #[arg(long, value_name = "H", value_parser = hour, allow_negative_numbers = true)]
    hour: Option<f64>,
    /// Read the probes A, B, C this late, us; negative: early. All three with commas between them.
    #[arg(long, value_name = "A,B,C", value_parser = lag_us, value_delimiter = ',', num_args = 1, allow_hyphen_values = true)]
    probe_lag_us: Vec<f64>,
    /// Put motor coils at this distance from each probe, cm; their stray field follows the acceleration.
    #[arg(long, value_name = "CM", value_parser = coil_cm)]
    coil_cm: Option<f64>,
    /// Put the probes on arms with a resonance at about this frequency, Hz.
    #[arg(long, value_name = "HZ", value_parser = arm_hz)]
    arm_hz: Option<f64>,
    /// Stage and noise. An even seed has magnets as designed, an odd seed imperfect magnets.
    #[arg(long, value_name = "N")]
    seed: u64,
    /// Write the log to this file: CSV, or CSV.gz if the name ends so; `-` for standard output.
    #[arg(long, value_name = "log.csv", default_value = "-")]
    out: PathBuf,
    /// Write the true poses to this file, likewise.
    #[arg(long, value_name = "truth.csv")]
    truth: Option<PathBuf>,
    /// Replace files that may hold measurements: also a log that was simulated.
    #[arg(long)]
    force: bool,
}

fn hour(text: &str) -> Result<f64, String> {
    between(text, -24.0, 24.0, "an hour of the day")
}

fn lag_us(text: &str) -> Result<f64, String> {
    between(text, -5000.0, 5000.0, "a lag")
}

fn coil_cm(text: &str) -> Result<f64, String> {
    between(text, 3.0, 100.0, "a distance")
}

fn arm_hz(text: &str) -> Result<f64, String> {
    between(text, 20.0, 1e4, "a resonance")
}

/// Writes the log of a simulated stage.
pub(super) fn run(args: &SimulateArgs) -> Result<(), HostError> {
    let truth = args.truth.as_deref();
    let inputs = [Some(&args.stage.path), args.plan.as_ref()];
    let outputs = [Some(args.out.as_path()), truth];
    super::check_outputs(
        outputs,
        None,
        inputs.into_iter().flatten().map(PathBuf::as_path),
    )?;
    if !args.force {
        kept::check_own(&args.out, kept::LOG)?;
        truth.map_or(Ok(()), |path| kept::check_own(path, kept::TRUTH))?;
    }
    let stage = args.stage.read()?;
    let period_s = stage.servo_period_s;
    let run = match (&args.plan, args.protocol) {
        (Some(plan), _) => Run::planned(plan_file::read(plan, period_s)?),
        (None, Some(protocol)) => protocol.run(period_s, args.seed),
        (None, None) => {
            let problem = "name a protocol, or a trajectory with --plan";
            return Err(HostError::usage("--protocol", problem));
        }
    };
    let lag_us = match args.probe_lag_us[..] {
        [] => [0.0; 3],
        [a, b, c] => [a, b, c],
        _ => {
            let problem = "three lags are needed, of the probes A, B and C";
            return Err(HostError::usage("--probe-lag-us", problem));
        }
    };
    let coil_m = args.coil_cm.map(|cm| cm * 1e-2);
    let dynamics = MotionEffects::draw(lag_us.map(|us| us * 1e-6), coil_m, args.arm_hz, args.seed);
    let recording = record_stage(&stage, run, args.hour, dynamics, args.seed)?;
    let mut outputs = Outputs::default();
    if let Some(path) = truth {
        outputs.add(path, &packed(path, truth_csv(&recording))?)?;
    }
    outputs.add(&args.out, &packed(&args.out, log_csv(&recording, &stage))?)?;
    outputs.commit()?;
    let magnets = match Magnets::from_seed(args.seed) {
        Magnets::AsDesigned => "magnets as designed",
        Magnets::Imperfect => "imperfect magnets",
    };
    terminal::print(&format!(
        "wrote {}: {} rows in {} of stage {}, {magnets}\n",
        args.out.display(),
        recording.rows(),
        counted(recording.movements.len(), "movement"),
        args.seed
    ))
}
