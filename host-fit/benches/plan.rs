//! What a planned run of 20 s leads to on stages of unknown assembly: 20 simulated stages run it,
//! are fitted, and are judged by their service against the truth, beside the forecast.
//!
//! The floor of a stage is what parameters fitted to its own service truth leave. Prints a table
//! and `RESULT key=value` lines.

mod common;

use common::{Axes, Fallible, Twin, fitted, rms};
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
    let words = |[x, y, z]: Axes| format!("{x:7.4} {y:7.4} {z:7.4}");
    let mut all = Vec::new();
    for seed in 1..=SEEDS {
        let twin = Twin::new(&stage, seed);
        let log = twin.record(Run::planned(trajectory.clone()));
        let log = log.dataset(&stage).ok_or("no plane")?;
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
    let predicted = plan.forecast.service.ratios();
    for (k, axis) in ["x", "y", "rz"].into_iter().enumerate() {
        let of = || all.iter().map(|ratio| ratio[k]);
        let (mean, worst) = (of().sum::<f64>() / SEEDS as f64, of().fold(0.0, f64::max));
        let key = format!("RESULT service_over_floor_{axis}");
        println!(
            "{key}_predicted={:.4}\n{key}_mean={mean:.4}\n{key}_worst={worst:.4}",
            predicted[k]
        );
    }
    Ok(())
}
