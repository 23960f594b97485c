//! Inputs that are damaged, mixed up or not what they should be: each is refused, or gives a log that
//! every reader of logs accepts.

use super::tests::{OFFSET_US, candump, files, read_log, reference};
use super::*;
use crate::input::log::{self, LogError, ReadOptions};
use crate::input::source::SourceError;
use std::fmt::Write;
use std::path::Path;

/// Numbers drawn one after the other, by the method of splitmix64.
struct Draws(u64);

impl Draws {
    fn below(&mut self, end: usize) -> usize {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) % end.max(1) as u64) as usize
    }
}

/// Cells that stand for something else than a number, or for one that nobody measures.
const CELLS: [&str; 12] = [
    "inf", "1e308", "-1e308", "9e15", "nan", "0", "-1", "1e5", "32768", "\"", "", "\u{b5}",
];

/// A text with some lines or cells changed, moved, repeated or lost.
fn mutated(text: &str, draws: &mut Draws) -> String {
    let mut lines: Vec<String> = text.lines().map(str::to_owned).collect();
    for _ in 0..1 + draws.below(3) {
        let (at, other) = (draws.below(lines.len()), draws.below(lines.len()));
        match draws.below(11) {
            0 => drop(lines.remove(at)),
            1 => lines.insert(at, lines[other].clone()),
            2 => lines.swap(at, other),
            3 => lines.rotate_left(at),
            4 => lines.truncate(at.max(lines.len() / 2)),
            5 => lines.extend_from_within(..),
            6 => lines.extend_from_within(at.min(other)..at.max(other)),
            7 | 8 => {
                let mut cells: Vec<String> = lines[at].split(',').map(str::to_owned).collect();
                let cell = draws.below(cells.len());
                cells[cell] = CELLS[draws.below(CELLS.len())].to_owned();
                lines[at] = cells.join(",");
            }
            _ => {
                let line = &mut lines[at];
                let byte = draws.below(line.len());
                if line.is_char_boundary(byte) && line.is_char_boundary(byte + 1) {
                    line.replace_range(byte..=byte, ["0", "9", "-", ")", " ", "F"][draws.below(6)]);
                }
            }
        }
        if lines.is_empty() {
            break;
        }
    }
    lines.join("\n") + "\n"
}

#[test]
fn what_import_writes_every_reader_of_logs_accepts() {
    let (bus, ifm) = (candump(|_, _| false), reference());
    let draws = &mut Draws(14);
    let mut imported = 0;
    for case in 0..400 {
        let bus = if case % 2 == 0 {
            mutated(&bus, draws)
        } else {
            bus.clone()
        };
        let ifm = if case % 3 != 0 {
            mutated(&ifm, draws)
        } else {
            ifm.clone()
        };
        let (_folder, mut args) = files(&bus, &ifm);
        args.estimate_offset = case % 20 == 0;
        args.offset_us = OFFSET_US;
        args.skip_bad_lines = case % 5 == 0;
        match run(&args) {
            Ok(report) => {
                imported += 1;
                let stage = Stage::from_file(&args.stage).expect("the shipped stage");
                let paths = std::slice::from_ref(&args.out);
                for options in [ReadOptions::default(), ReadOptions::DECODE] {
                    let reading = log::read(paths, &stage, &options);
                    let reading = reading.unwrap_or_else(|error| panic!("case {case}: {error}"));
                    assert_eq!(reading.dataset.rows.len(), report.join.rows, "case {case}");
                }
            }
            Err(_) => assert!(!args.out.exists(), "case {case}"),
        }
    }
    // The mutations leave some whole and damage some.
    assert!((80..350).contains(&imported), "{imported}");
}

