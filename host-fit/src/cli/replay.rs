//! `host-fit replay`.

use super::args::{LayoutChoice, StageFile, between};
use crate::bus::BusAddress;
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
    #[command(flatten)]
    stage: StageFile,
    /// CAN interface, for instance can0; can0@5 for node 5 of the bus.
    #[arg(long, value_name = "IFACE")]
    can: BusAddress,
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

fn rate(text: &str) -> Result<f64, String> {
    between(text, 1e-3, 1e6, "a number")
}

/// Plays a log onto a bus and says how it went.
pub(super) fn run(args: &ReplayArgs) -> Result<(), HostError> {
    let done = replay::run(&ReplaySettings {
        log: args.log.clone(),
        stage: args.stage.path.clone(),
        address: args.can.clone(),
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
        let kept = "the rows above were sent, the rest of the log was not";
        return Err(HostError::interrupted(kept));
    }
    Ok(())
}
