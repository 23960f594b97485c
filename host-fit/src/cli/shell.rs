//! `host-fit completions` and `host-fit man`: what a shell and `man` want to know of the commands.

use super::Cli;
use crate::cli::error::HostError;
use crate::output::{make_folder, write_atomically};
use clap::{Args, CommandFactory};
use clap_complete::Shell;
use clap_mangen::Man;
use std::path::{Path, PathBuf};

/// Arguments of `completions`.
#[derive(Debug, Args)]
pub(super) struct CompletionsArgs {
    /// The shell.
    #[arg(value_enum)]
    shell: Shell,
}

/// Arguments of `man`.
#[derive(Debug, Args)]
pub(super) struct ManArgs {
    /// The folder, for instance ~/.local/share/man/man1.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
}

/// Writes the completions of a shell to standard output.
pub(super) fn completions(args: &CompletionsArgs) -> Result<(), HostError> {
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut Cli::command(), "host-fit", &mut script);
    Ok(write_atomically(Path::new("-"), &script)?)
}

/// Writes a manual page of the program and of each command.
pub(super) fn man(args: &ManArgs) -> Result<(), HostError> {
    make_folder(&args.out)?;
    let mut command = Cli::command().disable_help_subcommand(true);
    command.build();
    let pages = command.get_subcommands().cloned().chain([command.clone()]);
    for page in pages {
        let man = Man::new(page);
        let mut text = Vec::new();
        man.render(&mut text)?;
        let path = args.out.join(man.get_filename());
        write_atomically(&path, &text)?;
        super::terminal::print(&format!("wrote {}\n", path.display()))?;
    }
    Ok(())
}
