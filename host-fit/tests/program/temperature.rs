//! A simulated stage that warms in service: fitted cold, brought up to date warm, judged over the day.

use crate::common::{Bench, number, plan};

const TEMPERATURE: &str = "
[temperature]
mount = \"mount_mc\"
body = \"body_mc\"
unit = \"mC\"
";

/// k of the probes, %/K, and how far from its temperature the blob is good, by its judgement over the day.
fn known(bench: &Bench, blob: &str) -> ([f64; 3], f64) {
    bench.good(&format!("inspect {blob} --json inspect.json"));
    let temperature = &bench.json("inspect.json")["temperature"];
    let (k, errors) = (
        &temperature["k_h_per_k"],
        &temperature["standard_errors_per_k"],
    );
    assert!(number(&errors[0][0]) > 0.0, "{temperature}");
    bench.good(&format!(
        "eval {blob} day.csv --stage warm.toml --json eval.json"
    ));
    let within = number(&bench.json("eval.json")["valid_within_k"]);
    ([0, 1, 2].map(|probe| 100.0 * number(&k[probe][0])), within)
}

#[test]
fn a_run_at_work_tells_how_the_stage_follows_temperature() {
    let bench = Bench::new();
    let without = bench.text("stage.toml");
    bench.write("warm.toml", without + TEMPERATURE);
    bench.write("run.csv", plan(8.0, [5.0, 8.0, 7.0, 6.0, 4.0, 7.5]));
    let simulate = "simulate --seed 3 --plan run.csv --hour";
    let refused = &["names no column", "[temperature]"];
    bench.bad(&format!("{simulate} 1 --out log.csv"), 2, refused);
    for (log, hour) in [("cold", "-0.2"), ("later", "2"), ("warm", "3.5")] {
        bench.good(&format!(
            "{simulate} {hour} --stage warm.toml --out {log}.csv"
        ));
    }
    bench.good("simulate --seed 3 --protocol day --stage warm.toml --out day.csv");
    let fit = bench.figures("fit cold.csv --stage warm.toml --model field --out cold.bin");
    assert_eq!(fit["temperatures"][0]["sensor"], "mount");
    let findings = fit["findings"].as_array().expect("findings");
    let notes = findings
        .iter()
        .filter(|found| found["code"] == "temperature");
    assert_eq!(notes.count(), 2, "one for each sensor: {findings:?}");
    let (k, within) = known(&bench, "cold.bin");
    assert!(
        k.iter().all(|k| (k + 0.12).abs() < 1e-4),
        "as expected of the magnets: {k:?}"
    );
    let recalibrate = "recalibrate --stage warm.toml --what temperature";
    bench.good(&format!("{recalibrate} cold.bin warm.csv --out warm.bin"));
    bench.good(&format!("{recalibrate} warm.bin later.csv --out later.bin"));
    let (of_warm, of_later) = (known(&bench, "warm.bin"), known(&bench, "later.bin"));
    assert!(
        of_warm.0.iter().all(|k| (-0.15..-0.09).contains(k)),
        "{of_warm:?}"
    );
    assert!(
        of_warm.1 > 1.5 * within && of_later.1 > of_warm.1,
        "{within} {of_warm:?} {of_later:?}"
    );
    // Each degree of the day, and a zero that does not hold all day.
    let [mount, body] = ["mount", "body"].map(|sensor| {
        let json = bench.json("eval.json");
        let degrees = json["temperatures"].as_array().expect("degrees").clone();
        degrees
            .iter()
            .filter(|degree| degree["sensor"] == sensor)
            .count()
    });
    assert!(mount > 3 && body > 6, "{mount} {body}");
    // A blob that follows temperatures, on a log that has none.
    let without: Vec<String> = bench.text("warm.csv").lines().map(first_columns).collect();
    bench.write("none.csv", without.join("\n") + "\n");
    let words = ["rows have no temperature", "beyond the limit: y"];
    bench.bad(
        "eval warm.bin none.csv --stage warm.toml --limit 99",
        4,
        &words,
    );
    bench.bad(
        "fit cold.csv none.csv --stage warm.toml --out x.bin",
        4,
        &["have no temperature"],
    );
    // Magnets of another kind than the stage file says.
    let other = bench.text("warm.toml") + "magnet = \"SmCo\"\n";
    bench.write("other.toml", other);
    let fit = "fit cold.csv later.csv warm.csv --stage other.toml --model field --out x.bin";
    bench.bad(fit, 4, &["standard deviations from `magnet`"]);
}

/// A row without its last two cells.
fn first_columns(row: &str) -> String {
    let cells: Vec<&str> = row.split(',').collect();
    cells[..cells.len() - 2].join(",")
}
