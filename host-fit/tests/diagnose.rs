//! What the program says of logs with mistakes that labs make, and that it writes no blob of them.

mod common;

use common::{Bench, stderr, thinned_log};
use host_fit::input::shipped::STAGE_TOML;

/// Every tenth row of the shipped log.
fn log() -> String {
    thinned_log(10, |_| true)
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

/// The log with the numbers of some columns changed.
fn changed(log: &str, columns: &[&str], change: impl Fn(i64, i64) -> i64) -> String {
    let mut lines = log.lines();
    let header = lines.next().expect("a header");
    let names: Vec<&str> = header.split(',').collect();
    let mut out = header.to_owned() + "\n";
    for line in lines {
        let numbers: Vec<i64> = line.split(',').map(|x| x.parse().expect("whole")).collect();
        let cells = names.iter().zip(&numbers).map(|(name, &number)| {
            let number = if columns.contains(name) {
                change(numbers[0], number)
            } else {
                number
            };
            number.to_string()
        });
        out += &(cells.collect::<Vec<_>>().join(",") + "\n");
    }
    out
}

const BEAMS: [&str; 3] = ["ifm_x_nm", "ifm_y1_nm", "ifm_y2_nm"];
const GAPS: [&str; 3] = ["cap1_cnt", "cap2_cnt", "cap3_cnt"];

/// Refused by `check` with this code and message, and by `fit` without a blob.
fn is_refused(log: &str, stage: &str, code: &str, parts: &[&str]) {
    let bench = Bench::new();
    bench.write("stage.toml", stage);
    bench.write("log.csv", log);
    bench.bad(
        "fit log.csv --stage stage.toml --out p.bin --solver lm --report report",
        4,
        parts,
    );
    assert!(bench.holds_only(&["log.csv", "report"]), "{code}");
    let page = bench.text("report/index.html");
    assert!(page.contains("Refused") && page.contains(code), "{code}");
    bench.bad("check log.csv --stage stage.toml --json c.json", 4, parts);
    let found = &bench.json("c.json")["findings"][0];
    assert_eq!(
        (found["code"].as_str(), found["severity"].as_str()),
        (Some(code), Some("refuse"))
    );
    for part in parts {
        let message = found["message"].as_str().expect("a message");
        assert!(message.contains(part), "{code}: {message}");
    }
}

#[test]
fn exchanged_channels_are_named_and_refused() {
    let log = log();
    for (one, other, code, words) in [
        (
            "hall_a_cnt",
            "hall_b_cnt",
            "channels_swapped",
            "fits if Hall A and B are exchanged",
        ),
        (
            "hall_a_cnt",
            "hall_c_cnt",
            "channels_swapped",
            "fits if Hall A and C are exchanged",
        ),
        (
            "ifm_y1_nm",
            "ifm_y2_nm",
            "beams_swapped",
            "fits if beam Y1 and Y2 are exchanged",
        ),
        (
            "ifm_x_nm",
            "ifm_y1_nm",
            "beams_swapped",
            "fits if beam X and Y1 are exchanged",
        ),
        (
            "cap1_cnt",
            "cap2_cnt",
            "capacitive_swapped",
            "fits if capacitive 1 and 2 are exchanged",
        ),
        (
            "cap1_cnt",
            "cap3_cnt",
            "capacitive_swapped",
            "fits if capacitive 1 and 3 are exchanged",
        ),
    ] {
        is_refused(&exchanged(&log, one, other), STAGE_TOML, code, &[words]);
    }
}

#[test]
fn turned_signs_are_named_and_refused() {
    let log = log();
    for (columns, code, words) in [
        (
            &["hall_c_cnt"][..],
            "channel_inverted",
            "fits if the sign of Hall C is turned",
        ),
        (
            &["ifm_x_nm"],
            "beam_inverted",
            "fits if the sign of beam X is turned",
        ),
        (
            &["cap3_cnt"],
            "capacitive_inverted",
            "fits if the sign of capacitive 3 is turned",
        ),
        (
            &GAPS,
            "capacitive_inverted",
            "fits if the signs of all capacitive channels are turned",
        ),
    ] {
        is_refused(
            &changed(&log, columns, |_, x| -x),
            STAGE_TOML,
            code,
            &[words],
        );
    }
    let stage = STAGE_TOML.replace("[0.0, -0.12]]", "[0.0, 0.12]]");
    let words = "fits if the y of capacitive sensor 3 in stage.toml is -0.12 m";
    is_refused(&log, &stage, "capacitive_inverted", &[words]);
}

/// Where the search ranges hold every sign, the probes' places tell.
#[test]
fn exchanged_capacitive_sensors_are_named_without_search_ranges_that_exclude_them() {
    let both = "[-5000.0, 5000.0]";
    let lines = STAGE_TOML.lines().map(|line| match line.split(' ').next() {
        Some(key @ ("b_per_rad" | "c_per_rad")) => format!("{key} = [{both}, {both}, {both}]\n"),
        _ => format!("{line}\n"),
    });
    let stage: String = lines.collect();
    let exchanged = exchanged(&log(), "cap1_cnt", "cap2_cnt");
    let words = "fits if capacitive 1 and 2 are exchanged";
    is_refused(&exchanged, &stage, "capacitive_swapped", &[words]);
}

#[test]
fn wrong_scales_are_named_and_refused() {
    let log = log();
    let in_um = changed(&log, &BEAMS, |_, nm| (nm + 500).div_euclid(1000));
    let words = "fits if the reference is multiplied by 1000";
    is_refused(
        &in_um,
        STAGE_TOML,
        "scale_wrong",
        &[words, "the reference spans 1.0 um"],
    );
    for (from, to, words) in [
        (
            "m_per_count = 6.25e-8",
            "m_per_count = 12.5e-8",
            "the Hall signals are multiplied by 0.50",
        ),
        (
            "y_baseline_m = 0.10",
            "y_baseline_m = 0.20",
            "Rz of the reference is multiplied by 2.0",
        ),
    ] {
        is_refused(&log, &STAGE_TOML.replace(from, to), "scale_wrong", &[words]);
    }
}

#[test]
fn resets_far_from_zero_are_named_and_not_called_signs() {
    let bench = Bench::new();
    let off = changed(&log(), &BEAMS, |movement, nm| nm + movement % 2 * 50_000);
    bench.write("log.csv", off);
    let output = bench.run("fit log.csv --stage stage.toml --out p.bin");
    let message = stderr(&output);
    assert_eq!(output.status.code(), Some(4), "{message}");
    for part in [
        "of 57 movements (1, 3, 5, 7, 9, ...)",
        "widen search.delta_m in stage.toml to [-60e-6, 60e-6]",
    ] {
        assert!(message.contains(part), "{message}");
    }
    assert!(!message.contains("signs of the sensors"), "{message}");
    // The remedy is one.
    let wider = STAGE_TOML.replace("delta_m = [-10e-6, 10e-6]", "delta_m = [-60e-6, 60e-6]");
    bench.write("stage.toml", wider);
    bench.good("check log.csv --stage stage.toml");
}

#[test]
fn a_log_of_another_gain_is_told_from_the_first() {
    let bench = Bench::new();
    let log = log();
    bench.write("first.csv", &log);
    let halls = ["hall_a_cnt", "hall_b_cnt", "hall_c_cnt"];
    bench.write(
        "second.csv",
        changed(&log, &halls, |_, code| (code * 103 + 50).div_euclid(100)),
    );
    let parts = [
        "first.csv alone to",
        "in second.csv differs by +3.0, +3.0, +3.0 %",
    ];
    bench.bad(
        "fit first.csv second.csv --stage stage.toml --out p.bin",
        4,
        &parts,
    );
    assert!(bench.holds_only(&["first.csv", "second.csv"]));
}

#[test]
fn a_sound_log_gives_no_finding_but_a_note() {
    let bench = Bench::new();
    bench.write("log.csv", log());
    bench.good("check log.csv --stage stage.toml --json c.json");
    bench.good("fit log.csv --stage stage.toml --out p.bin --json p.json");
    for name in ["c.json", "p.json"] {
        let json = bench.json(name);
        let findings = json["findings"].as_array().expect("a list");
        let severities = findings.iter().map(|finding| finding["severity"].as_str());
        assert!(severities.eq([Some("note")]), "{name}: {findings:?}");
    }
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
    bench.good("fit log.csv --stage stage.toml --out p.bin");
    bench.good("eval p.bin log.csv --stage stage.toml");
    let parts = ["more than 3 times", "fits if the sign of Hall A is turned"];
    bench.bad(
        "eval p.bin turned.csv --stage stage.toml --json e.json",
        4,
        &parts,
    );
    assert_eq!(
        bench.json("e.json")["findings"][0]["code"],
        "channel_inverted"
    );
    bench.good("eval p.bin turned.csv --stage stage.toml --limit 1e6");
    bench.bad(
        "eval p.bin log.csv --stage stage.toml --limit 0.9",
        4,
        &["more than 0.9 times"],
    );
    bench.bad(
        "eval p.bin log.csv --stage stage.toml --limit 0",
        2,
        &["above zero"],
    );
}
