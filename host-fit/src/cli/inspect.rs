//! `host-fit inspect`.

use super::args::Json;
use super::report::Report;
use crate::cli::error::HostError;
use crate::cli::terminal;
use crate::output::{blob_file, posterior_file};
use crate::report::errors;
use crate::report::parameters::{self, parameters_in};
use crate::report::provenance::hex;
use crate::report::table::{as_text, tables};
use clap::Args;
use hallstage_solver::problem::model::Model;
use hallstage_solver::solve::field::posterior::warmth_errors;
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
    super::check_outputs(
        [args.json.path.as_deref()],
        &Report::default(),
        [args.params.as_path()],
    )?;
    let set = blob_file::read(&args.params)?;
    let posterior = posterior_file::beside(&args.params);
    let known = posterior.and_then(|path| posterior_file::read(&path, &set, &args.params).ok());
    let mut figures = figures(&set);
    let errors = known
        .as_ref()
        .and_then(|known| warmth_errors(&known.covariance));
    if let (Some(errors), true) = (errors, set.constants.temperature.is_used()) {
        figures["temperature"]["standard_errors_per_k"] = json!(errors);
    }
    let repaired = known.map(|known| known.repaired);
    figures["repaired"] = json!(repaired);
    args.json.write(&figures)?;
    let parameters = parameters::tables(&parameters_in(&set), &[]);
    let fields = tables(&figures, &["parameters", "repaired"]);
    let mut text = as_text(&[fields, parameters].concat());
    if repaired.is_none() && set.model == ModelKind::Field {
        text += "\nfaults taken off: not known, its .posterior is not beside the blob\n";
    }
    terminal::print(&text)?;
    let repaired = repaired.unwrap_or_default();
    let taken_off = repaired.iter().map(|fault| format!("taken off: {fault}"));
    terminal::warn(&taken_off.collect::<Vec<_>>());
    if set.fit.forced {
        terminal::warn(&[
            "the log was refused, or the errors beyond --limit: written all the same (--force)"
                .to_owned(),
        ]);
    }
    Ok(())
}

/// rms and peak of X, Y, Rz as a blob or a controller holds them.
pub(super) fn errors(rms: [f32; 3], peak: [f32; 3]) -> Value {
    errors::of(rms.map(f64::from), peak.map(f64::from))
}

fn figures(set: &ParameterSet) -> Value {
    let c = &set.constants;
    let temperature = c.temperature.is_used().then(|| {
        json!({
            "k_h_per_k": c.temperature.per_mk.map(|row| row.map(|x| f64::from(x) * 1e3)),
            "t0_c": c.temperature.zero_mc.map(|mc| f64::from(mc) * 1e-3),
            "reach_k": c.temperature.reach_mk.map(|mk| f64::from(mk) * 1e-3),
        })
    });
    let mut figures = json!({
        "layout_version": set.layout_version(),
        "model": Model::of(set.model).name,
        "serial": set.serial.as_str(),
        "created": set.created.as_str(),
        "logs_sha256": hex(&set.logs_sha256),
        "fit": {
            "rows": set.fit.rows,
            "train_rows": set.fit.train_rows,
            "forced": set.fit.forced,
            "errors": errors(set.fit.rms, set.fit.peak),
        },
        "parameters": parameters_in(set),
        "plane_matrix": to_rows(&set.plane),
        "plane_matrix_inverse": to_rows(&set.plane_inverse),
        "hall_m_per_count": set.hall.m_per_code,
        "capacitive_m_per_count": set.capacitive.m_per_code,
        "capacitive_plane_matrix": to_rows(&set.capacitive.vertical_per_m),
        "planar_per_code": c.planar_per_code,
        "vertical_per_code": c.vertical_per_code,
        "calibrated_range": {
            "x_m": c.calibrated_planar[0], "y_m": c.calibrated_planar[1], "rz_rad": c.calibrated_planar[2],
            "z_m": c.calibrated_vertical[0], "rx_rad": c.calibrated_vertical[1], "ry_rad": c.calibrated_vertical[2],
        },
        "sensitivity_min": c.sensitivity_min,
        "hall_codes": [c.hall_window.low, c.hall_window.high],
        "capacitive_codes": [c.capacitive_window.low, c.capacitive_window.high],
    });
    if let Some(temperature) = temperature {
        figures["temperature"] = temperature;
    }
    figures
}
