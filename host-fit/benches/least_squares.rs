//! What the main job costs.
//!
//! Prints `RESULT key=value` lines, medians of several runs.

use host_fit::fit::{FitSettings, ModelChoice, fit};
use host_fit::input::log;
use host_fit::input::shipped::RUN_GZ;
use host_fit::input::stage::Stage;
use host_fit::problem::model::Model;
use host_fit::simulate::assembly::Assembly;
use host_fit::simulate::log_text::log_csv;
use host_fit::simulate::protocol::Protocol;
use host_fit::simulate::recording::record;
use host_fit::simulate::sensors::SensorErrors;
use runtime::ModelKind;
use std::path::Path;
use std::time::Instant;

/// Median time of `runs` calls, ms.
fn median_ms(runs: usize, mut call: impl FnMut()) -> f64 {
    let mut times: Vec<f64> = (0..runs)
        .map(|_| {
            let started = Instant::now();
            call();
            started.elapsed().as_secs_f64() * 1e3
        })
        .collect();
    times.sort_by(f64::total_cmp);
    times[runs / 2]
}

fn main() {
    let stage = Stage::from_toml(host_fit::input::shipped::STAGE_TOML, "stage.toml".as_ref())
        .expect("the shipped stage");
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("log.csv.gz");
    std::fs::write(&path, host_fit::input::shipped::LOG_GZ).expect("written");
    let read = log::read(&[&path], &stage, &log::ReadOptions::default());
    let dataset = read.expect("read").dataset;
    let settings = FitSettings::new(ModelChoice::Named(Model::of(ModelKind::M31)));
    let whole = median_ms(9, || {
        fit(&dataset, &stage, &settings).expect("a fit");
    });
    println!("RESULT fit_and_judge_57000_rows_ms={whole:.1}");
    field_model(&stage, folder.path(), &settings);
}

/// The field model with its covariance, fitted and judged: to the run that ships, and to the paper's
/// protocol and the combined one of a simulated stage together.
fn field_model(stage: &Stage, folder: &Path, settings: &FitSettings) {
    let settings = FitSettings {
        model: ModelChoice::Named(Model::of(ModelKind::Field)),
        ..settings.clone()
    };
    let run = folder.join("run30.csv.gz");
    std::fs::write(&run, RUN_GZ).expect("written");
    let assembly = Assembly::draw(stage, 1);
    let both = [Protocol::Paper, Protocol::Combined].map(|protocol| {
        let run = protocol.run(stage.servo_period_s, 1);
        let recording = record(stage, &assembly, run, &SensorErrors::USUAL, 1).expect("clear");
        let path = folder.join(format!("{protocol:?}.csv"));
        std::fs::write(&path, log_csv(&recording, stage)).expect("written");
        path
    });
    for paths in [&[run][..], &both] {
        let log = log::read(paths, stage, &log::ReadOptions::default()).expect("read");
        let ms = median_ms(9, || {
            fit(&log.dataset, stage, &settings).expect("a fit");
        });
        println!(
            "RESULT fit_field_model_{}_rows_ms={ms:.1}",
            log.dataset.rows.len()
        );
    }
}
