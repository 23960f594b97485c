//! An old calibration brought up to date, on a stage made of physics. Its codes are scaled as
//! changed gains scale them.

use crate::common::{Bench, changed, number, plan, says, stderr, stdout};

/// A log with probes A, B, C that read `gains` times as much.
fn with_gains(log: &str, gains: [f64; 3]) -> String {
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
        "{recalibrate} --out new.bin --created today --json new.json"
    ));
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
    let good = bench.rms("old.bin", "log.csv");
    let (before, after) = (
        bench.rms("old.bin", "later.csv"),
        bench.rms("new.bin", "later.csv"),
    );
    assert!(before[1] > 5.0 * good[1], "{before:?} {good:?}");
    for axis in 0..3 {
        assert!(after[axis] < 1.02 * good[axis], "{after:?} {good:?}");
    }
    let inspected = bench.figures("inspect new.bin");
    assert_eq!(
        (&inspected["serial"], &inspected["created"]),
        (&"HS-3".into(), &"today".into())
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
    let alone = bench.rms("alone.bin", "later.csv");
    assert!(alone[1] < 1.02 * good[1], "{alone:?} {good:?}");
}

#[test]
fn bad_rows_do_not_bend_it_and_what_does_is_in_the_verdict() {
    let bench = bench();
    let log = bench.text("log.csv");
    let sparks = changed(&log, |row, cells| {
        cells[HALL_A] += 1600 * i64::from(row % 100 == 50);
    });
    // From the middle of the run on B reads 0.2 % more.
    let drifts = changed(&log, |row, cells| {
        cells[HALL_A + 1] += cells[HALL_A + 1] * i64::from(row >= 2000) / 500;
    });
    for (log, code, verdict) in [
        (sparks, "outliers", "good"),
        (drifts, "gain_drift", "limited"),
    ] {
        bench.write("new.csv", log);
        let json = bench.figures("recalibrate old.bin new.csv --what all --out new.bin");
        assert_eq!(json["findings"][0]["code"], code, "{json}");
        assert_eq!(json["verdict"], verdict, "{code}");
        let change = number(&json["gains"]["a"]["change_percent"]);
        assert!(change.abs() < 0.05, "{change}");
    }
    // A fit takes it off, and says so beside the blob.
    // A limit holds for service, not for the fault in the log.
    let fitted = bench.good("fit new.csv --out repaired.bin --limit y=0.55um --json fit.json");
    assert!(stdout(&fitted).contains("errors on the log still have the faults"));
    let errors = &bench.json("fit.json")["errors"];
    assert!(number(&errors["y"]["rmse_um"]) > 0.55, "{errors}");
    // The blob has the errors that it is good for, and its own reach in temperature.
    bench.good("inspect repaired.bin --json inspect.json");
    let held = &bench.json("inspect.json")["fit"]["errors"]["y"]["rmse_um"];
    let predicted = number(&bench.json("fit.json")["predicted"]["y"]["rms_um"]);
    assert!(
        (number(held) - predicted).abs() < 1e-6,
        "{held} {predicted}"
    );
    assert!(number(&bench.json("fit.json")["valid_within_k"]) > 0.1);
    let repaired = bench.json("inspect.json")["repaired"][0].to_string();
    says(&repaired, "The gain of Hall B changes");
    assert_eq!(
        bench.json("inspect.json")["repaired"]
            .as_array()
            .map(Vec::len),
        Some(1)
    );
    // The blob alone does not know it, and `inspect` does not keep that to itself.
    let line = "faults taken off: not known";
    assert!(!stdout(&bench.good("inspect repaired.bin")).contains(line));
    std::fs::remove_file(bench.path("repaired.bin.posterior")).expect("removed");
    assert!(stdout(&bench.good("inspect repaired.bin")).contains(line));
    let fit = "fit new.csv --out other.bin --limit y=0.2um";
    let words = "The errors in service are beyond --limit: y 0.4";
    bench.bad(fit, 4, &[words]);
}

#[test]
fn what_a_log_cannot_tell_is_refused_and_no_blob_is_left() {
    let bench = bench();
    let sine = bench.text("sine.csv");
    bench.write("weak-a.csv", with_gains(&sine, [0.99, 1.0, 1.0]));
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
    let parts = ["does not tell a change of all", "six axes moving at once"];
    refused("old.bin sine.csv --what all", 4, &parts);
    let parts = [
        "one gain for all probes does not describe",
        "Is it the blob of this stage?",
        "--what gains",
    ];
    refused("old.bin weak-a.csv --what gain", 4, &parts);

    bench.good("fit log.csv --out p31.bin --model 31");
    let parts = ["Model (31)", "--model field"];
    refused("p31.bin sine.csv --what gain", 3, &parts);
    let posterior = bench.read("old.bin.posterior");
    let mut damaged = posterior.clone();
    damaged[5000] ^= 1;
    bench.write("old.bin.posterior", &damaged);
    refused(
        "old.bin log.csv --what all",
        3,
        &["old.bin.posterior", "damaged"],
    );
    bench.good("fit log.csv --out other.bin --model field --serial OTHER");
    bench.write("other.bin.posterior", &posterior);
    refused(
        "other.bin log.csv --what all",
        3,
        &["other.bin.posterior belongs to another blob"],
    );
    bench.write("old.bin.posterior", &posterior);
    let turned = with_gains(&bench.text("log.csv"), [-1.0, 1.0, 1.0]);
    bench.write("turned.csv", turned);
    let parts = ["beyond all that probes drift", "columns, order and signs"];
    refused("old.bin turned.csv --what all", 4, &parts);
    std::fs::remove_file(bench.path("old.bin.posterior")).expect("there");
    refused(
        "old.bin log.csv --what all",
        3,
        &["old.bin.posterior does not exist", "--what gains"],
    );
    let arguments = "recalibrate old.bin sine.csv --what gain --out old.bin";
    bench.bad(arguments, 2, &["old.bin: also an input"]);
    bench.write("old.bin.posterior", &posterior);
    for command in [
        "diff old.bin old.bin --json old.bin.posterior",
        "decode old.bin short.csv --uncertainty --out old.bin.posterior",
    ] {
        bench.bad(command, 2, &["old.bin.posterior: also an input"]);
    }
}
