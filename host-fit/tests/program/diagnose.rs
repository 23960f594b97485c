//! What the program says of logs with mistakes that labs make, and that it writes no blob of them.

use crate::common::{self, Bench, column, stderr, stdout, thinned_log};
use host_fit::input::shipped::STAGE_TOML;

/// Every fiftieth row of the shipped log.
fn log() -> String {
    thinned_log(50, |_| true)
}

/// Its stage: rows come every 0.1 s.
fn stage() -> String {
    STAGE_TOML.replace("period_s = 0.002", "period_s = 0.1")
}

/// The log with two columns under each other's name.
fn exchanged(log: &str, one: &str, other: &str) -> String {
    let (header, rows) = log.split_once('\n').expect("a header");
    let header = header
        .replace(one, "?")
        .replace(other, one)
        .replace('?', other);
    format!("{header}\n{rows}")
}

/// The log with the numbers of some columns changed, which depends on the movement too.
fn changed(log: &str, columns: &[&str], change: impl Fn(i64, i64) -> i64) -> String {
    let places: Vec<usize> = columns.iter().map(|name| column(log, name)).collect();
    common::changed(log, |_, cells| {
        for &place in &places {
            cells[place] = change(cells[0], cells[place]);
        }
    })
}

const BEAMS: [&str; 3] = ["ifm_x_nm", "ifm_y1_nm", "ifm_y2_nm"];

/// Also where the fit of a model gives a blob, and figures if they are asked for.
#[test]
fn fit_writes_no_blob_of_a_refused_log_but_with_force_one_that_says_so() {
    let bench = Bench::new();
    bench.write("stage.toml", stage());
    let turned = changed(&log(), &["hall_c_cnt"], |_, x| -x);
    bench.write("turned.csv", turned);
    let gaps = exchanged(&log(), "cap1_cnt", "cap2_cnt");
    bench.write("gaps.csv", gaps);
    for (log, words, code) in [
        (
            "turned.csv",
            "the sign of Hall C is inverted",
            "channel_inverted",
        ),
        (
            "gaps.csv",
            "capacitive sensor 1 and capacitive sensor 2 are exchanged",
            "capacitive_swapped",
        ),
    ] {
        let fit = format!("fit {log} --out p.bin --json p.json");
        bench.bad(&fit, 4, &[words]);
        assert!(!bench.has("p.bin"));
        assert_eq!(bench.json("p.json")["findings"][0]["code"], code);
        let output = bench.good(&format!("{fit} --force"));
        assert!(stderr(&output).contains("written all the same, as --force asks"));
        let coloured = bench.command(&fit).env("CLICOLOR_FORCE", "1").output();
        let coloured = stdout(&coloured.expect("run"));
        assert!(
            coloured.contains("\x1b[1m\x1b[31mRefused\x1b[0m\n"),
            "{coloured}"
        );
        for command in ["inspect p.bin --json i.json", "export p.bin --out p.hex"] {
            assert!(stderr(&bench.good(command)).contains("(--force)"));
        }
        std::fs::remove_file(bench.path("p.hex")).expect("removed");
        assert_eq!(bench.json("i.json")["fit"]["forced"], true);
        std::fs::remove_file(bench.path("p.bin")).expect("removed");
    }
}

#[test]
fn a_fit_beyond_its_limits_is_not_written_without_force() {
    let bench = Bench::new();
    bench.write("log.csv", log());
    let fit = "fit log.csv --out p.bin --limit";
    bench.bad(
        &format!("{fit} x=1nm,rz=1mrad"),
        4,
        &[
            "The errors on the log are beyond the limit: x 0.9",
            "No parameter blob was written",
        ],
    );
    assert!(bench.holds_only(&["log.csv"]));
    bench.bad(&format!("{fit} x=1"), 2, &["x=1.5um,y=1um,rz=4urad"]);
    bench.good(&format!("{fit} x=1nm --force"));
    bench.good("inspect p.bin --json i.json");
    assert_eq!(bench.json("i.json")["fit"]["forced"], true);
    let decoded = bench.good("decode p.bin log.csv --out pose.csv");
    assert!(stdout(&decoded).contains("rows: parameters written by --force"));
    bench.good(&format!("{fit} x=1.5um,y=1um,rz=4urad"));
    bench.good("inspect p.bin --json i.json");
    assert_eq!(bench.json("i.json")["fit"]["forced"], false);
}

#[test]
fn resets_far_from_zero_are_a_warning_and_not_called_signs() {
    let bench = Bench::new();
    let off = changed(&log(), &BEAMS, |movement, nm| nm + movement % 2 * 50_000);
    bench.write("log.csv", off);
    let output = bench.run("fit log.csv --out p.bin");
    let message = stderr(&output);
    assert_eq!(output.status.code(), Some(0), "{message}");
    for part in ["of 57 movements", "widen search.delta_m in stage.toml"] {
        assert!(message.contains(part), "{message}");
    }
    assert!(!message.contains("signs of the sensors"), "{message}");
    // The remedy is one.
    let wider = stage().replace("delta_m = [-10e-6, 10e-6]", "delta_m = [-60e-6, 60e-6]");
    bench.write("stage.toml", wider);
    bench.good("check log.csv");
}

#[test]
fn eval_judges_a_blob_by_its_own_errors() {
    let bench = Bench::new();
    let log = log();
    bench.write("log.csv", &log);
    bench.write(
        "turned.csv",
        changed(&log, &["hall_a_cnt"], |_, code| -code),
    );
    bench.good("fit log.csv --out p.bin");
    bench.good("eval p.bin log.csv");
    let parts = [
        "more than 10 (--limit)",
        "fits if the sign of Hall A is inverted",
    ];
    bench.bad("eval p.bin turned.csv --json e.json", 4, &parts);
    assert_eq!(
        bench.json("e.json")["findings"][0]["code"],
        "channel_inverted"
    );
    // Within that limit the log is still at fault.
    let parts = ["The log is refused", "sign of Hall A is inverted"];
    bench.bad("eval p.bin turned.csv --limit 1e6", 4, &parts);
    bench.bad(
        "eval p.bin log.csv --limit 0.9",
        4,
        &["more than 0.9 (--limit)"],
    );
    bench.bad("eval p.bin log.csv --limit 0", 2, &["above zero"]);
}

#[test]
fn movements_that_are_too_short_to_show_an_error_are_reported_and_refused() {
    let bench = Bench::new();
    let log = thinned_log(10, |_| true);
    for (rows, status) in [(2, Some(4)), (5, Some(0)), (20, None)] {
        let short = common::changed(&log, |row, cells| {
            let row = row as i64;
            (cells[0], cells[1]) = (row / rows, 2_000 * row);
        });
        bench.write("log.csv", short);
        let fit = bench.run("fit log.csv --out p.bin --json fit.json");
        let found = bench.json("fit.json");
        let codes = found["findings"].as_array().expect("a list");
        let is_found = codes.iter().any(|found| found["code"] == "short_movements");
        assert_eq!(is_found, status.is_some(), "{rows}: {}", stderr(&fit));
        assert_eq!(
            fit.status.code(),
            status.or(Some(0)),
            "{rows}: {}",
            stderr(&fit)
        );
    }
}
