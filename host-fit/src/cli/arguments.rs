//! What several commands take: logs and their stage, figures, threads.

use super::interrupt;
pub(super) use crate::arguments::{StageFile, between, choice, hold, seconds};
use crate::cli::error::HostError;
use crate::cli::terminal;
use crate::output::{OutputError, Outputs, kept};
use clap::Args;
use hallstage_input::log::{self, BadRows, LogReading, ReadOptions};
use hallstage_input::source::SourceProblem;
use hallstage_input::stage::{Stage, StageError};
use runtime::parameters::Text;
use std::path::{Path, PathBuf};

impl StageFile {
    pub(super) fn read(&self) -> Result<Stage, HostError> {
        match Stage::from_file(&self.path) {
            Err(StageError::Source(error)) if matches!(error.problem, SourceProblem::NotFound) => {
                let is_here = self.path.parent() == Some(Path::new(""));
                let place = if is_here { " in this folder" } else { "" };
                let path = self.path.display();
                Err(HostError::input(format!(
                    "There is no {path}{place}. Draft one with `host-fit init LOG`, or name one with --stage."
                )))
            }
            read => Ok(read?),
        }
    }
}

/// Logs of a stage, and how they are read.
#[derive(Debug, Args)]
pub(super) struct Logs {
    /// Logs: CSV or CSV.gz, one or more; `-` for standard input.
    #[arg(required = true, value_name = "LOG")]
    pub(super) paths: Vec<PathBuf>,
    #[command(flatten)]
    pub(super) stage: StageFile,
    /// What to do with rows that cannot be used.
    #[arg(long, value_parser = choice::<BadRows>(), default_value = "refuse")]
    bad_rows: BadRows,
}

impl Logs {
    /// The files that are read.
    pub(super) fn inputs(&self) -> impl Iterator<Item = &Path> {
        (self.paths.iter().chain([&self.stage.path])).map(PathBuf::as_path)
    }

    /// How they are read, by the arguments and the command.
    pub(super) fn options(&self, command: ReadOptions) -> ReadOptions {
        ReadOptions {
            watch: interrupt::WATCH,
            bad_rows: self.bad_rows,
            ..command
        }
    }

    /// Reads them.
    pub(super) fn read(
        &self,
        stage: &Stage,
        command: ReadOptions,
    ) -> Result<LogReading, HostError> {
        let options = self.options(command);
        let read = || log::read(&self.paths, stage, &options);
        Ok(terminal::timed("reading", read)?)
    }
}

/// Where the figures of a command go.
#[derive(Debug, Args)]
pub(super) struct Json {
    /// Write the figures as JSON; `-` for standard output.
    #[arg(id = "json", long = "json", value_name = "FILE")]
    pub(super) path: Option<PathBuf>,
}

impl Json {
    /// Refuses to replace a file that holds no figures.
    pub(super) fn check_own(&self) -> Result<(), OutputError> {
        let path = self.path.as_ref();
        path.map_or(Ok(()), |path| kept::check_own(path, kept::JSON))
    }

    /// Adds the figures to the outputs, if they are asked for.
    pub(super) fn add(
        &self,
        outputs: &mut Outputs,
        result: &impl serde::Serialize,
    ) -> Result<(), HostError> {
        let Some(path) = &self.path else {
            return Ok(());
        };
        let text = serde_json::to_string_pretty(result)? + "\n";
        Ok(outputs.add(path, text.as_bytes())?)
    }

    /// Writes the figures of a command that has no other output, if they are asked for.
    pub(super) fn write(&self, result: &impl serde::Serialize) -> Result<(), HostError> {
        let mut outputs = Outputs::default();
        self.add(&mut outputs, result)?;
        outputs.commit()?;
        Ok(())
    }
}

/// How many threads work.
#[derive(Clone, Copy, Debug, Args)]
pub(super) struct Threads {
    /// Threads; all cores if not given. The result does not depend on it.
    #[arg(id = "threads", long = "threads", value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub(super) number: Option<u16>,
}

/// How many rows are fitted: a number, or `None` for `all`.
pub(crate) fn train(text: &str) -> Result<Option<usize>, &'static str> {
    match (text, text.parse()) {
        ("all", _) => Ok(None),
        (_, Ok(rows)) if rows > 0 => Ok(Some(rows)),
        _ => Err("expected `all` or a number of rows, 1 or more"),
    }
}

/// A text that goes into a blob.
pub(crate) fn blob_text(value: &str) -> Result<Text, &'static str> {
    Text::try_from(value).map_err(|_| "at most 32 bytes fit in the blob")
}
