//! An old calibration brought up to date, on a stage made of physics. Its codes are scaled as
//! changed gains scale them.

use crate::common::{Bench, changed, number, plan, says, stderr};

/// A log with probes A, B, C that read `gains` times as much.
pub fn with_gains(log: &str, gains: [f64; 3]) -> String {
    changed(log, |_, cells| {
        for (code, gain) in cells[HALL_A..].iter_mut().zip(gains) {
            *code = (*code as f64 * gain).round() as i64;
        }
    })
}

/// The column of Hall A, which B and C follow.
const HALL_A: usize = 8;

/// A fit of 8 s with its posterior, and a sine of 2 s along Y of the same stage.
fn bench() -> Bench {
    let bench = Bench::new();
    bench.write("run.csv", plan(8.0, [5.0, 8.0, 7.0, 6.0, 4.0, 7.5]));
    bench.write("y.csv", plan(2.0, [0.0, 4.0, 0.0, 0.0, 0.0, 0.0]));
    for (run, log) in [("run", "log"), ("y", "sine")] {
        bench.good(&format!(
            "simulate --plan {run}.csv --seed 3 --out {log}.csv"
        ));
    }
    bench.good("fit log.csv --out old.bin --model field --serial HS-3 --json fit.json");
    bench
}

#[test]
fn a_common_gain_is_found_from_two_seconds_along_y() {
    let bench = bench();
    bench.write("weak.csv", with_gains(&bench.text("sine.csv"), [0.99; 3]));
    bench.write("later.csv", with_gains(&bench.text("log.csv"), [0.99; 3]));
    let recalibrate = "recalibrate old.bin weak.csv --what gain";
    bench.good(&format!(
        "{recalibrate} --out new.bin --created 2026-11-26 --json new.json --report page"
    ));
    let page = bench.text("page/index.html");
    for part in [
        "As found and as left",
        "X, as found",
        "before: as found",
        "old.bin",
        "as left, SHA-256",
    ] {
        says(&page, part);
    }
    let json = bench.json("new.json");
    for probe in ["a", "b", "c"] {
        let gain = &json["gains"][probe];
        let error = number(&gain["standard_error_percent"]);
        assert!(error > 0.0 && error < 0.02, "{error}");
        let change = number(&gain["change_percent"]);
        assert!((change + 1.0).abs() < 5.0 * error, "{change} {error}");
    }
    let service = &json["predicted_service"];
    let (before, after) = (&service["before"], &service["after"]);
    for axis in ["x_um", "y_um", "rz_urad"] {
        let floor = number(&service["floor"][axis]);
        assert!(number(&before[axis]) > 1.2 * floor, "{axis}");
        assert!(number(&after[axis]) < 1.02 * floor, "{axis}");
    }
    let inspected = bench.figures("inspect new.bin");
    assert_eq!(
        (&inspected["serial"], &inspected["created"]),
        (&"HS-3".into(), &"2026-11-26".into())
    );

    // The new posterior carries on: here all parameters, from the new blob.
    bench.good("recalibrate new.bin later.csv --what all --out all.bin --json all.json");
    let change = number(&bench.json("all.json")["gains"]["b"]["change_percent"]);
    assert!(change.abs() < 0.05, "{change}");
    // The same without an old posterior: said, and none is written.
    std::fs::remove_file(bench.path("old.bin.posterior")).expect("there");
    let alone = bench.good(&format!("{recalibrate} --out alone.bin"));
    assert!(stderr(&alone).contains("no posterior stands beside"));
    assert!(!bench.has("alone.bin.posterior"));
}

