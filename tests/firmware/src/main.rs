//! Runs the stage controller's unmodified image on an emulated STM32F405, with an emulated
//! converter that plays a log over SPI, and compares what it sends over CAN with what the host
//! decodes from the log. A line `FAULT part | fault | ticks | poses` says after how many ticks a
//! fault was reported, and how many valid poses were wrong until then.
//!
//! Use, as the scripts beside this package do:
//!
//! - `bench FOLDER LIBRARY TICKS [PART OF A NAME]`: a folder with images, blobs, log and poses, the
//!   library of Unicorn 2.1, the ticks of the long run (0: one pass over the log).
//! - `bench FOLDER LIBRARY record PART LOG BUS REFERENCE` and
//!   `bench FOLDER LIBRARY judge PART LOG STAGE BLOB DIRECT`: see [`rehearsal`].

mod adc_model;
mod bench;
mod callbacks;
mod can_identifier;
mod can_model;
mod checks;
mod clock_model;
mod dma_model;
mod flash_model;
mod image;
mod machine;
mod memory;
mod peripherals;
mod random_model;
mod rehearsal;
mod unicorn;
mod watchdog_model;

use adc_model::Part;
use bench::Bench;
use can_model::BusState;
use checks::{
    Outcome, Report, authority, bus, commands, figures, log, motion, neighbour, parameters,
    power_cuts, sensors, start, stopped, temperature, timing, update, zero,
};
use std::ffi::{OsStr, OsString};
use std::path::Path;
use std::process::ExitCode;

fn main() -> ExitCode {
    let args: Vec<_> = std::env::args_os().skip(1).collect();
    let [folder, library, ticks, filter @ ..] = args.as_slice() else {
        eprintln!("use: bench FOLDER LIBRARY TICKS [PART OF A NAME]");
        return ExitCode::from(2);
    };
    let bench = match Bench::read(Path::new(folder), library.clone()) {
        Ok(bench) => bench,
        Err(failure) => {
            eprintln!("{failure}");
            return ExitCode::from(3);
        }
    };
    if let Some(outcome) = rehearse(&bench, ticks, filter) {
        let mut report = Report::default();
        report.note(&ticks.to_string_lossy(), outcome);
        return ExitCode::from(u8::from(report.failed > 0));
    }
    let Some(ticks) = ticks.to_str().and_then(|text| text.parse().ok()) else {
        eprintln!("not a number of ticks: {ticks:?}");
        return ExitCode::from(2);
    };
    let filter = filter
        .first()
        .map(|text| text.to_string_lossy().into_owned());
    let mut report = Report::default();
    run(&bench, ticks, &mut report, &filter.unwrap_or_default());
    println!("{} passed, {} failed", report.passed, report.failed);
    ExitCode::from(u8::from(report.failed > 0 || report.passed == 0))
}

/// A step of the rehearsal, if one is asked for.
fn rehearse(bench: &Bench, step: &OsStr, arguments: &[OsString]) -> Option<Outcome> {
    let (part, files) = arguments.split_first()?;
    let part = PARTS.into_iter().find(|(_, name)| part == *name)?;
    let files: Vec<_> = files.iter().map(Path::new).collect();
    match (step.to_str()?, files.as_slice()) {
        ("record", [log, bus, reference]) => {
            Some(rehearsal::record(bench, part.0, log, bus, reference))
        }
        ("judge", [log, stage, blob, direct]) => {
            let (log, blobs) = ((*log, *stage), (*blob, *direct));
            Some(rehearsal::judge(bench, part, log, blobs))
        }
        _ => None,
    }
}

/// The checks of each image, with the converter's name.
type OfPart = fn(&Bench, Part, &str) -> Outcome;
const CHECKS_OF_PARTS: &[(&str, OfPart)] = &[
    ("flash and RAM", figures::flash_and_ram),
    ("interrupt to mailbox", figures::interrupt_to_mailbox),
    ("dead from the start", |bench, part, _| {
        sensors::dead_from_the_start(bench, part)
    }),
    ("transfers that never end", |bench, part, _| {
        sensors::transfers_that_never_end(bench, part)
    }),
    ("temperatures", temperature::follow_the_stage),
    ("record", |bench, part, _| commands::record(bench, part)),
    ("order and age of frames", commands::order_and_age),
];