#[test]
fn a_device_without_end_is_refused_by_its_start() {
    let zero = Path::new("/dev/zero");
    if !zero.exists() {
        return;
    }
    for estimate_offset in [false, true] {
        let (_folder, mut args) = files("", &reference());
        args.estimate_offset = estimate_offset;
        args.bus = zero.into();
        let refused = run(&args).expect_err("refused");
        assert!(
            matches!(refused, ImportError::Bus(SourceError::Binary { .. })),
            "{refused}"
        );
        let (_folder, mut args) = files(&candump(|_, _| false), "");
        args.estimate_offset = estimate_offset;
        args.reference = zero.into();
        let refused = run(&args).expect_err("refused");
        let binary =
            |error: &LogError| matches!(error, LogError::Source(SourceError::Binary { .. }));
        assert!(
            matches!(&refused, ImportError::Reference(error) if binary(error)),
            "{refused}"
        );
    }
}

#[test]
fn two_records_in_one_file_are_refused_where_the_second_begins() {
    let bus = candump(|_, _| false);
    let (_folder, args) = files(&format!("{bus}{bus}"), &reference());
    let second = bus.lines().count() + 1;
    let refused = run(&args).expect_err("refused");
    assert!(
        matches!(refused, ImportError::TwoRecords { line, .. } if (second..second + 40).contains(&line)),
        "{second}: {refused}"
    );
}

#[test]
fn a_frame_for_which_the_clock_leapt_ahead_is_left_out_with_its_tick() {
    let sound = candump(|_, _| false);
    let (_folder, args) = files(&sound, &reference());
    let want = run(&args).expect("sound");
    let leaps = |(number, line): (usize, &str)| {
        let seconds = |line: &str| line[1..line.find('.')?].parse::<u64>().ok();
        match (number, seconds(line)) {
            (900, Some(s)) => line.replacen(&s.to_string(), &(s + 1).to_string(), 1) + "\n",
            _ => format!("{line}\n"),
        }
    };
    let bus: String = sound.lines().enumerate().map(leaps).collect();
    assert!(bus != sound);
    let (_folder, args) = files(&bus, &reference());
    let have = run(&args).expect("survived");
    assert!(want.join.rows - have.join.rows <= 32, "{}", have.join.rows);
}

#[test]
fn records_that_have_little_in_common_are_refused() {
    let ticks = |from: u32, to: u32| candump(move |n, _| n < from || n >= to);
    for (bus, offset_us) in [
        // Most ticks before the reference begins, and a bus that saw little of it.
        (ticks(0, 750), OFFSET_US + 1.2e6),
        (ticks(100, 300), OFFSET_US),
    ] {
        let (_folder, mut args) = files(&bus, &reference());
        args.estimate_offset = false;
        args.offset_us = offset_us;
        let refused = run(&args).expect_err("refused");
        assert!(matches!(refused, ImportError::Unpaired { .. }), "{refused}");
        assert!(!args.out.exists());
    }
}

#[test]
fn codes_beyond_the_converter_are_refused_and_those_at_its_rails_left_out() {
    let stage = |code_max: i32| {
        let (folder, mut args) = files(&candump(|_, _| false), &reference());
        args.estimate_offset = false;
        args.offset_us = OFFSET_US;
        let text = crate::input::shipped::STAGE_TOML.replace("32767", &code_max.to_string());
        std::fs::write(&args.stage, text).expect("written");
        (folder, args)
    };
    // A motion of 300 um has codes up to 4800; with the lever arm more.
    let (_folder, args) = stage(4_000);
    let refused = run(&args).expect_err("refused");
    assert!(
        matches!(refused, ImportError::OutsideConverter { .. }),
        "{refused}"
    );
    let (_folder, args) = stage(4_800);
    let report = run(&args).expect("imported");
    assert!(report.bus.saturated > 0);
    assert_eq!(read_log(&args).rows.len(), report.join.rows);
}

