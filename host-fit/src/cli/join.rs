//! `host-fit join`.

use super::arguments::between;
use super::interrupt;
use crate::bus::BusAddress;
use crate::bus::bus_log::BusCounts;
use crate::cli::error::HostError;
use crate::cli::terminal;
use crate::join::{self, JoinReport, JoinSettings};
use crate::report::figure::{Figure, Group, figure, group};
use crate::report::text::as_text;
use clap::Args;
use std::path::PathBuf;

/// Arguments of `join`.
#[derive(Debug, Args)]
pub(super) struct JoinArgs {
    /// The record of the sensors: of the bus, as `record`, `live --record` or `candump` writes it, or a table with
    /// Hall probes and gaps. The other file is the reference.
    #[arg(value_name = "A")]
    a: PathBuf,
    /// The record of the reference: a table with time, movement and beams (or pose). Columns of tables are those that
    /// stage.toml names.
    #[arg(value_name = "B")]
    b: PathBuf,
    /// The stage as designed.
    #[arg(long, value_name = "FILE", default_value = "stage.toml")]
    stage: PathBuf,
    /// Where to write the calibration log.
    #[arg(long, value_name = "LOG.csv")]
    out: PathBuf,
    /// Largest time from a row of the sensors to the samples of the reference before and after it, us; the longer of
    /// the periods of the two records if not given.
    #[arg(long, value_name = "US", value_parser = clap::value_parser!(u32).range(1..=10_000_000))]
    tolerance_us: Option<u32>,
    /// Start of the search: time of the sensors less time of the reference, us.
    #[arg(long, value_name = "US", allow_negative_numbers = true)]
    offset_us: Option<f64>,
    /// How far from its start, or from a common start of both records, the offset is searched, s. Without it and
    /// without a start: wherever half of the shorter record has a partner.
    #[arg(long, value_name = "SECONDS", value_parser = search_seconds)]
    search_s: Option<f64>,
    /// Only frames of this interface, where the record holds several; can0@5 for the frames of node 5.
    #[arg(long, value_name = "IFACE")]
    interface: Option<BusAddress>,
    /// Leave out lines that cannot be read, and count them.
    #[arg(long)]
    skip_bad_lines: bool,
}

impl JoinArgs {
    fn settings(&self) -> JoinSettings {
        JoinSettings {
            records: [self.a.clone(), self.b.clone()],
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

/// Joins both records, and shows how it went.
pub(super) fn run(args: &JoinArgs) -> Result<(), HostError> {
    let inputs = [&args.a, &args.b, &args.stage].map(PathBuf::as_path);
    super::check_outputs([Some(args.out.as_path())], None, inputs)?;
    let report = join::run(&args.settings(), interrupt::watch())?;
    terminal::print(&as_text(&figures(&report).tables()))?;
    terminal::show(&report.warnings);
    let unnamed = "temperatures are left out: name their columns in [temperature] of the stage file (mount, body)";
    terminal::warn(
        report
            .temperatures_left_out
            .then(|| unnamed.to_owned())
            .as_slice(),
    );
    super::wrote([args.out.clone()])
}

fn figures(report: &JoinReport) -> Group {
    let JoinReport {
        bus,
        reference,
        offset,
        join,
        ..
    } = report;
    let us = |us: f64| figure(us, "us");
    let ends = |ends: [f64; 2]| ends.into_iter().map(us).collect::<Figure>();
    let sensors = match bus {
        Some(bus) => bus_figures(bus),
        None => Group::default(),
    };
    group! {
        "sensors" => sensors,
        "reference" => group! {
            "rows" => reference.rows,
            "duplicates" => reference.duplicates,
            "gaps" => reference.gaps,
            "restarts" => reference.restarts,
            "has movements" => reference.has_movements,
        },
        "offset" => group! {
            "in the middle" => us(offset.us),
            "standard error" => us(offset.standard_error_us),
            "sensors' clock faster by" => offset.rate,
            "standard error of this" => offset.rate_standard_error,
            "share of motion explained" => offset.explained,
            "rows" => offset.ticks,
        },
        "join" => group! {
            "rows of the sensors" => join.ticks,
            "sensors" => ends(join.sensors_us),
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

fn bus_figures(bus: &BusCounts) -> Group {
    let health = &bus.health;
    group! {
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
    }
}
