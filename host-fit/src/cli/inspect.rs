//! `host-fit inspect`.

use super::arguments::Json;
use crate::cli::error::HostError;
use crate::cli::terminal;
use crate::output::{blob_file, posterior_file};
use crate::report::errors;
use crate::report::figure::{Figure, Group, figure, group};
use crate::report::parameters::{self, parameters_in};
use crate::report::provenance::hex;
use crate::report::table::Table;
use crate::report::text::as_text;
use clap::Args;
use hallstage_input::axis::{AXES, Axis, PROBES};
use hallstage_solver::estimator::model::Model;
use hallstage_solver::estimator::posterior::temperature_errors;
use runtime::matrix::to_rows;
use runtime::{ModelKind, ParameterSet};
use serde_json::{Value, json};
use std::path::PathBuf;

/// Arguments of `inspect`.
#[derive(Debug, Args)]
pub(super) struct InspectArgs {
    /// The parameter blob.
    #[arg(value_name = "params.bin")]
    params: PathBuf,
    #[command(flatten)]
    json: Json,
}

/// Shows every field of a blob, and the faults that its calibration is without where its posterior tells.
pub(super) fn run(args: &InspectArgs) -> Result<(), HostError> {
    super::check_outputs([args.json.path.as_deref()], None, [args.params.as_path()])?;
    args.json.check_own()?;
    let set = blob_file::read(&args.params)?;
    let known = posterior_file::read(&set, &args.params).ok().flatten();
    let errors = known
        .as_ref()
        .and_then(|known| temperature_errors(&known.covariance));
    let mut figures = figures(&set, errors.map(|errors| json!(errors)));
    let repaired = known.map(|known| known.repaired);
    figures.set("repaired", json!(repaired));
    args.json.write(&figures)?;
    let parameters = parameters::tables(&parameters_in(&set), &[]);
    let mut text = as_text(&[figures.tables(), matrices(&set), parameters].concat());
    if repaired.is_none() && set.model == ModelKind::Field {
        text += "\nfaults taken off: not known, its .posterior is not beside the blob\n";
    }
    terminal::print(&text)?;
    let repaired = repaired.unwrap_or_default();
    let taken_off = repaired.iter().map(|fault| format!("taken off: {fault}"));
    terminal::warn(&taken_off.collect::<Vec<_>>());
    warn_if_forced(&set);
    Ok(())
}

/// Warns of a blob that was written with `--force`.
pub(super) fn warn_if_forced(set: &ParameterSet) {
    if set.fit.forced {
        terminal::warn(&[
            "the log was refused, or the errors beyond --limit: written all the same (--force)"
                .to_owned(),
        ]);
    }
}

/// rms and peak of X, Y, Rz as a blob or a controller holds them.
pub(super) fn errors(rms: [f32; 3], peak: [f32; 3]) -> Group {
    errors::from_rms_and_peak(rms.map(f64::from), peak.map(f64::from))
}

/// A matrix with the names and units of its rows and columns.
fn matrix<const N: usize>(
    title: &str,
    names: [&str; 3],
    columns: [&str; N],
    rows: &[[f32; N]; 3],
) -> Table {
    let mut table = Table::new(title, &columns);
    for (name, row) in names.into_iter().zip(rows) {
        table.row(name, row.map(|x| f64::from(x).into()));
    }
    table
}

