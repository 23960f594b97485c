//! Errors in service of stages that warm in service, against the truth, over the noise of the probes. Each
//! movement is re-zeroed by the 0.4 s at rest before it.
//!
//! `cargo bench -p host-fit --bench temperature [-- STAGES]`: 20 simulated stages by default, minutes.

mod common;

use common::{Axes, Coverage, Fallible, RUN_8, RUN_30, Twin, fitted, mean_and_worst, words};
use host_fit::calibration::fit::Fit;
use host_fit::calibration::judge::Decoded;
use host_fit::calibration::judge::statistics::over_noise;
use host_fit::calibration::plan::run::PlannedRun;
use host_fit::input::shipped;
use host_fit::input::stage::Stage;
use host_fit::simulate::assembly::Assembly;
use host_fit::simulate::pose::StagePose;
use host_fit::simulate::protocol::{Protocol, REST_S, Run};
use host_fit::simulate::recording::Recording;
use host_fit::simulate::thermal::{ASSEMBLED_C, Climate};
use host_fit::solver::estimator::service::service_poses;
use runtime::ModelKind;
use runtime::frame::MISSING_CODE;

/// Temperatures of the service above the cold run, K.
const CHANGES_K: [f64; 4] = [-10.0, -5.0, 5.0, 10.0];
/// Limits of the mean and of the worst stage at these temperatures, ...
const LIMITS: [[f64; 2]; 4] = [[1.06, 1.3], [1.02, 1.1], [1.02, 1.1], [1.06, 1.3]];
/// ... of the mean with errors of the sensors, ...
const LIMITS_OFF: [f64; 2] = [1.08, f64::INFINITY];
/// ... and over the day.
const LIMITS_DAY: [f64; 2] = [1.04, 1.1];

impl Twin<'_> {
    fn planned(&self, run: &PlannedRun, climate: Climate) -> Recording {
        let run = Run::planned(run.trajectory(self.stage.servo_period_s));
        self.record_in(run, climate)
    }

    /// Service at a temperature above the cold run, each movement after a rest.
    fn service(&self, change_k: f64) -> Recording {
        let period_s = self.stage.servo_period_s;
        let mut run = Protocol::Service.run(period_s, self.seed);
        let rest = vec![StagePose::default(); (REST_S / period_s).round() as usize];
        for movement in &mut run.movements {
            movement.splice(0..0, rest.iter().copied());
        }
        self.record_in(run, steady(change_k))
    }

    fn fit(&self, logs: &[&Recording]) -> Fallible<Fit> {
        let logs = Recording::joined(logs, self.stage).ok_or("no plane")?;
        fitted(&logs, self.stage, ModelKind::Field)
    }

    fn judge(&self, fit: &Fit, recording: &Recording) -> Fallible<Axes> {
        let truth = recording.dataset_with_truth(self.stage).ok_or("no plane")?;
        let errors = Decoded::new(&fit.set, &truth).rezeroed(&truth, REST_S);
        Ok(over_noise(&errors, &truth.movements))
    }

    /// Relative change of the signals of A, B, C over service between two pairs of temperatures.
    fn change(&self, from_c: [f64; 2], to_c: [f64; 2]) -> [f64; 3] {
        let [from, to] = [from_c, to_c].map(|celsius| self.thermal.warmed(&self.assembly, celsius));
        let [x, y, rz, z, rx, ry] = RUN_30.amplitudes;
        let poses: Vec<StagePose> = service_poses(([x, y, rz], [z, rx, ry]))
            .map(|(planar, vertical)| StagePose { planar, vertical })
            .collect();
        [0, 1, 2].map(|probe| {
            let signals = |assembly: &Assembly| -> Vec<f64> {
                let signals = poses
                    .iter()
                    .map(|pose| assembly.probes[probe].signal_m(pose));
                let signals: Vec<f64> = signals.collect();
                let mean = signals.iter().sum::<f64>() / signals.len() as f64;
                signals.into_iter().map(|signal| signal - mean).collect()
            };
            let (from, to) = (signals(&from), signals(&to));
            let both: f64 = from.iter().zip(&to).map(|(from, to)| from * to).sum();
            both / from.iter().map(|from| from * from).sum::<f64>() - 1.0
        })
    }
}

const fn steady(change_k: f64) -> Climate {
    Climate::Steady(ASSEMBLED_C + change_k)
}

/// A log with some temperature sensors only.
fn blind(recording: &Recording, sensors: [bool; 2]) -> Recording {
    changed(recording, |read_mc| {
        [0, 1].map(|k| if sensors[k] { read_mc[k] } else { MISSING_CODE })
    })
}

fn changed(recording: &Recording, change: impl Fn([i32; 2]) -> [i32; 2]) -> Recording {
    let mut recording = recording.clone();
    for sample in recording.movements.iter_mut().flatten() {
        sample.temperature_mc = change(sample.temperature_mc);
    }
    recording
}

/// Errors over the noise, for some stages.
#[derive(Default)]
struct Ratios(Vec<Axes>);

impl Ratios {
    /// Prints means and worst stages; `false` if one is beyond its limit.
    fn print(&self, title: &str, limits: Option<[f64; 2]>) -> bool {
        let [mean, worst] = mean_and_worst(&self.0);
        let most = [mean, worst].map(|axes| axes.into_iter().fold(0.0, f64::max));
        let is_within = limits.is_none_or(|limits| most[0] <= limits[0] && most[1] <= limits[1]);
        let limits = limits.map_or(String::new(), |[mean, worst]| {
            let found = if is_within { "met" } else { "MISSED" };
            format!("  limits {mean:.2}, {worst:.2} {found}")
        });
        println!("{title:<58}{}  {}{limits}", words(mean), words(worst));
        is_within
    }
}