/// The checks of one image.
type OfImage = fn(&Bench) -> Outcome;
const CHECKS: &[(&str, OfImage)] = &[
    (
        "ads131m08: a pose is of its instant",
        motion::a_pose_is_of_its_instant,
    ),
    (
        "ads131m08: a register changes at any time",
        sensors::a_register_changes_at_any_time,
    ),
    (
        "ads131m08: whatever its sheet leaves open",
        sensors::every_variant,
    ),
    (
        "a debugger reads the last pose",
        log::a_debugger_reads_the_last_pose,
    ),
    (
        "received frames without room",
        bus::received_frames_without_room,
    ),
    ("a tick that comes late", timing::a_late_tick),
    ("ticks that never come", timing::ticks_that_never_come),
    ("the clock wraps", timing::the_clock_wraps),
    ("a watchdog reset", timing::a_watchdog_reset),
    (
        "overrun ticks do not feed the watchdog",
        timing::overrun_ticks_do_not_feed,
    ),
    (
        "FPU settings left behind by an interrupt",
        timing::fpu_settings_left_behind,
    ),
    (
        "FPU settings changed during the decoding",
        timing::fpu_settings_changed_during_the_decoding,
    ),
    (
        "FPU defaults that are wrong",
        timing::fpu_defaults_that_are_wrong,
    ),
    ("no other node from the start", bus::alone_from_the_start),
    (
        "bus off for less than a tick",
        bus::off_for_less_than_a_tick,
    ),
    ("zero: over a watchdog reset", zero::over_a_watchdog_reset),
    ("zero: over a reset by the pin", zero::over_a_reset_by_pin),
    ("zero: over power-on", zero::over_power_on),
    ("zero: lost", zero::lost),
    (
        "start: supply that comes late",
        start::supply_that_comes_late,
    ),
    ("start: crystal absent", start::no_crystal),
    ("start: silent after bus-off", start::silent_after_bus_off),
    ("start: crystal lost while running", start::crystal_lost),
    (
        "start: PLL does not lock to the crystal",
        start::pll_without_lock,
    ),
    ("start: PLL dead", start::pll_dead),
    ("start: CAN dead", start::can_dead),
    ("start: CAN receive line low", start::receive_line_low),
    ("start: the board", start::the_board),
    ("parameters: one sound slot of two", parameters::one_usable),
    ("parameters: the field model", parameters::the_field_model),
    ("parameters: the first of two", parameters::the_first_of_two),
    ("command: identify", commands::identify),
    ("command: re-zero", commands::rezero),
    (
        "update: new parameters over the bus",
        update::new_parameters,
    ),
    ("update: refused, and nothing is written", update::refused),
    ("update: no random number twice", update::no_nonce_twice),
    ("update: flash that fails", update::flash_that_fails),
    ("update: supply that drops", update::supply_that_drops),
    (
        "update: a cut of the power leaves old or new",
        power_cuts::in_an_update,
    ),
    (
        "update: a reset runs what ran",
        stopped::a_reset_runs_what_ran,
    ),
    (
        "update: parameters that crash stop the program",
        stopped::parameters_that_crash,
    ),
    (
        "update: parameters whose check crashes stop the program",
        stopped::parameters_whose_check_crashes,
    ),
    (
        "command: a tag, or without a key the line",
        authority::tag_or_line,
    ),
    (
        "command: those of its own node alone",
        neighbour::has_identifiers_and_a_period_of_its_own,
    ),
    ("command: any data length code", commands::any_length_code),
    ("bus off and back", |b| {
        bus::goes_and_comes_back(b, BusState::Off)
    }),
    ("no other node for a second", |b| {
        bus::goes_and_comes_back(b, BusState::Alone)
    }),
    ("aborted on the wire: completed", |b| {
        bus::aborted_on_the_wire(b, false)
    }),
    ("aborted on the wire: failed", |b| {
        bus::aborted_on_the_wire(b, true)
    }),
    ("parameters: none usable", parameters::unusable),
];

const PARTS: [(Part, &str); 2] = [(Part::Ads131m08, "ads131m08"), (Part::Ads8688, "ads8688")];

fn run(bench: &Bench, ticks: u64, report: &mut Report, filter: &str) {
    let mut check = |name: &str, run: &dyn Fn() -> Outcome| {
        if name.contains(filter) {
            report.note(name, run());
        }
    };
    let whole = bench.rows.len() as u64;
    for (part, name) in PARTS {
        let ticks = if part == Part::Ads131m08 {
            ticks.max(whole)
        } else {
            whole
        };
        check(
            &format!("{name}: the whole log gives the host's words"),
            &|| log::same_words(bench, part, ticks, name),
        );
        for case in sensors::cases(part) {
            check(&format!("{name}: {}", case.name()), &|| {
                sensors::survives(bench, part, &case)
            });
        }
        for (what, run) in CHECKS_OF_PARTS {
            check(&format!("{name}: {what}"), &|| run(bench, part, name));
        }
    }
    for (name, run) in CHECKS {
        check(name, &|| run(bench));
    }
    match start::crashes(bench) {
        Ok(crashes) => {
            for crash in crashes {
                check(&format!("crash: {}", crash.fault), &|| {
                    start::crash(bench, &crash)
                });
            }
        }
        Err(failure) => check("crash", &|| Err(failure.to_string().into())),
    }
}
