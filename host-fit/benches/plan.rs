//! A planned run of 20 s on 20 simulated stages: the errors in service of its fit, beside the forecast.
//!
//! The noise floor of a stage is the error of parameters that are fitted to its own service with the
//! true poses. Prints a table and `RESULT key=value` lines.

mod common;

use common::{Axes, Fallible, Twin, fitted, mean_and_worst, rms, words};
use host_fit::calibration::plan::plan;
use host_fit::input::shipped;
use host_fit::simulate::protocol::{Protocol, Run};
use runtime::ModelKind;
use std::time::Instant;

const SECONDS: f64 = 20.0;
const SEEDS: u64 = 20;

fn main() -> Fallible<()> {
    let stage = shipped::stage();
    let started = Instant::now();
    let plan = plan(&stage, SECONDS)?;
    let plan_ms = started.elapsed().as_secs_f64() * 1e3;
    println!("RESULT plan_ms={plan_ms:.1}");
    let trajectory = plan.run.trajectory(stage.servo_period_s);

    println!("seed  rms in service (um, um, urad)   floor                  rms over floor");
    let mut all = Vec::new();
    for seed in 1..=SEEDS {
        let twin = Twin::new(&stage, seed);
        let log = twin.log(Run::planned(trajectory.clone()));
        let service = twin.record(Protocol::Service.run(stage.servo_period_s, seed));
        let service = service.dataset_with_truth(&stage).ok_or("no plane")?;
        let [found, floor] = [
            fitted(&log, &stage, ModelKind::Field)?,
            fitted(&service, &stage, ModelKind::Field)?,
        ]
        .map(|fit| rms(&fit.set, &service, &stage).map(|rms| rms * 1e6));
        let ratio: Axes = [0, 1, 2].map(|k| found[k] / floor[k]);
        let (found, floor) = (words(found), words(floor));
        println!("{seed:4}  {found}        {floor}  {}", words(ratio));
        all.push(ratio);
    }
    let (predicted, [mean, worst]) = (plan.forecast.service.ratios(), mean_and_worst(&all));
    for (k, axis) in ["x", "y", "rz"].into_iter().enumerate() {
        let key = format!("RESULT service_over_floor_{axis}");
        println!(
            "{key}_predicted={:.4}\n{key}_mean={:.4}\n{key}_worst={:.4}",
            predicted[k], mean[k], worst[k]
        );
    }
    Ok(())
}