/// Prints errors of coefficients, per K.
fn print(title: &str, errors: Coverage) {
    let (percent, count, words) = (errors.rms() * 100.0, errors.count, errors.words());
    println!("{title:<58}{percent:.4} %/K rms, of {count} within 95 % intervals {words}");
}

/// Errors of k of stages with a sensor on the mount only, by a cold run of 30 s and a warm run of 8 s. Mount and
/// body have the same temperature.
fn mount_only(stage: &Stage, stages: u64, spacing_k: f64) -> Fallible<Coverage> {
    let mut all = Coverage::default();
    for seed in 1..=stages {
        let twin = Twin::new(stage, seed);
        let [cold, warm] = [(RUN_30, 0.0), (RUN_8, spacing_k)]
            .map(|(run, change_k)| blind(&twin.planned(&run, steady(change_k)), [true, false]));
        let field = twin.fit(&[&cold, &warm])?.field.ok_or("no field model")?;
        let zero_c = f64::from(field.temperature.temperature.zero_mc[0]) * 1e-3;
        let truth = twin.change([zero_c - 0.5; 2], [zero_c + 0.5; 2]);
        for (probe, truth) in truth.into_iter().enumerate() {
            let found = field.temperature.temperature.per_mk[probe][0] * 1e3;
            all.add(
                found - truth,
                field.temperature.error_per_k[probe][0].powi(2),
            );
        }
    }
    Ok(all)
}

fn main() -> Fallible<()> {
    // Cargo passes `--bench`.
    let stages = std::env::args().skip(1).find_map(|a| a.parse().ok());
    let stages: u64 = stages.unwrap_or(20);
    let stage = shipped::stage();
    println!(
        "errors over the noise, {stages} stages{:>48}",
        "mean X, Y, Rz         worst X, Y, Rz"
    );
    let mut all_met = true;
    for spacing_k in [3.0, 5.0] {
        let mut changes: [Ratios; 4] = Default::default();
        let mut off = Ratios::default();
        for seed in 1..=stages {
            let twin = Twin::new(&stage, seed);
            let cold = twin.planned(&RUN_30, steady(0.0));
            let warm = twin.planned(&RUN_8, steady(spacing_k));
            let fit = twin.fit(&[&cold, &warm])?;
            for (ratios, change_k) in changes.iter_mut().zip(CHANGES_K) {
                ratios.0.push(twin.judge(&fit, &twin.service(change_k))?);
            }
            let warm = changed(&warm, |read_mc| read_mc.map(|mc| mc + 100));
            let fit = twin.fit(&[&cold, &warm])?;
            off.0.push(twin.judge(&fit, &twin.service(10.0))?);
        }
        for ((ratios, change_k), limits) in changes.iter().zip(CHANGES_K).zip(LIMITS) {
            let title = format!("run30, run8 {spacing_k} K warmer; service at {change_k:+} K");
            all_met &= ratios.print(&title, Some(limits));
        }
        let limits = (spacing_k == 5.0).then_some(LIMITS_OFF);
        all_met &= off.print("the same, sensors of run8 0.1 K off; at +10 K", limits);
    }
    let mut days: [Ratios; 4] = Default::default();
    let (mut k, mut h) = (Coverage::default(), Coverage::default());
    for seed in 1..=stages {
        let twin = Twin::new(&stage, seed);
        let at = |hour: f64| Climate::Day { hour };
        let cold = twin.planned(&RUN_30, at(-1.0 / 6.0));
        let early = twin.planned(&RUN_8, at(1.0 / 6.0));
        let warm = twin.planned(&RUN_8, at(3.5));
        let day = twin.record_in(Protocol::Day.run(stage.servo_period_s, seed), at(0.0));
        let none = [&cold, &early, &warm].map(|log| blind(log, [false; 2]));
        let fits: [&[&Recording]; 4] = [
            &[&cold, &early, &warm],
            &[&cold, &warm],
            &[&cold],
            &[&none[0]],
        ];
        for (logs, ratios) in fits.into_iter().zip(&mut days) {
            ratios.0.push(twin.judge(&twin.fit(logs)?, &day)?);
        }
        let field = twin.fit(fits[0])?.field.ok_or("no field model")?;
        let [mount, body] = field
            .temperature
            .temperature
            .zero_mc
            .map(|mc| f64::from(mc) * 1e-3);
        for (sensor, all) in [&mut k, &mut h].into_iter().enumerate() {
            let at = |k: f64| match sensor {
                0 => [mount + k, body],
                _ => [mount, body + k],
            };
            let truth = twin.change(at(-0.5), at(0.5));
            for (probe, truth) in truth.into_iter().enumerate() {
                let found = field.temperature.temperature.per_mk[probe][sensor] * 1e3;
                all.add(
                    found - truth,
                    field.temperature.error_per_k[probe][sensor].powi(2),
                );
            }
        }
    }
    let titles = [
        "cold, early, warm",
        "cold, warm",
        "cold",
        "cold, no temperatures",
    ];
    for (index, (title, ratios)) in titles.into_iter().zip(&days).enumerate() {
        let limits = (index == 0).then_some(LIMITS_DAY);
        all_met &= ratios.print(&format!("{title}; the day"), limits);
    }
    print("k by cold, early, warm", k);
    print("h by cold, early, warm", h);
    for spacing_k in [3.0, 5.0] {
        let found = mount_only(&stage, 5 * stages, spacing_k)?;
        print(&format!("k by run30, run8 {spacing_k} K warmer"), found);
    }
    match all_met {
        true => Ok(()),
        false => Err("a limit is missed".into()),
    }
}