#[test]
fn the_reference_may_be_in_other_units_but_has_each_value_once() {
    let bus = candump(|_, _| false);
    let (_folder, args) = files(&bus, &reference());
    run(&args).expect("imported");
    let want = read_log(&args);
    let mut other = "movement,t_us,ifm_x_um,Y1 [um],ifm_y2_mm\n".to_owned();
    for line in reference().lines().skip(1) {
        let cells: Vec<&str> = line.split(',').collect();
        let nm = |cell: usize| cells[cell].parse::<f64>().expect("a number");
        let units = [nm(2) * 1e-3, nm(3) * 1e-3, nm(4) * 1e-6].map(|value| format!(",{value:.9}"));
        other += &format!("{},{}{}\n", cells[0], cells[1], units.concat());
    }
    let other = other.replacen("Y1 [um]", "ifm_y1 [um]", 1);
    let (_folder, args) = files(&bus, &other);
    run(&args).expect("imported");
    for (have, want) in read_log(&args).rows.iter().zip(&want.rows) {
        for (have, want) in have.reference.iter().zip(want.reference) {
            assert!((have - want).abs() < 1e-12, "{have} {want}");
        }
    }
    for (twice, row) in [(",ifm_x_um", ",1"), (",x_m,y_m,rz_rad", ",0,0,0")] {
        let text = reference().replace('\n', &format!("{row}\n"));
        let text = text.replacen(row, twice, 1);
        let (_folder, args) = files(&bus, &text);
        let refused = run(&args).expect_err("refused");
        let named = |error: &LogError| {
            matches!(
                error,
                LogError::RepeatedColumn { .. } | LogError::AmbiguousColumns { .. }
            )
        };
        assert!(
            matches!(&refused, ImportError::Reference(error) if named(error)),
            "{refused}"
        );
    }
}

/// Movements that start their time anew are laid end to end; here the bus ran on between them.
#[test]
fn movements_whose_time_starts_anew_after_a_pause_are_refused() {
    let mut laid = String::new();
    for line in reference().lines() {
        let cells: Vec<&str> = line.splitn(3, ',').collect();
        let numbers = cells[0]
            .parse::<i64>()
            .ok()
            .zip(cells[1].parse::<i64>().ok());
        let Some((movement, t_us)) = numbers else {
            writeln!(laid, "{line}").expect("a string");
            continue;
        };
        let paused_us = if movement > 0 { 150_000 } else { 0 };
        let since_us = t_us - 500_000 * movement - paused_us;
        if since_us >= 0 {
            writeln!(laid, "{movement},{since_us},{}", cells[2]).expect("a string");
        }
    }
    let (_folder, mut args) = files(&candump(|_, _| false), &laid);
    run(&args).expect_err("no offset fits all movements");
    args.estimate_offset = false;
    args.offset_us = OFFSET_US;
    let refused = run(&args).expect_err("refused");
    assert!(
        matches!(
            refused,
            ImportError::Astray { .. }
                | ImportError::NoOffset { .. }
                | ImportError::WrongOffset { .. }
        ),
        "{refused}"
    );
    assert!(!args.out.exists());
}

#[test]
fn a_given_offset_that_the_motion_contradicts_is_refused() {
    for (wrong_us, is_sound) in [(0.0, true), (3_000.0, false), (-50_000.0, false)] {
        let (_folder, mut args) = files(&candump(|_, _| false), &reference());
        args.estimate_offset = false;
        args.offset_us = OFFSET_US + wrong_us;
        assert_eq!(run(&args).is_ok(), is_sound, "{wrong_us}");
        assert_eq!(args.out.exists(), is_sound);
    }
}

#[test]
fn a_reference_slower_than_the_servo_is_told_as_that() {
    let ifm = reference();
    let (head, rows) = ifm.split_once('\n').expect("a header");
    let slow: Vec<&str> = rows.lines().step_by(5).collect();
    let (_folder, mut args) = files(
        &candump(|_, _| false),
        &format!("{head}\n{}", slow.join("\n")),
    );
    assert!(matches!(
        run(&args),
        Err(ImportError::Unpaired(counts)) if 2 * counts.too_far > counts.ticks
    ));
    args.tolerance_us = Some(5_000);
    run(&args).expect("a line over 5 ms");
}