#[test]
fn bad_rows_do_not_bend_it_and_what_does_is_in_the_verdict() {
    let bench = bench();
    bench.write("other.csv", plan(8.0, [6.0, 7.0, 8.0, 5.0, 4.5, 6.5]));
    bench.good("simulate --plan other.csv --seed 3 --out second.csv");
    let log = bench.text("second.csv");
    let sparks = changed(&log, |row, cells| {
        cells[HALL_A] += 1600 * i64::from(row % 100 == 50);
    });
    // From the middle of the run on B reads 0.2 % more.
    let drifts = changed(&log, |row, cells| {
        cells[HALL_A + 1] += cells[HALL_A + 1] * i64::from(row >= 2000) / 500;
    });
    for (log, code, verdict) in [
        // Service has the sparks of a probe, too.
        (sparks, "outliers", "limited"),
        (drifts, "gain_drift", "limited"),
    ] {
        bench.write("new.csv", log);
        let json = bench.figures("recalibrate old.bin new.csv --what all --out new.bin");
        assert_eq!(json["findings"][0]["code"], code, "{json}");
        assert_eq!(json["verdict"], verdict, "{code}");
        let change = number(&json["gains"]["a"]["change_percent"]);
        assert!(change.abs() < 0.05, "{change}");
    }
    // A fit takes it off, and says so beside the blob. A limit holds for service, not for the fault in the log.
    bench.good("fit new.csv --out repaired.bin --limit y=0.55um");
    bench.good("inspect repaired.bin --json inspect.json");
    let inspected = bench.json("inspect.json");
    let held = number(&inspected["fit"]["errors"]["y"]["rmse_um"]);
    assert!(held < 0.55, "{held}");
    let repaired = inspected["repaired"].as_array().expect("a list");
    assert_eq!(repaired.len(), 1);
    says(repaired[0].to_string(), "The gain of Hall B changes");
    let fit = "fit new.csv --out other.bin --limit y=0.2um";
    let words = "The errors in service are beyond the limit: y 0.4";
    bench.bad(fit, 4, &[words]);
}

#[test]
fn what_a_log_cannot_tell_is_refused_and_no_blob_is_left() {
    let bench = bench();
    let refused = |arguments: &str, status: i32, parts: &[&str]| {
        let arguments = format!("recalibrate {arguments} --out new.bin");
        bench.bad(&arguments, status, parts);
        assert!(!bench.has("new.bin") && !bench.has("new.bin.posterior"));
    };
    let parts = [
        "does not tell a gain for each probe",
        "X, Y and Rz moving at once",
    ];
    refused("old.bin sine.csv --what gains", 4, &parts);
    let turned = with_gains(&bench.text("log.csv"), [-1.0, 1.0, 1.0]);
    bench.write("turned.csv", turned);
    let parts = ["beyond all that probes drift", "columns, order and signs"];
    refused("old.bin turned.csv --what all", 4, &parts);
    let parts = ["was fitted to log.csv", "record a new log"];
    refused("old.bin log.csv --what gains --report found", 4, &parts);
    // An excerpt in another form is known, too: its second half, with times from zero.
    let log = bench.text("log.csv");
    let rows = log.lines().enumerate();
    let half = rows.filter(|(k, _)| *k == 0 || *k > 2000);
    let half = half
        .map(|(_, line)| format!("{line}\n"))
        .collect::<String>();
    bench.write("half.csv", half);
    let parts = ["was fitted to half.csv", "record a new log"];
    refused("old.bin half.csv --what gains", 4, &parts);
    // What the auditor then wants is the blob as it was found.
    let page = bench.text("found/index.html");
    for part in ["Calibration as found", "was fitted to log.csv", "X rms"] {
        says(&page, part);
    }
    assert!(!page.contains("Calibration certificate"));
    let arguments = "recalibrate old.bin sine.csv --what gain --out old.bin";
    bench.bad(arguments, 2, &["old.bin: also an input"]);
    let arguments = "diff old.bin old.bin --json old.bin.posterior";
    bench.bad(arguments, 2, &["old.bin.posterior: also an input"]);

    bench.good("fit log.csv --out p31.bin --model 31");
    let parts = ["Model (31)", "--model field"];
    refused("p31.bin sine.csv --what gain", 3, &parts);
    bench.good("fit log.csv --out other.bin --model field --serial OTHER");
    bench.write("other.bin.posterior", bench.read("old.bin.posterior"));
    let parts = ["other.bin.posterior belongs to another blob"];
    refused("other.bin log.csv --what all", 3, &parts);
    let judged = bench.run("eval other.bin sine.csv --json e.json");
    says(stderr(&judged), parts[0]);
    says(bench.json("e.json")["warnings"].to_string(), parts[0]);
    let again = "fit log.csv --out other.bin --model field --serial OTHER";
    let fitted = bench.good(&format!("{again} --created 2026-01-02 --report fitted"));
    says(
        stderr(&fitted),
        "is taken is not known: other.bin.posterior",
    );
    std::fs::remove_file(bench.path("old.bin.posterior")).expect("there");
    let parts = ["old.bin.posterior does not exist", "--what gains"];
    refused("old.bin log.csv --what all", 3, &parts);
}

