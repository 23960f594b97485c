//! The main job through the command line, on the log that ships with the program.

use crate::common::{Bench, log, number, shipped_log, stdout, thinned_log};
use serde_json::Value;

fn close(value: &Value, expected: f64, part: f64) {
    let value = value.as_f64().expect("a number");
    assert!(
        (value - expected).abs() <= part * expected,
        "{value} {expected}"
    );
}

fn check_errors(errors: &Value) {
    close(&errors["x"]["rmse_um"], 0.946, 0.02);
    close(&errors["y"]["rmse_um"], 0.484, 0.02);
    close(&errors["rz"]["rmse_urad"], 2.276, 0.02);
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
    close(&fit["train_fitness"], 1.45, 0.02);
    check_errors(&fit["errors"]);
    check_errors(&fit["errors_solver_delta"]);
    assert_eq!(fit["warnings"].as_array().map(Vec::len), Some(0));
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

    bench.good("eval p.bin log.csv.gz --stage stage.toml --json eval.json");
    let eval = bench.json("eval.json");
    check_errors(&eval["errors"]);
    assert_eq!(eval["errors"], fit["errors"]);
    bench.good("eval p.bin log.csv.gz --stage stage.toml --delta zero --json zero.json");
    let zero = bench.json("zero.json");
    assert!(zero["errors"]["x"]["rmse_um"].as_f64() > eval["errors"]["x"]["rmse_um"].as_f64());

    let output = bench.good("decode p.bin log.csv.gz --stage stage.toml --out pose.csv");
    assert!(
        stdout(&output).contains("57000 of them with status 0"),
        "{}",
        stdout(&output)
    );
    let poses = bench.text("pose.csv");
    assert_eq!(poses.lines().count(), 57001);
    assert_eq!(
        poses.lines().next(),
        Some(host_fit::output::pose_file::HEADER)
    );

    bench.good("inspect p.bin --json inspect.json");
    let inspect = bench.json("inspect.json");
    assert_eq!(inspect["model"], "31");
    assert_eq!(inspect["serial"], "S7");
    assert_eq!(inspect["created"], "2026-01-02");
    close(&inspect["fit"]["errors"]["x"]["rmse_um"], 0.946, 0.02);
    let page = bench.text("report/index.html");
    assert!(page.contains("S7"));
}

#[test]
fn the_report_pages_show_the_figures_escape_every_text_and_name_no_folder() {
    let bench = Bench::with_log();
    let folder = bench.path("").display().to_string();
    let more = "--operator A<b --note key=<i>x --created 2026-01-02";
    for command in [
        "fit log.csv --out p.bin --solver lm --serial <b>&S --json fit.json --report fit",
        "eval p.bin log.csv --json eval.json --report eval",
        "check log.csv --report check",
    ] {
        bench.good(&format!("{command} {more} --stage {folder}/stage.toml"));
    }
    // After the end of a cell with this text, the text of the next cells.
    let cells = |page: &str, name: &str| {
        let row = page
            .split(&format!(">{name}</td>"))
            .nth(1)
            .expect("a row")
            .to_owned();
        let cells = row
            .split("</td>")
            .map(|cell| cell.rsplit('>').next().unwrap_or_default().to_owned());
        cells.collect::<Vec<_>>()
    };
    for (name, title) in [
        ("fit", "Calibration certificate"),
        ("eval", "Verification of a calibration"),
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
        if name != "check" {
            assert!(page.contains("&lt;b&gt;&amp;S"));
            let errors = &bench.json(&format!("{name}.json"))["errors"];
            for (axis, key) in [("X", "x"), ("Y", "y")] {
                let rms = format!("{:.2}", number(&errors[key]["rmse_um"]));
                assert_eq!(cells(&page, axis)[0], rms, "{name}");
            }
        }
    }
    let eta = &bench.json("fit.json")["parameters"]["eta_b"];
    let row = cells(&bench.text("fit/index.html"), "eta");
    let shown: f64 = row[2]
        .split('(')
        .next()
        .and_then(|x| x.parse().ok())
        .expect("a value");
    let error = number(&eta["standard_error"]);
    assert!(
        (shown - number(&eta["value"])).abs() < 0.1 * error,
        "{row:?}"
    );
}

#[test]
fn blob_bytes_do_not_depend_on_threads_and_follow_the_seed() {
    let bench = Bench::new();
    bench.write("log.csv.gz", host_fit::input::shipped::LOG_GZ);
    for (out, arguments) in [
        ("one.bin", "--threads 1"),
        ("two.bin", "--threads 2"),
        ("draw1.bin", "--train 200 --threads 1"),
        ("draw2.bin", "--train 200 --threads 2"),
        ("draw3.bin", "--train 200 --seed 2"),
    ] {
        bench.good(&format!(
            "fit log.csv.gz --stage stage.toml --out {out} {arguments}"
        ));
    }
    assert_eq!(bench.read("one.bin"), bench.read("two.bin"));
    assert_eq!(bench.read("draw1.bin"), bench.read("draw2.bin"));
    assert_ne!(bench.read("draw1.bin"), bench.read("draw3.bin"));
}

