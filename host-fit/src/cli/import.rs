//! `host-fit import`.

use super::arguments::between;
use super::interrupt;
use crate::bus::BusAddress;
use crate::bus::import::{self, ImportReport, ImportSettings};
use crate::cli::error::HostError;
use crate::cli::terminal;
use crate::report::figure::{Figure, Group, figure, group};
use crate::report::text::as_text;
use clap::Args;
use std::path::PathBuf;

/// Arguments of `import`.
#[derive(Debug, Args)]
pub(super) struct ImportArgs {
    /// Record of the bus, as `record`, `live --record` or `candump -L` writes it.
    #[arg(value_name = "CANDUMP")]
    bus: PathBuf,
    /// Log of the interferometers: CSV with time, movement and beams (or pose), in the
    /// columns that stage.toml names.
    #[arg(value_name = "REFERENCE")]
    reference: PathBuf,
    /// The stage as designed.
    #[arg(long, value_name = "FILE", default_value = "stage.toml")]
    stage: PathBuf,
    /// Where to write the calibration log.
    #[arg(long, value_name = "LOG.csv")]
    out: PathBuf,
    /// Largest time from a tick to the reference samples before and after it, us; one servo
    /// period if not given.
    #[arg(long, value_name = "US", value_parser = clap::value_parser!(u32).range(1..=10_000_000))]
    tolerance_us: Option<u32>,
    /// Start of the search: time of the bus less time of the reference, us. Without it, both records start
    /// together.
    #[arg(long, value_name = "US", allow_negative_numbers = true)]
    offset_us: Option<f64>,
    /// How far from its start the offset is searched, s.
    #[arg(
        long,
        value_name = "SECONDS",
        default_value_t = 2.0,
        value_parser = search_seconds
    )]
    search_s: f64,
    /// Only frames of this interface, where the record holds several; can0@5 for the frames of node 5.
    #[arg(long, value_name = "IFACE")]
    interface: Option<BusAddress>,
    /// Leave out lines that cannot be read, and count them.
    #[arg(long)]
    skip_bad_lines: bool,
}

impl ImportArgs {
    fn settings(&self) -> ImportSettings {
        ImportSettings {
            bus: self.bus.clone(),
            reference: self.reference.clone(),
            stage: self.stage.clone(),
            out: self.out.clone(),
            tolerance_us: self.tolerance_us,
            offset_us: self.offset_us,
            search_s: self.search_s,
            interface: self.interface.clone(),
            skip_bad_lines: self.skip_bad_lines,
        }
    }
}

/// For records further apart than an hour, `--offset-us` gives the start.
fn search_seconds(text: &str) -> Result<f64, String> {
    between(text, 0.0, 3600.0, "a number of seconds")
}

/// Joins a record of the bus and a reference, and shows how it went.
pub(super) fn run(args: &ImportArgs) -> Result<(), HostError> {
    let inputs = [&args.bus, &args.reference, &args.stage].map(PathBuf::as_path);
    super::check_outputs([Some(args.out.as_path())], None, inputs)?;
    let report = import::run(&args.settings(), interrupt::watch())?;
    terminal::print(&as_text(&figures(&report).tables()))?;
    let unnamed = "temperatures are left out: name their columns in [temperature] of the stage file (mount, body)";
    terminal::warn(
        report
            .temperatures_left_out
            .then(|| unnamed.to_owned())
            .as_slice(),
    );
    super::wrote([args.out.clone()])
}

fn figures(report: &ImportReport) -> Group {
    let ImportReport {
        bus,
        reference,
        offset,
        join,
        ..
    } = report;
    let health = &bus.health;
    let us = |us: f64| figure(us, "us");
    let ends = |ends: [f64; 2]| ends.into_iter().map(us).collect::<Figure>();
    group! {
        "bus" => group! {
            "frames" => bus.frames,
            "bad lines" => bus.bad_lines,
            "other lines" => bus.other_lines,
            "ticks" => bus.ticks,
            "saturated" => bus.saturated,
            "untimed" => bus.untimed,
            "restarts" => bus.restarts,
            "ticks missing" => bus.ticks_missing,
            "gaps" => bus.gaps,
            "lost" => health.lost,
            "repeated" => health.repeated,
            "out of sequence" => health.wrong_sequence,
            "damaged" => health.wrong_check,
            "of wrong length" => health.wrong_length,
            "late" => health.late,
            "incomplete ticks" => health.incomplete,
        },
        "reference" => group! {
            "rows" => reference.rows,
            "duplicates" => reference.duplicates,
            "gaps" => reference.gaps,
            "restarts" => reference.restarts,
            "has movements" => reference.has_movements,
        },
        "offset" => group! {
            "in the middle" => us(offset.us),
            "node clock faster by" => offset.rate,
            "share of motion explained" => offset.explained,
            "ticks" => offset.ticks,
            "standard error" => us(offset.standard_error_us),
        },
        "join" => group! {
            "ticks" => join.ticks,
            "bus" => ends(join.bus_us),
            "reference" => ends(join.reference_us),
            "reference in all" => figure(join.reference_s, "s"),
            "covered" => figure(join.covered_s, "s"),
            "rows" => join.rows,
            "outside" => join.outside,
            "between movements" => join.between_movements,
            "too far" => join.too_far,
            "nearest, at most" => us(join.nearest_max_us),
        },
    }
}
