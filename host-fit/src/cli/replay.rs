//! `host-fit replay`.

use super::args::LayoutChoice;
use crate::bus::replay::{self, ReplaySettings};
use crate::cli::error::HostError;
use crate::cli::terminal;
use crate::interrupt;
use clap::Args;
use std::path::PathBuf;

/// Arguments of `replay`.
#[derive(Debug, Args)]
pub(super) struct ReplayArgs {
    /// The log: CSV or CSV.gz, or `-` for standard input; it needs no reference.
    #[arg(value_name = "LOG")]
    log: PathBuf,
    /// The stage as designed.
    #[arg(long, value_name = "stage.toml")]
    stage: PathBuf,
    /// CAN interface, for instance can0.
    #[arg(long, value_name = "IFACE")]
    can: String,
    /// How many times faster than it was logged.
    #[arg(long, value_name = "X", default_value = "1", value_parser = rate)]
    rate: f64,
    /// How codes are put into frames.
    #[arg(long, value_enum, default_value = "auto")]
    layout: LayoutChoice,
    /// Stop after so many rows.
    #[arg(long, value_name = "N")]
    rows: Option<usize>,
}

fn rate(text: &str) -> Result<f64, &'static str> {
    match text.parse::<f64>() {
        Ok(rate) if (1e-3..=1e6).contains(&rate) => Ok(rate),
        _ => Err("expected a number from 0.001 to 1000000"),
    }
}

/// Plays a log onto a bus and says how it went.
pub(super) fn run(args: ReplayArgs) -> Result<(), HostError> {
    let done = replay::run(&ReplaySettings {
        log: args.log,
        stage: args.stage,
        interface: args.can,
        rate: args.rate,
        layout: args.layout.layout(),
        rows: args.rows,
    })?;
    terminal::print(&format!(
        "{} rows in {} frames, {:.3} s of the log in {:.3} s ({:.1} times real time), at most {:.1} ms late\n",
        done.rows,
        done.frames,
        done.logged_s,
        done.elapsed_s,
        done.logged_s / done.elapsed_s,
        done.late_max_s * 1e3
    ))?;
    if interrupt::requested() {
        return Err(HostError::Interrupted {
            kept: "the rows above were sent, the rest of the log was not".to_owned(),
        });
    }
    Ok(())
}