#[test]
fn every_model_and_form_fits_and_richer_models_fit_better() {
    let bench = Bench::with_log();
    let mut last = f64::INFINITY;
    for model in ["12", "15", "30", "31"] {
        for project in ["linear", "delta", "none"] {
            let arguments = format!(
                "fit log.csv --stage stage.toml --out p.bin --json p.json --solver lm --model {model} --project {project}"
            );
            bench.good(&arguments);
            let json = bench.json("p.json");
            assert_eq!(json["model"], model);
            bench.good("eval p.bin log.csv --stage stage.toml --json eval.json");
            let eval = bench.json("eval.json");
            assert_eq!(
                (&eval["errors"], &eval["delta"]),
                (&json["errors"], &json["delta"]),
                "({model}) {project}"
            );
            let fitness = number(&json["train_fitness"]);
            if project == "linear" {
                assert!(
                    fitness < last,
                    "({model}) {fitness} is no better than {last}"
                );
                last = fitness;
            } else {
                assert!(
                    (fitness / last - 1.0).abs() < 1e-3,
                    "({model}) {project}: {fitness} {last}"
                );
            }
        }
    }
}

#[test]
fn a_log_in_si_columns_other_separators_and_line_ends_gives_the_same_figures() {
    let bench = Bench::new();
    let log = log();
    bench.write("plain.csv", &log);
    bench.good("fit plain.csv --stage stage.toml --out plain.bin --json plain.json");
    let semicolons = format!(
        "# a comment\r\n{}",
        log.replace(',', ";").replace('\n', "\r\n")
    );
    bench.write("semicolons.csv", semicolons);
    bench.good("fit semicolons.csv --stage stage.toml --out s.bin --json s.json");
    assert_eq!(
        bench.json("plain.json")["errors"],
        bench.json("s.json")["errors"]
    );

    // The reference in SI instead of beams.
    let mut si = String::from(
        "movement,t_us,x_m,y_m,rz_rad,cap1_cnt,cap2_cnt,cap3_cnt,hall_a_cnt,hall_b_cnt,hall_c_cnt\n",
    );
    for line in log.lines().skip(1) {
        let cells: Vec<f64> = line
            .split(',')
            .map(|c| c.parse().expect("a number"))
            .collect();
        let (x, y1, y2) = (cells[2] * 1e-9, cells[3] * 1e-9, cells[4] * 1e-9);
        let rest: Vec<&str> = line.split(',').skip(5).collect();
        let (y, rz) = ((y1 + y2) / 2.0, ((y1 - y2) / 0.1).atan());
        si.push_str(&format!(
            "{},{},{x:e},{y:e},{rz:e},{}\n",
            cells[0],
            cells[1],
            rest.join(",")
        ));
    }
    bench.write("si.csv", si);
    bench.good("fit si.csv --stage stage.toml --out si.bin --json si.json");
    let (a, b) = (bench.json("plain.json"), bench.json("si.json"));
    let rms = |json: &Value| number(&json["errors"]["x"]["rmse_um"]);
    assert!((rms(&a) - rms(&b)).abs() < 1e-6);
}

#[test]
fn movements_that_a_plain_draw_misses_are_named_and_a_stratified_one_misses_none() {
    let bench = Bench::with_log();
    for (draw, missed) in [("plain", 1), ("stratified", 0)] {
        bench.good(&format!(
            "fit log.csv --stage stage.toml --out p.bin --json p.json --train 150 --draw {draw}"
        ));
        let json = bench.json("p.json");
        assert_eq!(json["train_rows"], 150);
        // The zero deviations that the few rows gave fit all rows worse than refitted ones.
        let rms = |errors: &Value| number(&errors["x"]["rmse_um"]);
        assert!(
            rms(&json["errors_solver_delta"]) > 1.02 * rms(&json["errors"]),
            "{draw}"
        );
        let warnings = json["warnings"].as_array().expect("a list");
        let named = warnings
            .iter()
            .filter_map(Value::as_str)
            .filter(|warning| warning.contains("the draw of rows misses"));
        assert_eq!(named.count(), missed, "{draw}: {warnings:?}");
    }
}

#[test]
fn several_logs_are_fitted_together_and_hashed_in_their_order() {
    let bench = Bench::new();
    bench.write("a.csv", thinned_log(20, |m| m < 30));
    bench.write("b.csv", thinned_log(20, |m| m >= 30));
    bench.good("fit a.csv b.csv --stage stage.toml --out ab.bin --json ab.json");
    bench.good("fit b.csv a.csv --stage stage.toml --out ba.bin --json ba.json");
    assert_eq!(bench.json("ab.json")["movements"], 57);
    bench.good("inspect ab.bin --json ab.json");
    bench.good("inspect ba.bin --json ba.json");
    assert_ne!(
        bench.json("ab.json")["logs_sha256"],
        bench.json("ba.json")["logs_sha256"]
    );
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
    for file in ["params.bin", "pose.csv", "paper.csv.gz", "stage.toml"] {
        assert!(bench.has(&format!("demo/{file}")), "{file}");
    }
    let nanometres: Vec<f64> = text
        .lines()
        .skip_while(|line| !line.starts_with("f32 against f64"))
        .nth(1)
        .expect("the line")
        .split_whitespace()
        .filter_map(|word| word.parse().ok())
        .collect();
    assert!(
        nanometres[0] <= 0.25 && nanometres[1] <= 0.25 && nanometres[2] <= 1.0,
        "{nanometres:?}"
    );
    assert!(bench.has("stage.toml"));
}

#[test]
fn the_shipped_log_has_the_size_of_the_papers_experiment() {
    assert_eq!(shipped_log().lines().count(), 57001);
}
