//! `host-fit import`.

use super::interrupt;
use crate::bus::import::{self, ImportArgs, ImportReport};
use crate::cli::error::HostError;
use crate::cli::terminal;
use crate::report::figure::{Figure, Group, figure, group};
use crate::report::text::as_text;
use std::path::PathBuf;

/// Joins a record of the bus and a reference, and shows how it went.
pub(super) fn run(args: &ImportArgs) -> Result<(), HostError> {
    let inputs = [&args.bus, &args.reference, &args.stage].map(PathBuf::as_path);
    super::check_outputs([Some(args.out.as_path())], None, inputs)?;
    let report = import::run(args, interrupt::watch())?;
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