#[test]
fn eval_of_a_fast_log_says_how_fast_it_is_and_is_limited_by_its_errors() {
    let bench = Bench::new();
    bench.good("plan --seconds 8 --out run.csv");
    let late = "--seed 3 --probe-lag-us 0,0,500";
    bench.good(&format!("simulate --plan run.csv {late} --out log.csv"));
    bench.good("fit log.csv --out late.bin");
    // A late probe stays late in the declared service, too, where it is beyond the limit.
    for (lag, verdict, severity) in [(late, "refused", "warn"), ("--seed 3", "good", "note")] {
        bench.good(&format!(
            "simulate --protocol fast {lag} --out fast.csv --force"
        ));
        bench.run("eval late.bin fast.csv --json fast.json");
        let json = bench.json("fast.json");
        assert_eq!(json["verdict"], verdict, "{}", json["findings"]);
        let findings = json["findings"].as_array().expect("a list");
        let motion = findings.iter().find(|found| found["code"] == "motion");
        let motion = motion.unwrap_or_else(|| panic!("{findings:?}"));
        assert_eq!(motion["severity"], severity);
        assert!(number(&motion["value"]) > 0.1, "{motion}");
        let worst = number(&json["errors"]["rz"]["rmse_urad"]);
        let noise = number(&json["predicted"]["rz"]["rms_urad"])
            / number(&json["predicted"]["rz"]["ratio"]);
        let said = number(&motion["cost"]);
        assert!(said >= 0.99 * worst / noise, "{said} {worst} {noise}");
    }
}

#[test]
fn a_late_probe_is_in_the_errors_of_a_recalibrated_blob_and_one_rule_judges_it_as_found_and_as_left()
 {
    let bench = bench();
    let simulate = "simulate --protocol combined --seed 3 --force";
    let recalibrate =
        "recalibrate old.bin late.csv --what gains --out new.bin --json new.json --report page";
    bench.good(&format!(
        "{simulate} --probe-lag-us 0,0,1500 --out late.csv"
    ));
    bench.bad(recalibrate, 4, &["The time of Hall C is 1.50 ms behind"]);
    let json = bench.json("new.json");
    let rms = |of: &str| number(&json["predicted_service"][of]["x_um"]);
    assert!(rms("after") > 1.3 * rms("floor"), "{json}");
    assert_eq!(json["verdict"], "refused");
    assert!(json["refusal"]["code"].is_string(), "{json}");
    let decision = &json["decision"]["x"];
    assert_eq!(
        (number(&decision["error_um"]), &decision["pass"]),
        (rms("after"), &false.into())
    );

    bench.good(&format!("{simulate} --out now.csv"));
    bench.write("late.csv", with_gains(&bench.text("now.csv"), [0.995; 3]));
    bench.good(recalibrate);
    let json = bench.json("new.json");
    let [found, left] = ["decision_as_found", "decision"].map(|of| &json[of]["y"]);
    assert_eq!(found["limit_um"], left["limit_um"]);
    assert_eq!(
        (&found["pass"], &left["pass"]),
        (&false.into(), &true.into())
    );
    let page = bench.text("page/index.html");
    says(&page, "As found and as left, by one decision rule");
}

