//! `host-fit diff`.

use super::inspect::{errors, micro, or_dash};
use crate::cli::error::HostError;
use crate::cli::terminal;
use crate::diff::{
    AxisDifference, ParameterChange, PoseDifference, parameter_changes, pose_difference,
};
use crate::output::{blob_file, posterior_file};
use crate::problem::model::Model;
use crate::problem::terms::shown;
use crate::solve::field::terms::{COUNT, name};
use clap::Args;
use runtime::{ModelKind, ParameterSet};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// Axes of a pose with the units of their errors.
const AXES: [(&str, &str); 6] = [
    ("x", "um"),
    ("y", "um"),
    ("rz", "urad"),
    ("z", "um"),
    ("rx", "urad"),
    ("ry", "urad"),
];

/// Arguments of `diff`.
#[derive(Debug, Args)]
pub(super) struct DiffArgs {
    /// A parameter blob.
    #[arg(value_name = "a.bin")]
    a: PathBuf,
    /// The one to compare it with.
    #[arg(value_name = "b.bin")]
    b: PathBuf,
    /// Write everything as JSON; `-` for standard output.
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// Shows what changed between two blobs.
pub(super) fn run(args: &DiffArgs) -> Result<(), HostError> {
    super::keep_apart(&[args.json.as_deref()], &[&args.a, &args.b])?;
    let paths = [args.a.as_path(), args.b.as_path()];
    let (a, b) = (blob_file::read(paths[0])?, blob_file::read(paths[1])?);
    let errors = [
        standard_errors(&a, paths[0])?,
        standard_errors(&b, paths[1])?,
    ];
    let parameters = parameter_changes([&a, &b], [&errors[0], &errors[1]]);
    let poses = pose_difference(&a, &b);
    if let Some(path) = &args.json {
        super::write_json(&as_json(paths, [&a, &b], &parameters, poses.as_ref()), path)?;
    }
    terminal::print(&as_text(paths, [&a, &b], &parameters, poses.as_ref()))?;
    if a.serial != b.serial {
        terminal::warn(&[format!(
            "the blobs have other serial numbers: {} and {}",
            or_dash(&a.serial),
            or_dash(&b.serial)
        )]);
    }
    Ok(())
}

/// The standard errors in the posterior beside a blob; none where there is no such file.
fn standard_errors(set: &ParameterSet, blob: &Path) -> Result<BTreeMap<String, f64>, HostError> {
    let Some(path) = posterior_file::beside(blob).filter(|path| path.exists()) else {
        return Ok(BTreeMap::new());
    };
    if set.model != ModelKind::Field {
        return Ok(BTreeMap::new());
    }
    let known = posterior_file::read(&path, set, blob)?;
    let error = |k: usize| (name(k), known.covariance[(k, k)].sqrt());
    Ok((0..COUNT).map(error).collect())
}

fn as_json(
    paths: [&Path; 2],
    sets: [&ParameterSet; 2],
    parameters: &BTreeMap<String, ParameterChange>,
    poses: Option<&PoseDifference>,
) -> Value {
    let blob = |k: usize| {
        let set = sets[k];
        let errors: serde_json::Map<String, Value> = (0..3)
            .map(|axis| {
                let (name, unit) = AXES[axis];
                let (rms, peak) = (micro(set.fit.rms[axis]), micro(set.fit.peak[axis]));
                let figures = json!({ format!("rmse_{unit}"): rms, format!("peak_{unit}"): peak });
                (name.to_owned(), figures)
            })
            .collect();
        json!({
            "file": paths[k].display().to_string(),
            "model": Model::of(set.model).name,
            "serial": set.serial.as_str(),
            "created": set.created.as_str(),
            "rows": set.fit.rows,
            "train_rows": set.fit.train_rows,
            "errors": errors,
        })
    };
    let parameter = |(name, c): (&String, &ParameterChange)| {
        let change = c.a.zip(c.b).map(|(a, b)| b - a);
        let value =
            json!({ "a": c.a, "b": c.b, "change": change, "sigma": c.sigma, "unit": c.unit });
        (name.clone(), value)
    };
    let axis = |((name, unit), d): (&(&str, &str), &AxisDifference)| {
        let figures = json!({
            format!("mean_{unit}"): d.mean * 1e6,
            format!("rms_{unit}"): d.rms * 1e6,
            format!("peak_{unit}"): d.peak * 1e6,
        });
        ((*name).to_owned(), figures)
    };
    let difference = poses.map(|d| {
        let range = AXES.iter().zip(d.range);
        let range = range.map(|((name, unit), x)| (format!("{name}_{unit}"), json!(x * 1e6)));
        json!({
            "poses": d.poses,
            "refused": d.refused,
            "range": range.collect::<serde_json::Map<_, _>>(),
            "axes": AXES.iter().zip(&d.axes).map(axis).collect::<serde_json::Map<_, _>>(),
        })
    });
    json!({
        "a": blob(0),
        "b": blob(1),
        "same_logs": sets[0].logs_sha256 == sets[1].logs_sha256,
        "parameters": parameters.iter().map(parameter).collect::<serde_json::Map<_, _>>(),
        "pose_difference": difference,
    })
}

fn as_text(
    paths: [&Path; 2],
    sets: [&ParameterSet; 2],
    parameters: &BTreeMap<String, ParameterChange>,
    poses: Option<&PoseDifference>,
) -> String {
    let mut out = String::new();
    let mut line = |title: &str, of: &dyn Fn(usize) -> String| {
        let _ = writeln!(out, "{title:<18}{:<34}  {}", of(0), of(1));
    };
    line("", &|k| or_dash(&paths[k].to_string_lossy()));
    line("model", &|k| format!("({})", Model::of(sets[k].model).name));
    line("serial", &|k| or_dash(&sets[k].serial));
    line("created", &|k| or_dash(&sets[k].created));
    line("rows (fitted)", &|k| {
        format!("{} ({})", sets[k].fit.rows, sets[k].fit.train_rows)
    });
    line("rms X, Y, Rz", &|k| errors(sets[k].fit.rms));
    line("peak X, Y, Rz", &|k| errors(sets[k].fit.peak));
    let same = if sets[0].logs_sha256 == sets[1].logs_sha256 {
        "the same logs"
    } else {
        "other logs"
    };
    let _ = writeln!(
        out,
        "{same}\n\n{:<14}{:>15}{:>15}{:>13}{:>8}",
        "", "a", "b", "change", "sigma"
    );
    for (name, change) in parameters {
        let (per_si, unit) = shown(1.0, change.unit);
        let [a, b] = [change.a, change.b].map(|x| x.map(|x| x * per_si));
        let number = |x: Option<f64>| x.map_or_else(|| "-".to_owned(), |x| format!("{x:.7}"));
        let moved = a.zip(b).map(|(a, b)| b - a);
        let _ = writeln!(
            out,
            "{name:<14}{:>15}{:>15}{:>13}{:>8}  {}",
            number(a),
            number(b),
            moved.map_or_else(|| "-".to_owned(), |x| format!("{x:+.3e}")),
            change
                .sigma
                .map_or_else(|| "-".to_owned(), |x| format!("{x:+.1}")),
            unit
        );
    }
    let Some(d) = poses else {
        out.push_str(
            "\nthe poses cannot be compared: the geometry of the first blob has no inverse\n",
        );
        return out;
    };
    let _ = writeln!(
        out,
        "\npose of b less that of a, same codes, {} poses over the range of both ({} refused)\n\
         {:<12}{:>12}{:>12}{:>12}{:>12}",
        d.poses, d.refused, "", "range", "mean", "rms", "peak"
    );
    for ((name, unit), (axis, range)) in AXES.iter().zip(d.axes.iter().zip(d.range)) {
        let [range, mean, rms, peak] = [range, axis.mean, axis.rms, axis.peak].map(|x| x * 1e6);
        let title = format!("{name} ({unit})");
        let _ = writeln!(
            out,
            "{title:<12}{range:>12.1}{mean:>12.3}{rms:>12.3}{peak:>12.3}"
        );
    }
    out
}
