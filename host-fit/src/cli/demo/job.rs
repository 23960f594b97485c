//! The main job on the log that ships with the program, beside the figures of the paper.

use super::service::Service;
use crate::cli::error::HostError;
use crate::fit::{Fit, FitSettings, ModelChoice, calibration, fit};
use crate::input::dataset::{Dataset, Row};
use crate::input::log::{self, ReadOptions};
use crate::input::shipped::{LOG_GZ, RUN_GZ, SERVICE_GZ, STAGE_TOML};
use crate::input::stage::Stage;
use crate::judge::statistics::PoseError;
use crate::judge::{Decoded, Zeros};
use crate::output;
use crate::output::blob_file;
use crate::output::{pose_file, posterior_file};
use crate::problem::model::Model;
use crate::problem::parameters::Parameters;
use crate::problem::zero_deviation::ZeroDeviation;
use crate::solve::Solver;
use crate::solve::robust::Loss;
use runtime::ModelKind;
use runtime::calibration::Origin;
use runtime::geometry::ProbeCoordinates;
use runtime::servo::OnInvalid;
use std::fs;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// rms and peak of X, Y (um) and Rz (urad) as a table of the paper prints them.
pub type PaperErrors = [(f64, f64); 3];
/// Table 2: designed parameters, Model (15).
pub const TABLE_2: PaperErrors = [(27.8795, 61.2092), (44.1243, 119.9458), (89.2927, 221.5275)];
/// Table 4: Model (30).
pub const TABLE_4: PaperErrors = [(2.1896, 10.6451), (4.2560, 19.2473), (2.9176, 15.0316)];
/// Table 8: Model (31).
pub const TABLE_8: PaperErrors = [(1.3919, 6.6368), (1.5381, 5.9375), (2.3057, 9.6300)];

/// Table 7 in the order of the parameters here: lever arms from its coordinates, degrees.
pub fn table_7() -> [f64; 18] {
    let theta_deg = [0.0145, 0.4143, -0.0561];
    let arms = ProbeCoordinates {
        h1x_m: 0.1944,
        h1y_m: 0.3381,
        h2x_m: 0.2173,
        h2y_m: 0.3555,
        h3x_m: 0.1979,
        h3y_m: 0.3293,
    }
    .lever_arms_m(theta_deg.map(f64::to_radians));
    let [a, b, c] = arms;
    let [ta, tb, tc] = theta_deg;
    [
        a, b, c, ta, tb, tc, 0.8671, 0.7049, 0.8632, -188.1873, -156.5783, -178.1902, -69.7432,
        -56.7511, -63.4133, 14.8664, -55.0764, 12.7241,
    ]
}

/// Everything that the demo shows.
#[derive(Debug)]
pub struct Demo {
    /// The stage that ships with the program.
    pub stage: Stage,
    /// Designed parameters, Model (15), movements at Z = +-250 um.
    pub designed: PoseError,
    /// Model (30), fitted to the same movements.
    pub model_30: Fit,
    /// The parameters of that fit, over all rows.
    pub model_30_everywhere: PoseError,
    /// Model (31), all rows.
    pub model_31: Fit,
    /// Its zero deviations beside the vertical setting (um, urad, urad) of each movement.
    pub zero_deviations: Vec<([f64; 3], ZeroDeviation)>,
    /// Errors of the pose file that was written, read back.
    pub decoded: PoseError,
    /// Largest difference of the target's `f32` from `f64`, m, m, rad.
    pub f32_difference: [f64; 3],
    /// What calibrations are worth in service.
    pub(super) service: Service,
    /// Reading the log.
    pub reading: Duration,
    /// Fitting and judging Model (31).
    pub fitting: Duration,
    /// Files written.
    pub files: Vec<PathBuf>,
}

/// Mean vertical pose of a movement, um, urad, urad.
fn setting(rows: &[Row]) -> [f64; 3] {
    let n = rows.len().max(1) as f64;
    std::array::from_fn(|axis| rows.iter().map(|r| r.vertical[axis]).sum::<f64>() / n * 1e6)
}

/// Whether a movement was made at Z = +-250 um without tilt, as for Tables 2 and 4.
fn at_250_um(rows: &[Row]) -> bool {
    let [z, rx, ry] = setting(rows);
    (z.abs() - 250.0).abs() < 5.0 && rx.abs() < 5.0 && ry.abs() < 5.0
}

