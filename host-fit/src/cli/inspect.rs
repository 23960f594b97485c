//! `host-fit inspect`.

use crate::cli::error::HostError;
use crate::cli::terminal;
use crate::output::blob_file;
use crate::problem::model::Model;
use crate::problem::terms::shown;
use crate::report::parameters::parameters_in;
use crate::report::provenance::hex;
use clap::Args;
use runtime::ParameterSet;
use serde_json::json;
use std::fmt::Write;
use std::path::PathBuf;

/// Arguments of `inspect`.
#[derive(Debug, Args)]
pub(super) struct InspectArgs {
    /// The parameter blob.
    #[arg(value_name = "params.bin")]
    params: PathBuf,
    /// Write everything as JSON; `-` for standard output.
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// Shows every field of a blob.
pub(super) fn run(args: &InspectArgs) -> Result<(), HostError> {
    super::keep_apart(&[args.json.as_deref()], &[&args.params])?;
    let set = blob_file::read(&args.params)?;
    if let Some(path) = &args.json {
        super::write_json(&as_json(&set), path)?;
    }
    terminal::print(&as_text(&set))
}

/// A text of a blob, in a line of its own.
pub(super) fn or_dash(text: &str) -> String {
    match text {
        "" => "-".to_owned(),
        text => terminal::plain(text, "").into_owned(),
    }
}

/// Errors of a fit in X, Y, Rz (m, m, rad), as a line.
pub(super) fn errors(errors: [f32; 3]) -> String {
    let shown = |e: Option<f64>| e.map_or_else(|| "unknown".to_owned(), |e| format!("{e:.3}"));
    let [x, y, rz] = errors.map(micro).map(shown);
    format!("{x} um, {y} um, {rz} urad")
}

/// An error of a fit in um or urad. None is below zero, or 1 m or more, which the blob of another
/// program may hold.
pub(super) fn micro(error: f32) -> Option<f64> {
    (0.0..1.0).contains(&error).then(|| f64::from(error) * 1e6)
}

fn as_json(set: &ParameterSet) -> serde_json::Value {
    let c = &set.constants;
    json!({
        "layout_version": set.layout_version(),
        "model": Model::of(set.model).name,
        "serial": set.serial.as_str(),
        "created": set.created.as_str(),
        "logs_sha256": hex(&set.logs_sha256),
        "fit": {
            "rows": set.fit.rows,
            "train_rows": set.fit.train_rows,
            "forced": set.fit.forced,
            "errors": {
                "x": { "rmse_um": micro(set.fit.rms[0]), "peak_um": micro(set.fit.peak[0]) },
                "y": { "rmse_um": micro(set.fit.rms[1]), "peak_um": micro(set.fit.peak[1]) },
                "rz": { "rmse_urad": micro(set.fit.rms[2]), "peak_urad": micro(set.fit.peak[2]) },
            },
        },
        "parameters": parameters_in(set),
        "plane_matrix": set.plane,
        "plane_matrix_inverse": set.plane_inverse,
        "hall_m_per_count": set.hall.m_per_code,
        "capacitive_m_per_count": set.capacitive.m_per_code,
        "capacitive_plane_matrix": set.capacitive.vertical_per_m,
        "planar_per_code": c.planar_per_code,
        "vertical_per_code": c.vertical_per_code,
        "calibrated_range": {
            "x_m": c.calibrated_planar[0], "y_m": c.calibrated_planar[1], "rz_rad": c.calibrated_planar[2],
            "z_m": c.calibrated_vertical[0], "rx_rad": c.calibrated_vertical[1], "ry_rad": c.calibrated_vertical[2],
        },
        "sensitivity_min": c.sensitivity_min,
        "hall_codes": [c.hall_window.low, c.hall_window.high],
        "capacitive_codes": [c.capacitive_window.low, c.capacitive_window.high],
    })
}

fn as_text(set: &ParameterSet) -> String {
    let c = &set.constants;
    let mut out = String::new();
    let _ = writeln!(out, "layout          {}", set.layout_version());
    let _ = writeln!(out, "model           ({})", Model::of(set.model).name);
    let _ = writeln!(out, "serial          {}", or_dash(&set.serial));
    let _ = writeln!(out, "created         {}", or_dash(&set.created));
    let _ = writeln!(out, "logs SHA-256    {}", hex(&set.logs_sha256));
    let _ = writeln!(
        out,
        "rows            {} ({} fitted)",
        set.fit.rows, set.fit.train_rows
    );
    if set.fit.forced {
        out.push_str(
            "FORCED          the log was refused, or the errors beyond --limit: written all the same (--force)\n",
        );
    }
    let _ = writeln!(out, "rms error       {}", errors(set.fit.rms));
    let _ = writeln!(out, "peak error      {}", errors(set.fit.peak));
    for (name, p) in parameters_in(set) {
        let (value, unit) = shown(p.value, p.unit);
        let _ = writeln!(out, "{name:<15} {value:>14.7} {unit}");
    }
    for (name, rows) in [
        ("PM", &set.plane),
        ("PM^-1", &set.plane_inverse),
        ("capacitive plane", &set.capacitive.vertical_per_m),
        ("planar per code", &c.planar_per_code),
        ("vertical per code", &c.vertical_per_code),
    ] {
        for (k, row) in rows.iter().enumerate() {
            let name = if k == 0 { name } else { "" };
            let _ = writeln!(
                out,
                "{name:<18}{:>15.7e}{:>15.7e}{:>15.7e}",
                row[0], row[1], row[2]
            );
        }
    }
    let _ = writeln!(out, "Hall scale      {:e} m per code", set.hall.m_per_code);
    let _ = writeln!(
        out,
        "capacitive      {:e} m per code",
        set.capacitive.m_per_code
    );
    let _ = writeln!(
        out,
        "Hall codes      {} to {}",
        c.hall_window.low, c.hall_window.high
    );
    let _ = writeln!(
        out,
        "capacitive      {} to {}",
        c.capacitive_window.low, c.capacitive_window.high
    );
    let [x, y, rz] = c.calibrated_planar.map(|e| e * 1e6);
    let [z, rx, ry] = c.calibrated_vertical.map(|e| e * 1e6);
    let _ = writeln!(
        out,
        "range           X {x:.1} um, Y {y:.1} um, Rz {rz:.1} urad, Z {z:.1} um, Rx {rx:.1} urad, Ry {ry:.1} urad"
    );
    let _ = writeln!(out, "smallest phi    {}", c.sensitivity_min);
    out
}
