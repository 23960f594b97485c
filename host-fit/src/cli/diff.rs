//! `host-fit diff`.

use super::arguments::Json;
use super::inspect::errors;
use crate::cli::error::HostError;
use crate::cli::terminal;
use crate::diff::{answer, change_table, parameter_changes, pose_difference};
use crate::output::{blob_file, posterior_file};
use crate::report::figure::{Group, group};
use crate::report::text::as_text;
use clap::Args;
use hallstage_solver::estimator::model::Model;
use hallstage_solver::estimator::terms::names;
use runtime::ParameterSet;
use serde_json::json;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Arguments of `diff`.
#[derive(Debug, Args)]
pub(super) struct DiffArgs {
    /// A parameter blob.
    #[arg(value_name = "a.bin")]
    a: PathBuf,
    /// The one to compare it with.
    #[arg(value_name = "b.bin")]
    b: PathBuf,
    #[command(flatten)]
    json: Json,
}

/// Shows what changed between two blobs.
pub(super) fn run(args: &DiffArgs) -> Result<(), HostError> {
    let paths = [args.a.as_path(), args.b.as_path()];
    super::check_outputs([args.json.path.as_deref()], None, paths)?;
    args.json.check_own()?;
    let [a, b] = [blob_file::read(paths[0])?, blob_file::read(paths[1])?];
    let errors = [standard_errors(&a, paths[0]), standard_errors(&b, paths[1])];
    let difference = pose_difference(&a, &b);
    let answer = difference.as_ref().map(answer).transpose()?;
    let changes = parameter_changes([&a, &b], [&errors[0], &errors[1]]);
    let figures = group! {
        "a" => blob(paths[0], &a),
        "b" => blob(paths[1], &b),
        "same_logs" => a.logs_sha256 == b.logs_sha256,
        "parameters" => json!(changes),
        "pose_difference" => difference,
    };
    args.json.write(&figures)?;
    if let Some(answer) = &answer {
        terminal::print(&format!("{answer}\n"))?;
    }
    let tables = [figures.tables(), vec![change_table(&changes)]].concat();
    terminal::print(&as_text(&tables))?;
    if a.serial != b.serial {
        let [a, b] = [&a, &b].map(|set| match set.serial.as_str() {
            "" => "none".to_owned(),
            serial => format!("`{serial}`"),
        });
        terminal::warn(&[format!("the blobs have other serial numbers: {a} and {b}")]);
    }
    if answer.is_none() {
        terminal::warn(&[
            "the poses cannot be compared: the geometry of the first blob has no inverse"
                .to_owned(),
        ]);
    }
    Ok(())
}

/// What a blob says of itself.
fn blob(path: &Path, set: &ParameterSet) -> Group {
    group! {
        "file" => path.display().to_string(),
        "model" => Model::from_kind(set.model).name,
        "serial" => set.serial.as_str(),
        "created" => set.created.as_str(),
        "rows" => set.fit.rows,
        "train_rows" => set.fit.train_rows,
        "errors" => errors(set.fit.rms, set.fit.peak),
    }
}

/// The standard errors in the posterior beside a blob; none without a sound one.
fn standard_errors(set: &ParameterSet, blob: &Path) -> BTreeMap<String, f64> {
    let known = posterior_file::read(set, blob).ok().flatten();
    let errors = known.map_or_else(Vec::new, |known| {
        let errors = known.covariance.diagonal().map(f64::sqrt);
        errors.as_slice().to_vec()
    });
    names(errors.len()).into_iter().zip(errors).collect()
}
