//! Runs the stage controller's unmodified image on an emulated STM32F405, with an emulated
//! converter that plays a log over SPI, and compares what it sends over CAN with what the host
//! decodes from the log. A line `FAULT fault | ticks | poses` says after how many ticks a
//! fault was reported, and how many valid poses were wrong until then.
//!
//! Use, as the scripts beside this package do:
//!
//! - `bench FOLDER LIBRARY TICKS [PART OF A NAME]`: a folder with images, blobs, log and poses, the
//!   library of Unicorn 2.1, the ticks of the long run (0: one pass over the log).
//! - `bench FOLDER LIBRARY record LOG BUS REFERENCE`: see [`rehearsal`].

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

use bench::Bench;
use checks::{
    authority, bus, commands, figures, log, motion, neighbour, parameters, seal, sensors, start,
    stopped, temperature, timing, update, zero,
};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::process::ExitCode;

/// Functions with their names.
macro_rules! named {
    ($($module:ident: $($check:ident),*;)*) => {
        [$($((concat!(stringify!($module), ": ", stringify!($check)), $module::$check)),*),*]
    };
}

type Check = fn(&Bench);

/// The checks.
const CHECKS: &[(&str, Check)] = &named! {
    figures: flash_and_ram, interrupt_to_mailbox;
    temperature: follow_the_stage;
    motion: a_pose_has_its_instant;
    sensors: dead_from_the_start, transfers_that_never_end, a_register_changes_at_any_time;
    timing: late_and_missed_ticks, a_watchdog_reset, the_clock_wraps, fpu_settings_left_behind,
        fpu_settings_changed_during_the_decoding, fpu_defaults_that_are_wrong;
    bus: received_frames_without_room, off_for_less_than_a_tick, goes_and_comes_back,
        aborted_on_the_wire, an_answer_waits_alone;
    zero: over_resets, lost;
    start: supply_that_comes_late, slow_crystal, no_crystal, parameters_change, silent_after_bus_off, pll_dead, can_dead, the_board,
        crashes;
    parameters: slots_in_every_state;
    commands: order_and_age, identify, any_length_code;
    update: new_parameters, refused, no_nonce_twice, hardware_that_fails, power_cuts;
    stopped: parameters_that_crash;
    authority: tag_or_line;
    seal: a_changed_program_does_not_run, a_program_without_a_key_says_so, no_copy_of_the_key_is_in_ram;
    neighbour: has_identifiers_and_a_period_of_its_own;
};

/// Runs the checks with `filter` in their name, and counts the passed and the failed ones.
struct Runner {
    filter: String,
    counts: [u32; 2],
}

impl Runner {
    fn run(&mut self, name: &str, check: impl FnOnce()) {
        if !name.contains(&self.filter) {
            return;
        }
        // The panic has printed the reason.
        let has_failed = catch_unwind(AssertUnwindSafe(check)).is_err();
        self.counts[usize::from(has_failed)] += 1;
        println!("{}  {name}", ["ok    ", "FAILED"][usize::from(has_failed)]);
    }

    fn everything(&mut self, bench: &Bench, ticks: u64) {
        let ticks = ticks.max(bench.rows.len() as u64);
        self.run("log: whole_log", || log::whole_log(bench, ticks));
        for case in sensors::cases() {
            let name = format!("sensors: {}", case.name);
            self.run(&name, || sensors::survives(bench, &case));
        }
        for (check, run) in CHECKS {
            self.run(check, || run(bench));
        }
    }
}

fn main() -> ExitCode {
    let args: Vec<_> = std::env::args().skip(1).collect();
    let args: Vec<_> = args.iter().map(String::as_str).collect();
    let [folder, library, what, rest @ ..] = args.as_slice() else {
        eprintln!("use: bench FOLDER LIBRARY TICKS [PART OF A NAME]");
        return ExitCode::from(2);
    };
    let bench = Bench::read(Path::new(folder), library.into());
    let mut runner = Runner {
        filter: String::new(),
        counts: [0; 2],
    };
    match (*what, rest) {
        ("record", [log, bus, reference]) => {
            runner.run(what, || rehearsal::record(&bench, log, bus, reference));
        }
        (ticks, filter) => {
            runner.filter = filter.concat();
            let ticks = ticks.parse().expect("a number of ticks");
            runner.everything(&bench, ticks);
        }
    }
    let [passed, failed] = runner.counts;
    println!("{passed} passed, {failed} failed");
    ExitCode::from(u8::from(failed > 0 || passed == 0))
}