/// The matrices of a blob.
fn matrices(set: &ParameterSet) -> Vec<Table> {
    const PLANAR: [&str; 3] = ["X, m", "Y, m", "Rz, rad"];
    const VERTICAL: [&str; 3] = ["Z, m", "Rx, rad", "Ry, rad"];
    const GAPS: [&str; 3] = ["gap 1, m", "gap 2, m", "gap 3, m"];
    const HALL: [&str; 3] = ["A, m", "B, m", "C, m"];
    let (c, capacitive) = (&set.constants, &set.capacitive);
    let vertical = to_rows(&capacitive.vertical_per_m);
    #[rustfmt::skip]
    let mut all = vec![
        matrix("plane matrix", HALL, PLANAR, &to_rows(&set.plane)),
        matrix("plane matrix inverse", PLANAR, HALL, &to_rows(&set.plane_inverse)),
        matrix("capacitive plane matrix", VERTICAL, GAPS, &vertical),
        matrix("planar per code", PLANAR, PROBES, &c.planar_per_code),
        matrix("vertical per code", VERTICAL, ["gap 1", "gap 2", "gap 3"], &c.vertical_per_code),
    ];
    if c.temperature.is_used() {
        let per_k = c.temperature.per_mk.map(|row| row.map(|x| x * 1e3));
        all.push(matrix("temperature", PROBES, ["k, 1/K", "h, 1/K"], &per_k));
    }
    if let Some(motion) = &set.motion_correction {
        let a = [
            "X, m/s2",
            "Y, m/s2",
            "Rz, rad/s2",
            "Z, m/s2",
            "Rx, rad/s2",
            "Ry, rad/s2",
        ];
        let v = ["X, m/s", "Y, m/s", "Rz, rad/s"];
        all.push(matrix(
            "correction by acceleration",
            PLANAR,
            a,
            &motion.acceleration_s2,
        ));
        all.push(matrix(
            "correction by velocity",
            PLANAR,
            v,
            &motion.velocity_s,
        ));
    }
    all
}

/// Two whole numbers of thousandths of a unit.
fn thousandths<T: Into<f64>>(values: [T; 2], unit: &'static str) -> Figure {
    let one = |value: T| figure(value.into() * 1e-3, unit);
    values.into_iter().map(one).collect()
}

fn figures(set: &ParameterSet, errors_per_k: Option<Value>) -> Group {
    let c = &set.constants;
    let per_count = |scale: f32| figure(f64::from(scale), "m/count");
    let ends = [c.calibrated_planar, c.calibrated_vertical].concat();
    let range = |(axis, end): (&Axis, f32)| {
        (
            axis.key.to_owned(),
            figure(f64::from(end), axis.unit).into(),
        )
    };
    let window = |window: &runtime::frame::CodeWindow| {
        [window.low, window.high].into_iter().collect::<Figure>()
    };
    let mut figures = group! {
        "layout_version" => u32::from(set.layout_version()),
        "model" => Model::from_kind(set.model).name,
        "serial" => set.serial.as_str(),
        "created" => set.created.as_str(),
        "logs_sha256" => hex(&set.logs_sha256),
        "fit" => group! {
            "rows" => set.fit.rows,
            "train_rows" => set.fit.train_rows,
            "forced" => set.fit.forced,
            "errors" => errors(set.fit.rms, set.fit.peak),
        },
        "parameters" => json!(parameters_in(set)),
        "plane_matrix" => json!(to_rows(&set.plane)),
        "plane_matrix_inverse" => json!(to_rows(&set.plane_inverse)),
        "hall" => per_count(set.hall.m_per_code),
        "capacitive" => per_count(set.capacitive.m_per_code),
        "capacitive_plane_matrix" => json!(to_rows(&set.capacitive.vertical_per_m)),
        "planar_per_code" => json!(c.planar_per_code),
        "vertical_per_code" => json!(c.vertical_per_code),
        "calibrated_range" => Group(AXES.iter().zip(ends).map(range).collect()),
        "sensitivity_min" => f64::from(c.sensitivity_min),
        "hall_codes" => window(&c.hall_window),
        "capacitive_codes" => window(&c.capacitive_window),
    };
    if c.temperature.is_used() {
        let per_k = (c.temperature.per_mk).map(|row| row.map(|x| f64::from(x) * 1e3));
        let mut temperature = group! {
            "k_h_per_k" => json!(per_k),
            "t0" => thousandths(c.temperature.zero_mc, "degC"),
            "reach" => thousandths(c.temperature.reach_mk, "K"),
        };
        if let Some(errors) = errors_per_k {
            temperature.set("standard_errors_per_k", errors);
        }
        figures.set("temperature", temperature);
    }
    if let Some(motion) = &set.motion_correction {
        let motion =
            json!({ "acceleration_s2": motion.acceleration_s2, "velocity_s": motion.velocity_s });
        figures.set("motion_correction", motion);
    }
    figures
}
