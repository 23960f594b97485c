//! `host-fit join`.

use super::interrupt;
use crate::bus::bus_log::BusCounts;
use crate::cli::error::HostError;
use crate::cli::terminal;
use crate::join::{self, JoinReport, JoinSettings};
use crate::output::kept;
use crate::report::figure::{Figure, Group, figure, group};
use crate::report::text::as_text;
use std::path::PathBuf;

/// Joins both records, and shows how it went.
pub(super) fn run(args: &JoinSettings) -> Result<(), HostError> {
    let inputs = [&args.a, &args.b, &args.stage.path].map(PathBuf::as_path);
    super::check_outputs([Some(args.out.as_path())], None, inputs)?;
    kept::check_own(&args.out, kept::LOG)?;
    let report = join::run(args, &args.stage.read()?, interrupt::watch())?;
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
            "bad rows" => reference.bad,
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