#[test]
fn eval_tells_an_aged_blob_from_one_of_another_stage_and_from_the_log_of_the_fit() {
    let bench = bench();
    let own = bench.good("eval old.bin log.csv");
    says(stderr(&own), "the errors there verify nothing");
    let aged = with_gains(&bench.text("log.csv"), [0.998; 3]);
    bench.write("aged.csv", aged);
    let judged = |log: &str, words: &str, code: &str| {
        let eval = format!("eval old.bin {log} --json eval.json");
        bench.bad(&eval, 4, &[words]);
        let json = bench.json("eval.json");
        assert_eq!(json["verdict"], "refused");
        assert_eq!(json["refusal"]["code"], code, "{json}");
        json["findings"].as_array().map(Vec::len)
    };
    let words = "The errors in service are beyond the limit: ";
    judged("aged.csv", words, "beyond_limit");
    // No cable is blamed.
    bench.good("simulate --plan run.csv --seed 4 --out other.csv");
    let words = "A fit to this log has the probes elsewhere";
    assert_eq!(judged("other.csv", words, "other_log"), Some(0));
    // A row is blamed where the blob describes the rest.
    let spike = changed(&bench.text("log.csv"), |row, cells| {
        cells[HALL_A] += 3000 * i64::from(row == 2000)
    });
    bench.write("spike.csv", spike);
    let words = "If it is, the log has the faults above.";
    assert_eq!(judged("spike.csv", words, "other_log"), Some(1));
}

#[test]
fn a_number_is_taken_once_a_certificate_has_it_and_no_other_calibration_takes_it() {
    let bench = bench();
    bench.write("run.csv", plan(8.0, [6.0, 7.0, 8.0, 5.0, 4.5, 6.5]));
    bench.good("simulate --plan run.csv --seed 3 --out new.csv");
    let texts = [
        "number",
        "laboratory",
        "customer",
        "method",
        "conditions",
        "authorised_by",
    ];
    let texts = texts.map(|key| format!("{key} = \"of the {key}\"\n"));
    let texts = texts.concat() + "instruments = [\"a laser\"]\n";
    let stage = format!("{}\n[certificate]\n{texts}", bench.text("stage.toml"));
    bench.write("stage.toml", stage);
    let title = |arguments: &str, title: &str| {
        bench.good(&format!("{arguments} --report page"));
        let page = bench.text("page/index.html");
        says(&page, &format!("<h1>{title}</h1>"));
        if page.contains("<h1>Calibration certificate</h1>") {
            let eval = "eval cal.bin new.csv --report page";
            bench.bad(eval, 2, &["page/index.html: is a calibration certificate"]);
            std::fs::remove_file(bench.path("page/index.html")).expect("there");
        }
        page
    };
    let earlier = "<td>certificate of the blob</td><td>of the number</td>";
    let verified = |is_taken: bool| {
        let page = title("eval cal.bin new.csv", "Verification of a calibration");
        assert_eq!(page.contains(earlier), is_taken);
        says(&page, "<td>motion</td>");
    };
    let fit = "--out cal.bin --serial HS-3";
    title(&format!("fit log.csv {fit}"), "Calibration report");
    verified(false);
    for _ in 0..2 {
        title(
            &format!("fit log.csv {fit} --created 2026-01-02"),
            "Calibration certificate",
        );
        verified(true);
    }
    bench.bad(
        "recalibrate cal.bin new.csv --what gains --out new.bin --created 2025-12-31",
        3,
        &["2025-12-31", "2026-01-02"],
    );
    // The blob at --out has its number, too.
    let stage = bench.text("stage.toml");
    bench.write("stage.toml", stage.replace("of the number", "another one"));
    for (what, page) in [("gains", "certificate"), ("gain", "report")] {
        let command = format!("recalibrate cal.bin new.csv --what {what} --out new.bin");
        let page = format!("Calibration {page}");
        title(&format!("{command} --created 2026-02-02"), &page);
    }
    // A number that is kept nowhere is not issued.
    let fit_31 = "fit log.csv --out 31.bin --model 31 --serial HS-3 --created 2026-02-02";
    let page = title(fit_31, "Calibration report");
    says(&page, "a posterior, which keeps the number");
    bench.write("stage.toml", stage);
    for command in [
        "recalibrate cal.bin new.csv --what gains --out new.bin",
        &format!("fit new.csv {fit}"),
    ] {
        let page = title(
            &format!("{command} --created 2026-02-02"),
            "Calibration report",
        );
        says(&page, "a number of its own");
    }
    bench.bad(
        "fit log.csv --out x.bin --created tomorrow",
        2,
        &["2026-11-26"],
    );
}
