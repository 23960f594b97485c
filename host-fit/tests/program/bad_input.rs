//! Bad input: an exit status, a message that says where and what to do, and nothing written.

use crate::common::{Bench, changed, column, log, rows, thinned_log, with_cell};
use flate2::Compression;
use flate2::write::GzEncoder;
use host_fit::input::shipped::STAGE_TOML;
use std::io::Write;

const FIT: &str = "fit log.csv --out p.bin --json p.json --report report";

/// The readers have their own tests of each fault.
#[test]
fn what_cannot_be_read_is_named_with_its_place_and_nothing_is_written() {
    let log = log();
    let mut gzip = GzEncoder::new(Vec::new(), Compression::fast());
    gzip.write_all(log.as_bytes()).expect("compressed");
    let gzip = gzip.finish().expect("compressed");
    let bad_cell = with_cell(&log, 4, "ifm_x_nm", "abc");
    for (name, content, parts) in [
        (
            "log.csv",
            bad_cell.as_bytes(),
            &["log.csv:6:", "ifm_x_nm", "abc"][..],
        ),
        ("log.csv", &gzip[..gzip.len() / 2], &["log.csv", "gzip"]),
        ("log.csv", b"", &["log.csv", "empty"]),
        (
            "stage.toml",
            b"[search]",
            &["stage.toml:1:", "hall", "missing"],
        ),
    ] {
        let bench = Bench::with_log();
        bench.write(name, content);
        bench.bad(FIT, 3, parts);
        assert!(bench.holds_only(&["log.csv"]), "{parts:?}");
    }
    let bench = Bench::new();
    bench.bad(FIT, 3, &["log.csv", "no such file"]);
    bench.bad(
        "fit log.csv --out p.bin --stage none.toml",
        3,
        &["none.toml", "host-fit init"],
    );
    std::fs::create_dir(bench.path("log.csv")).expect("a folder");
    bench.bad(FIT, 3, &["log.csv", "a folder"]);
}

#[test]
fn damaged_blobs_are_refused_by_every_command_that_reads_one() {
    let bench = Bench::with_log();
    bench.good("fit log.csv --out good.bin");
    let good = bench.read("good.bin");
    bench.write("p.bin", &good[..good.len() - 1]);
    for command in [
        "inspect p.bin",
        "eval p.bin log.csv",
        "decode p.bin log.csv --out pose.csv",
    ] {
        bench.bad(command, 3, &["p.bin", "are needed; copy the file again"]);
    }
    assert!(bench.holds_only(&["log.csv", "good.bin", "p.bin"]));
}

#[test]
fn a_blob_of_other_scales_is_refused() {
    let bench = Bench::with_log();
    bench.good("fit log.csv --out p.bin");
    for (key, from, to) in [
        ("hall.m_per_count", "6.25e-8", "6.26e-8"),
        ("capacitive.m_per_count", "1.5625e-8", "1.5626e-8"),
    ] {
        assert!(STAGE_TOML.contains(from));
        bench.write("stage.toml", STAGE_TOML.replace(from, to));
        bench.bad("eval p.bin log.csv", 3, &[key]);
        bench.bad("decode p.bin log.csv --out pose.csv", 3, &[key]);
    }
    assert!(bench.holds_only(&["log.csv", "p.bin"]));
}

#[test]
fn every_command_that_judges_a_log_skips_bad_rows() {
    let bench = Bench::new();
    bench.write("log.csv", log());
    bench.good("fit log.csv --out p.bin");
    bench.write("log.csv", with_cell(&log(), 10, "hall_b_cnt", "ice"));
    for command in ["check log.csv", "eval p.bin log.csv"] {
        bench.bad(command, 3, &["hall_b_cnt", "ice"]);
        bench.good(&format!("{command} --bad-rows skip"));
    }
}

#[test]
fn saturated_codes_are_refused_or_skipped_by_fit_and_marked_by_decode() {
    let bench = Bench::new();
    let saturated = with_cell(
        &with_cell(&log(), 10, "hall_b_cnt", "32767"),
        20,
        "cap2_cnt",
        "-32768",
    );
    bench.write("log.csv", &saturated);
    bench.bad(FIT, 3, &["hall_b_cnt", "32767", "--bad-rows skip"]);
    assert!(bench.holds_only(&["log.csv"]));
    bench.good("fit log.csv --out p.bin --json p.json --bad-rows skip");
    assert_eq!(bench.json("p.json")["skipped_rows"], 2);
    bench.good("decode p.bin log.csv --out held.csv --hold 1");
    let held = rows(&bench.text("held.csv"));
    // Capacitive 2 takes all six axes with it, and Hall B is held.
    assert_eq!(held[10][2..5], held[9][2..5]);
    let marks = 1 << 4 | 1 << 14 | 1 << 20;
    assert_eq!(held[20][8] as u32 & marks, marks);
}

