//! The main job through the command line, on the log that ships with the program.

use crate::common::{Bench, number, says, stdout};
use serde_json::Value;

fn close(value: &Value, expected: f64, part: f64) {
    let value = value.as_f64().expect("a number");
    assert!(
        (value - expected).abs() <= part * expected,
        "{value} {expected}"
    );
}

fn check_errors(errors: &Value) {
    close(&errors["x"]["rmse_um"], 1.023, 0.02);
    close(&errors["y"]["rmse_um"], 0.451, 0.02);
    close(&errors["rz"]["rmse_urad"], 2.178, 0.02);
    assert!(errors["x"]["peak_um"].as_f64() < Some(5.0));
    assert!(errors["y"]["peak_um"].as_f64() < Some(5.0));
}

#[test]
fn fit_eval_decode_and_inspect_agree_on_the_shipped_log() {
    let bench = Bench::new();
    bench.write("log.csv.gz", host_fit::input::shipped::LOG_GZ);
    bench.good("fit log.csv.gz --stage stage.toml --out p.bin --json fit.json --report report --serial S7 --created 2026-01-02");
    let fit = bench.json("fit.json");
    for (key, value) in [("model", "31"), ("project", "linear"), ("serial", "S7")] {
        assert_eq!(fit[key], value, "{key}");
    }
    assert_eq!(fit["seed"], 1);
    assert_eq!(fit["rows"], 57000);
    assert_eq!(fit["train_rows"], 57000);
    assert!(fit["evaluations"].as_u64() > Some(0));
    assert!(fit["elapsed_s"].as_f64() > Some(0.0));
    close(&fit["train_fitness"], 1.413, 0.02);
    check_errors(&fit["errors"]);
    check_errors(&fit["errors_solver_delta"]);
    assert_eq!(fit["warnings"].as_array().map(Vec::len), Some(0));
    let findings = fit["findings"].as_array().expect("a list");
    assert!(
        findings.iter().all(|finding| finding["severity"] == "note"),
        "{findings:?}"
    );
    let parameters = fit["parameters"].as_object().expect("an object");
    assert_eq!(parameters.len(), 18);
    for (name, p) in parameters {
        let error = p["standard_error"].as_f64().expect("a standard error");
        assert!(
            error > 0.0 && error < 0.2 * p["value"].as_f64().expect("a value").abs(),
            "{name}"
        );
        assert!(p["unit"].is_string());
    }

    let eval = bench.figures("eval p.bin log.csv.gz");
    check_errors(&eval["errors"]);
    assert_eq!(eval["errors"], fit["errors"]);
    let zero = bench.figures("eval p.bin log.csv.gz --delta zero");
    assert!(zero["errors"]["x"]["rmse_um"].as_f64() > eval["errors"]["x"]["rmse_um"].as_f64());

    let output = bench.good("decode p.bin log.csv.gz --out pose.csv");
    says(stdout(&output), "57000 of them with status 0");
    let poses = bench.text("pose.csv");
    assert_eq!(poses.lines().count(), 57001);
    assert_eq!(
        poses.lines().next(),
        Some(host_fit::output::pose_file::HEADER)
    );

    let inspect = bench.figures("inspect p.bin");
    assert_eq!(inspect["model"], "31");
    assert_eq!(inspect["serial"], "S7");
    assert_eq!(inspect["created"], "2026-01-02");
    close(&inspect["fit"]["errors"]["x"]["rmse_um"], 1.023, 0.02);
    let page = bench.text("report/index.html");
    assert!(page.contains("S7"));
}

