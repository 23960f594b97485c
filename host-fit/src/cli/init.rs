//! `host-fit init`.

use crate::cli::error::HostError;
use crate::cli::terminal;
use crate::output::{is_standard, write_atomically};
use clap::Args;
use hallstage_input::axis::counted;
use hallstage_input::draft::draft;
use std::path::PathBuf;

/// Arguments of `init`.
#[derive(Debug, Args)]
pub(super) struct InitArgs {
    /// Logs: CSV or CSV.gz, one or more; `-` for standard input.
    #[arg(required = true, value_name = "LOG")]
    logs: Vec<PathBuf>,
    /// Where to write the stage file; `-` for standard output.
    #[arg(long, value_name = "stage.toml", default_value = "stage.toml")]
    out: PathBuf,
    /// Replace a file that exists.
    #[arg(long)]
    force: bool,
}

/// Drafts a stage file for logs.
pub(super) fn run(args: &InitArgs) -> Result<(), HostError> {
    let inputs = args.logs.iter().map(PathBuf::as_path);
    super::check_outputs([Some(args.out.as_path())], None, inputs)?;
    if !is_standard(&args.out) && !args.force && args.out.exists() {
        let there = args.out.display();
        let problem =
            format!("{there} exists already; name another file, or replace it with --force");
        return Err(HostError::usage("--out", problem));
    }
    let draft = draft(&args.logs)?;
    write_atomically(&args.out, draft.text.as_bytes())?;
    let left_out = match draft.ignored.as_slice() {
        [] => String::new(),
        names => format!(", left out: {}", names.join(", ")),
    };
    terminal::print(&format!(
        "{} mapped{left_out}\nwrote {}\n{} in it to be filled in, each begins with \"# FILL IN\"\n",
        counted(draft.mapped, "column"),
        args.out.display(),
        counted(draft.to_fill_in, "line")
    ))
}