#[test]
fn a_log_that_cannot_identify_the_model_ends_with_status_4_and_no_blob() {
    let bench = Bench::new();
    let header = log().lines().next().expect("a header").to_owned();
    let constant = (0..500).fold(header + "\n", |text, k| {
        text + &format!("0,{},5,6,7,1,2,3,10,20,30\n", k * 2000)
    });
    bench.write("constant.csv", constant);
    bench.write("height.csv", thinned_log(4, |m| m < 3));
    bench.write("no_tilt.csv", thinned_log(4, |m| m < 21));
    bench.write("dead.csv", changed(&log(), |_, cells| cells[10] = 7));
    bench.write("only_y.csv", thinned_log(4, |m| m % 3 == 0));
    for (name, parts) in [
        ("dead", ["Hall C never changes", "connected"]),
        ("height", ["Z does not move", "record"]),
        ("no_tilt", ["Rx does not move", "record"]),
        ("only_y", ["Rz does not move", "record"]),
        ("constant", ["Nothing moves", "record"]),
    ] {
        let fit = format!("fit {name}.csv --out p.bin --json p.json");
        bench.bad(&fit, 4, &parts);
    }
    assert!(!bench.has("p.bin"));
    let failure = &bench.json("p.json")["failure"];
    assert!(failure.as_str().is_some_and(|text| text.contains("X")));
    // The same log is good enough for a model without vertical terms.
    bench.good("fit height.csv --out p.bin --model 30");
}

#[test]
fn wrong_usage_ends_with_status_2() {
    let bench = Bench::with_log();
    let serial = format!("fit log.csv --out p.bin --serial {}", "x".repeat(33));
    for arguments in [
        "",
        &serial,
        "fit",
        "fit log.csv --out p.bin --model 13",
        "fit log.csv --out p.bin --solver magic",
        "fit log.csv --out p.bin --solver shtlbo --model 30",
        "fit log.csv --out p.bin --solver shtlbo --model 31 --loss cauchy",
        "fit log.csv --out p.bin --model field --solver shtlbo",
        "fit log.csv --out p.bin --model field --project none",
        "fit log.csv --out p.bin --train 0",
        "fit log.csv --out p.bin --seed -1",
        "fit log.csv --out p.bin --threads 0",
        "decode p.bin --out pose.csv",
        "join bus.log log.csv --out x.csv --search-s=nan",
        "join bus.log log.csv --out x.csv --search-s=3601",
    ] {
        assert_eq!(bench.run(arguments).status.code(), Some(2), "{arguments}");
    }
    assert!(bench.holds_only(&["log.csv"]));
}

/// The blob describes these rows, but so would any other.
#[test]
fn a_log_where_nothing_moves_judges_no_blob_and_the_verdict_is_the_word_that_is_shown() {
    let bench = Bench::with_log();
    bench.good("fit log.csv --out p.bin");
    let log = bench.text("log.csv");
    let first: Vec<i64> = (log.lines().nth(1).expect("a row").split(','))
        .map(|cell| cell.parse().expect("whole"))
        .collect();
    let time = column(&log, "t_us");
    bench.write(
        "still.csv",
        changed(&log, |_, cells| {
            let t_us = cells[time];
            let movement = cells[0];
            cells.copy_from_slice(&first);
            (cells[0], cells[time]) = (movement, t_us);
        }),
    );
    let eval = "eval p.bin still.csv --json eval.json";
    bench.bad(eval, 4, &["Nothing moves", "Leave it out"]);
    assert_eq!(bench.json("eval.json")["verdict"], "refused");
}

#[test]
fn check_reads_a_stage_file_alone() {
    let bench = Bench::new();
    bench.good("check --stage stage.toml");
    bench.write("other.toml", "[hall]\n");
    bench.bad(
        "check --stage other.toml",
        3,
        &["other.toml:1:1: `hall.h1x_m`"],
    );
    bench.good("check");
    bench.bad("check --stage stage.toml --json -", 2, &["LOG"]);
}