#[test]
fn the_report_pages_show_what_was_given_escape_every_text_and_name_no_folder() {
    let bench = Bench::with_log();
    let folder = bench.path("").display().to_string();
    let more = "--operator A<b --note key=<i>x --created 2026-01-02";
    for command in [
        "fit log.csv --out p.bin --solver lm --serial <b>&S --report fit",
        "eval p.bin log.csv --report eval",
        "check log.csv --report check",
    ] {
        bench.good(&format!("{command} {more} --stage {folder}/stage.toml"));
    }
    for (name, title) in [
        ("fit", "Calibration report"),
        ("eval", "Errors on the log of a calibration"),
        ("check", "Check of a log"),
    ] {
        let page = bench.text(&format!("{name}/index.html"));
        for part in [
            title,
            "Limited</b>",
            "SHA-256",
            "A&lt;b",
            "<td>key</td><td>&lt;i&gt;x</td>",
            "2026-01-02",
            "--stage stage.toml",
        ] {
            assert!(page.contains(part), "{name}: {part}");
        }
        assert!(!page.contains(&folder) && !page.contains("<b>&"), "{name}");
        assert!(name == "check" || page.contains("&lt;b&gt;&amp;S"));
    }
}

#[test]
fn every_model_fits_and_richer_models_fit_better() {
    let bench = Bench::with_log();
    let mut last = f64::INFINITY;
    for model in ["12", "15", "30", "31"] {
        let fit = format!("fit log.csv --out p.bin --json p.json --model {model}");
        bench.good(&fit);
        let (json, eval) = (bench.json("p.json"), bench.figures("eval p.bin log.csv"));
        assert_eq!(json["model"], model);
        assert_eq!(eval["errors"], json["errors"], "({model})");
        assert_eq!(eval["delta"], json["delta"], "({model})");
        let fitness = number(&json["train_fitness"]);
        assert!(fitness < last, "({model}) {fitness} after {last}");
        last = fitness;
    }
}

#[test]
fn movements_that_a_plain_draw_misses_are_named_and_a_stratified_one_misses_none() {
    let bench = Bench::with_log();
    for (draw, missed) in [("plain", 1), ("stratified", 0)] {
        bench.good(&format!(
            "fit log.csv --out p.bin --json p.json --train 150 --draw {draw}"
        ));
        let json = bench.json("p.json");
        assert_eq!(json["train_rows"], 150);
        // The zero deviations that the few rows gave fit all rows worse than refitted ones.
        let rms = |errors: &Value| number(&errors["x"]["rmse_um"]);
        assert!(
            rms(&json["errors_solver_delta"]) > 1.02 * rms(&json["errors"]),
            "{draw}"
        );
        let findings = json["findings"].as_array().expect("a list");
        let messages = findings
            .iter()
            .filter_map(|found| found["message"].as_str());
        let named = messages.filter(|message| message.contains("The draw has no row of"));
        assert_eq!(named.count(), missed, "{draw}: {findings:?}");
    }
}

#[test]
fn demo_prints_the_tables_of_the_paper_beside_ours() {
    let bench = Bench::new();
    let output = bench.good("demo --out demo");
    let text = stdout(&output);
    for part in [
        "Table 2",
        "Table 4",
        "Table 8",
        "Table 7",
        "27.880",
        "1.392",
        "f32 against f64",
    ] {
        assert!(text.contains(part), "{part}");
    }
    let line = text.lines().find(|line| line.starts_with("fast moves"));
    let figures = line.unwrap_or_default().split([' ', ';']);
    let ratios: Vec<f64> = figures.filter_map(|word| word.parse().ok()).collect();
    let [.., x, y, _, corrected_x, corrected_y, corrected_rz] = ratios[..] else {
        panic!("{text}");
    };
    assert!(x > 1.5 && y > 1.5, "{line:?}");
    assert!(
        [corrected_x, corrected_y, corrected_rz]
            .iter()
            .all(|r| *r < 1.03),
        "{line:?}"
    );
    for file in ["params.bin", "pose.csv", "paper.csv.gz", "stage.toml"] {
        assert!(bench.has(&format!("demo/{file}")), "{file}");
    }
    assert!(bench.has("stage.toml"));
}