/// Runs the demo in `folder`, which must exist; log, stage, blob and poses are left there.
///
/// # Errors
/// [`HostError`] when a file cannot be written, or one of these names is there that is not of an
/// earlier demo: its stage file tells.
pub fn run(folder: &Path) -> Result<Demo, HostError> {
    let files = [
        "paper.csv.gz",
        "run30.csv.gz",
        "service.csv.gz",
        "stage.toml",
        "params.bin",
        "pose.csv",
        "field.bin",
        "field.bin.posterior",
    ]
    .map(|name| folder.join(name));
    let [
        log_path,
        run_path,
        service_path,
        stage_path,
        blob_path,
        pose_path,
        field_path,
        posterior_path,
    ] = &files;
    let of_a_demo = fs::read(stage_path).is_ok_and(|text| text == STAGE_TOML.as_bytes());
    if let Some(file) = files.iter().find(|file| file.exists() && !of_a_demo) {
        return Err(HostError::Usage {
            argument: "--out",
            problem: format!(
                "{} is there already and is not of this demo; name another folder",
                file.display()
            ),
        });
    }
    output::write_atomically(log_path, LOG_GZ)?;
    output::write_atomically(run_path, RUN_GZ)?;
    output::write_atomically(service_path, SERVICE_GZ)?;
    output::write_atomically(stage_path, STAGE_TOML.as_bytes())?;

    let started = Instant::now();
    let stage = Stage::from_file(stage_path)?;
    let log = log::read(
        std::slice::from_ref(log_path),
        &stage,
        &ReadOptions::default(),
    )?;
    let dataset = &log.dataset;
    let reading = started.elapsed();

    let heights = dataset.only(at_250_um);
    let designed = designed_errors(&heights, &stage)?;
    let model_30 = fit(&heights, &stage, &settings(ModelKind::M30))?;
    let model_30_everywhere = Decoded::new(&model_30.set, dataset)
        .judge(dataset, &stage, Zeros::Refit)
        .errors;
    let started = Instant::now();
    let model_31 = fit(dataset, &stage, &settings(ModelKind::M31))?;
    let fitting = started.elapsed();

    blob_file::write(blob_path, &model_31.set)?;
    let set = blob_file::read(blob_path)?;
    let decoded = pose_file::decode(dataset, &set.decoder(), OnInvalid::Zero);
    output::write_atomically(pose_path, &pose_file::to_text(&decoded))?;
    let errors = pose_file_errors(pose_path, dataset, &stage, &model_31.solution.parameters)?;
    let service = Service::new(&stage, &set)?;
    if let Some(known) = &service.known {
        let bytes = posterior_file::to_bytes(posterior_path, &service.field, known)?;
        output::write_atomically(posterior_path, &bytes)?;
    }
    blob_file::write(field_path, &service.field)?;
    let constants = model_31
        .calibration
        .constants()
        .map_err(crate::fit::FitError::Unusable)?;
    let probes = model_31.calibration.probes;
    let movements = dataset.movements.iter().zip(&model_31.judgement.zeros);
    Ok(Demo {
        designed,
        model_30,
        model_30_everywhere,
        zero_deviations: movements
            .map(|(movement, zero)| (setting(&dataset.rows[movement.rows.clone()]), *zero))
            .collect(),
        model_31,
        decoded: errors,
        f32_difference: crate::judge::precision::largest_difference(
            &constants,
            &probes,
            &set.decoder(),
            dataset,
        ),
        reading,
        fitting,
        service,
        files: files.to_vec(),
        stage,
    })
}

pub(super) fn settings(model: ModelKind) -> FitSettings {
    FitSettings {
        solver: Solver::Finished,
        loss: Loss::None,
        ..FitSettings::new(ModelChoice::Named(Model::of(model)))
    }
}

/// Table 2: Model (15) with the designed parameters, no zero deviation.
fn designed_errors(dataset: &Dataset, stage: &Stage) -> Result<PoseError, HostError> {
    let designed = calibration(
        &dataset.rows,
        stage,
        Model::of(ModelKind::M15),
        &Parameters::designed(stage),
    )?;
    let set = designed
        .prepare(&Origin::default())
        .map_err(crate::fit::FitError::Unusable)?;
    Ok(Decoded::new(&set, dataset)
        .judge(dataset, stage, Zeros::None)
        .errors)
}

/// Errors of a pose file on the log it was decoded from, zero deviations refitted.
fn pose_file_errors(
    path: &Path,
    dataset: &Dataset,
    stage: &Stage,
    parameters: &Parameters,
) -> Result<PoseError, HostError> {
    let error = |(pose, row): (&pose_file::PoseRow, &Row)| {
        let decoded = pose.reading.planar()?.to_array();
        Some([0, 1, 2].map(|k| f64::from(decoded[k]) - row.reference[k]))
    };
    let poses = pose_file::read(path)?;
    let decoded = Decoded {
        parameters: *parameters,
        errors: poses.iter().zip(&dataset.rows).map(error).collect(),
    };
    Ok(decoded.judge(dataset, stage, Zeros::Refit).errors)
}
