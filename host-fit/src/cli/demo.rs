//! `host-fit demo`: the main job on the logs that ship with the program, beside the figures of the paper.

use super::interrupt;
use crate::cli::error::HostError;
use crate::cli::terminal;
use crate::output::pose_file::{DecodeSettings, PoseFormat, decode_log};
use crate::output::{self, Output, Outputs, posterior_file};
use crate::report::errors::{self, RowErrors, error_table, to_micro};
use crate::report::parameters::{self, parameters};
use crate::report::text::as_text;
use clap::Args;
use hallstage_calibration::fit::{Fit, FitError, FitSettings, ModelChoice, fit};
use hallstage_calibration::judge::precision::largest_difference;
use hallstage_calibration::judge::statistics::over_noise;
use hallstage_calibration::judge::{Decoded, Zeros};
use hallstage_calibration::plan::plan;
use hallstage_calibration::recalibrate::StoredPosterior;
use hallstage_input::dataset::{Dataset, Row};
use hallstage_input::log::{self, ReadOptions};
use hallstage_input::shipped::{FILES, STAGE_TOML};
use hallstage_input::stage::Stage;
use hallstage_simulate::assembly::Assembly;
use hallstage_simulate::dynamics::MotionEffects;
use hallstage_simulate::protocol::{Protocol, REST_S, Run};
use hallstage_simulate::recording::{Recording, record_in, record_stage};
use hallstage_simulate::sensors::SensorErrors;
use hallstage_simulate::thermal::{Climate, Thermal};
use hallstage_solver::estimator::model::Model;
use hallstage_solver::estimator::robust::Loss;
use runtime::frame::MISSING_CODE;
use runtime::geometry::ProbeGeometry;
use runtime::tracker::OnInvalid;
use runtime::{ModelKind, ParameterSet};
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Arguments of `demo`.
#[derive(Debug, Args)]
pub(super) struct DemoArgs {
    /// Where to keep logs, stage.toml, both blobs and pose.csv; a temporary folder if not given.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

/// Length of the runs that are fitted, s.
const RUN_S: f64 = 30.0;

const PREFACE: &str = "\
The paper's stage is not this one, so its figures show what to expect, not what to match: comparable
are the protocol, the models and the order of improvement; not the parameters of a particular stage.
Its Tables 4 and 8 come from a population search on 100 and 200 rows, ours from least squares on all.
In service all six axes move, errors are against the true pose, and no zero deviation is taken off.

";

/// rms and peak of X, Y (um) and Rz (urad) as the tables of the paper print them: Table 2, designed
/// parameters and Model (15); Table 4, Model (30); Table 8, Model (31).
const TABLE_2: [[f64; 2]; 3] = [[27.8795, 61.2092], [44.1243, 119.9458], [89.2927, 221.5275]];
const TABLE_4: [[f64; 2]; 3] = [[2.1896, 10.6451], [4.2560, 19.2473], [2.9176, 15.0316]];
const TABLE_8: [[f64; 2]; 3] = [[1.3919, 6.6368], [1.5381, 5.9375], [2.3057, 9.6300]];

/// Table 7 by name, SI: lever arms from its coordinates.
fn table_7() -> BTreeMap<String, f64> {
    let theta = [0.0145f64, 0.4143, -0.0561].map(f64::to_radians);
    let places_m = [[0.1944, 0.3381], [-0.2173, 0.3555], [0.1979, 0.3293]];
    let arms = ProbeGeometry::from_places(places_m, theta).lever_arm_m;
    let eta = [0.8671, 0.7049, 0.8632];
    let a = [-188.1873, -156.5783, -178.1902];
    let b = [-69.7432, -56.7511, -63.4133];
    let c = [14.8664, -55.0764, 12.7241];
    let values = [arms, theta, eta, a, b, c].concat();
    let ids = Model::from_kind(ModelKind::M31).parameters();
    ids.map(|id| (id.name(), values[id.index])).collect()
}

/// Whether a movement was made at Z = +-250 um without tilt, as for Tables 2 and 4.
fn at_250_um(rows: &[Row]) -> bool {
    let n = rows.len().max(1) as f64;
    let mean = |axis: usize| rows.iter().map(|r| r.vertical[axis]).sum::<f64>() / n * 1e6;
    (mean(0).abs() - 250.0).abs() < 5.0 && mean(1).abs() < 5.0 && mean(2).abs() < 5.0
}

/// Runs the demo and prints what the paper prints.
pub(super) fn run(args: &DemoArgs) -> Result<(), HostError> {
    let started = Instant::now();
    let temporary;
    let folder = match &args.out {
        Some(folder) => {
            output::make_folder(folder)?;
            folder.as_path()
        }
        None => {
            temporary = tempfile::tempdir().map_err(|error| {
                HostError::input(format!(
                    "cannot make a temporary folder: {error}; name one with --out"
                ))
            })?;
            temporary.path()
        }
    };
    terminal::print(PREFACE)?;
    let (text, files) = job(folder)?;
    terminal::print(&text)?;
    terminal::print(&format!(
        "\nall of this took {:.2} s\n",
        started.elapsed().as_secs_f64()
    ))?;
    match args.out {
        Some(_) => super::wrote(files),
        None => terminal::print("logs, stage.toml, blobs and poses are kept with --out DIR\n"),
    }
}

/// Writes logs and stage into `folder`, fits, decodes, judges. Gives what it shows, and the files. Refuses
/// a folder with a file of such a name that is not of an earlier demo: its stage file shows that.
fn job(folder: &Path) -> Result<(String, Vec<PathBuf>), HostError> {
    let results = ["params.bin", "pose.csv", "field.bin", "field.bin.posterior"];
    let names = FILES.iter().map(|(name, _)| *name).chain(results);
    let files: Vec<PathBuf> = names.map(|name| folder.join(name)).collect();
    let is_demo = fs::read(&files[3]).is_ok_and(|text| text == STAGE_TOML.as_bytes());
    if let Some(file) = files.iter().find(|file| file.exists() && !is_demo) {
        let there = file.display();
        let problem =
            format!("{there} is there already and is not of this demo; name another folder");
        return Err(HostError::usage("--out", problem));
    }
    for ((_, bytes), path) in FILES.iter().zip(&files) {
        output::write_atomically(path, bytes)?;
    }
    let stage = Stage::from_file(&files[3])?;
    let read = |k: usize| -> Result<Dataset, HostError> {
        let log = log::read(&files[k..=k], &stage, &ReadOptions::default())?;
        Ok(log.dataset)
    };
    let (paper, run, service) = (read(0)?, read(1)?, read(2)?);
    let heights = paper.only(at_250_um);
    let fitted = |dataset: &Dataset, kind| {
        let settings = FitSettings {
            loss: Loss::None,
            ..FitSettings::new(ModelChoice::Named(Model::from_kind(kind)))
        };
        fit(dataset, &stage, &settings)
    };
    let judged = |set: &ParameterSet, dataset: &Dataset, zeros| {
        let decoded = Decoded::new(set, dataset);
        decoded.judge(dataset, &stage, zeros).errors
    };
    let designed = errors::designed(&heights, &stage);
    let designed = designed.map_or([[f64::NAN; 2]; 3], |(_, errors)| to_micro(&errors));
    let model_30 = fitted(&heights, ModelKind::M30)?;
    let model_31 = fitted(&paper, ModelKind::M31)?;
    let model_31_of_run = fitted(&run, ModelKind::M31)?;
    let field = fitted(&run, ModelKind::Field)?;
    let field_of_service = fitted(&service, ModelKind::Field)?;

    let mut outputs = Outputs::default();
    posterior_file::add_calibration(&mut outputs, &files[4], &model_31.set, None)?;
    let known = StoredPosterior::from_fit(&field);
    posterior_file::add_calibration(&mut outputs, &files[6], &field.set, known.as_ref())?;
    outputs.commit()?;
    let decoding = DecodeSettings {
        correction: None,
        decoder: &model_31.set.decoder(),
        on_invalid: OnInvalid::Zero,
        known: None,
        format: PoseFormat::Csv,
        watch: interrupt::WATCH,
    };
    let poses = Output::create(&files[5])?;
    decode_log::<HostError>(&files[0], &stage, &decoding, poses)?;

    let in_service = |fit: &Fit| to_micro(&judged(&fit.set, &service, Zeros::None));
    let paper_s = "  the paper's";
    let errors = error_table(
        "Errors, rms and peak",
        [
            (
                "Table 2: designed values, Model (15), Z = ±250 µm",
                designed,
            ),
            (paper_s, TABLE_2),
            (
                "Table 4: Model (30) fitted to the same movements",
                to_micro(&model_30.judgement.errors),
            ),
            (paper_s, TABLE_4),
            (
                "the same at all 19 vertical settings",
                to_micro(&judged(&model_30.set, &paper, Zeros::Refit)),
            ),
            (
                "Table 8: Model (31) fitted to all rows",
                to_micro(&model_31.judgement.errors),
            ),
            (paper_s, TABLE_8),
            (
                "in service: Model (31), of the paper's protocol, 114 s",
                in_service(&model_31),
            ),
            (
                "in service: Model (31), of the run of 30 s",
                in_service(&model_31_of_run),
            ),
            (
                "in service: field model, of the run of 30 s",
                in_service(&field),
            ),
            (
                "in service: by the noise of the probes alone",
                in_service(&field_of_service),
            ),
        ],
    );
    let beside = [
        ("designed", parameters::designed(&stage)),
        ("paper", table_7()),
    ];
    let fit_table = parameters(
        model_31.model,
        &model_31.estimate.parameters.model_31(),
        &model_31.estimate.posterior.standard_errors_31(),
    );
    let mut tables = parameters::tables(&fit_table, &beside);
    for table in &mut tables {
        table.title =
            "Table 7: parameters (lever arms in place of H, which no data can separate)".to_owned();
    }
    tables.insert(0, errors);
    let text = as_text(&tables)
        + "\nf32 against f64, largest\n"
        + &rounding("Model (31), its own log", &model_31, &paper)?
        + &rounding("field model, in service", &field, &service)?
        + &day(&stage)?
        + &fast_moves(&stage)?;
    Ok((text, files))
}

/// A line about the working day of a simulated stage, calibrated by three logs of its morning with their
/// temperatures, or by the first without.
fn day(stage: &Stage) -> Result<String, HostError> {
    const SEED: u64 = 1;
    let (assembly, thermal) = (Assembly::draw(stage, SEED), Thermal::draw(SEED));
    let record = |run, hour| {
        let (parts, errors) = ((&assembly, &thermal), &SensorErrors::USUAL);
        record_in(stage, parts, Climate::Day { hour }, run, errors, SEED)
    };
    let planned = |seconds: f64, hour: f64| -> Result<Recording, HostError> {
        let run = plan(stage, seconds)?.run;
        Ok(record(
            Run::planned(run.trajectory(stage.servo_period_s)),
            hour,
        )?)
    };
    let cold = planned(RUN_S, -1.0 / 6.0)?;
    let (early, warm) = (planned(8.0, 1.0 / 6.0)?, planned(8.0, 3.5)?);
    let day = record(Protocol::Day.run(stage.servo_period_s, SEED), 0.0)?;
    let mut blind = cold.clone();
    let samples = blind.movements.iter_mut().flatten();
    samples.for_each(|sample| sample.temperature_mc = [MISSING_CODE; 2]);
    let day = day.dataset_with_truth(stage).unwrap_or_default();
    let ratios = |logs: &[&Recording]| -> Result<String, HostError> {
        let fit = field_fit(logs, stage)?;
        let errors = Decoded::new(&fit.set, &day).rezeroed(&day, REST_S);
        Ok(in_noise(&errors, &day))
    };
    let (with, without) = (ratios(&[&cold, &early, &warm])?, ratios(&[&blind])?);
    Ok(format!(
        "\na simulated day, body 5 K warmer: rms of X / Y / Rz over the noise {with}; without temperature {without}\n"
    ))
}

/// A line about fast moves of a simulated stage with late probes and arms that bend.
fn fast_moves(stage: &Stage) -> Result<String, HostError> {
    const SEED: u64 = 7;
    let dynamics = MotionEffects::draw([3e-4, -3e-4, 0.0], None, Some(120.0), SEED);
    let record = |run| record_stage(stage, run, None, dynamics, SEED);
    let planned = plan(stage, RUN_S)?.run.trajectory(stage.servo_period_s);
    let fit = field_fit(&[&record(Run::planned(planned))?], stage)?;
    let fast = record(Protocol::Fast.run(stage.servo_period_s, SEED))?;
    let fast = fast.dataset_with_truth(stage).unwrap_or_default();
    let decoded = Decoded::new(&fit.set, &fast);
    let correction = fit.set.motion_correction.unwrap_or_default();
    let corrected = decoded.corrected(&correction, &fast);
    let [without, with] = [decoded, corrected].map(|decoded| in_noise(&decoded.errors, &fast));
    Ok(format!(
        "fast moves, probes up to 0.6 ms apart, arms that bend: {without}; with the motion correction {with}\n"
    ))
}

/// A fit of the field model to these recordings.
fn field_fit(logs: &[&Recording], stage: &Stage) -> Result<Fit, HostError> {
    let dataset = Recording::joined(logs, stage).unwrap_or_default();
    let model = ModelChoice::Named(Model::from_kind(ModelKind::Field));
    Ok(fit(&dataset, stage, &FitSettings::new(model))?)
}

/// rms of errors of X / Y / Rz over their noise.
fn in_noise(errors: &RowErrors, dataset: &Dataset) -> String {
    let [x, y, rz] = over_noise(errors, &dataset.movements);
    format!("{x:.2} / {y:.2} / {rz:.2}")
}

/// The largest difference of the target's `f32` from `f64` over the rows of a log, in a line.
fn rounding(what: &str, fit: &Fit, dataset: &Dataset) -> Result<String, HostError> {
    let calibration = &fit.calibration;
    let constants = calibration.constants().map_err(FitError::Unusable)?;
    let decoder = fit.set.decoder();
    let largest = largest_difference(&constants, &calibration.probes, &decoder, dataset);
    let [x, y, rz] = largest.map(|d| d * 1e9);
    Ok(format!(
        "  {what}: X {x:.3} nm, Y {y:.3} nm, Rz {rz:.3} nrad\n"
    ))
}
