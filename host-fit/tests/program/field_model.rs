//! The field model from the log to the pose file, on a stage made of physics.

use crate::common::{Bench, log, number, plan, rows, says, stderr, stdout};
use serde_json::Value;

/// A folder with the log of a run, and another run of the same stage as its service.
fn bench() -> Bench {
    let bench = Bench::new();
    bench.write("run.csv", plan(8.0, [5.0, 8.0, 7.0, 6.0, 4.0, 7.5]));
    bench.write("other.csv", plan(8.0, [7.0, 5.0, 4.0, 8.0, 6.0, 3.0]));
    bench.good("simulate --plan run.csv --seed 3 --out log.csv");
    bench.good("simulate --plan other.csv --seed 3 --out service.csv --truth truth.csv");
    bench
}

/// rms of X, Y, Rz of a pose file against the truth, um, um, urad.
fn rms_against_truth(bench: &Bench, pose: &str) -> [f64; 3] {
    let (poses, truth) = (rows(&bench.text(pose)), rows(&bench.text("truth.csv")));
    let mut squares = [0.0; 3];
    for (pose, truth) in poses.iter().zip(&truth) {
        assert_eq!(pose[..2], truth[..2]);
        for (axis, sum) in squares.iter_mut().enumerate() {
            *sum += (pose[2 + axis] - truth[2 + axis] * 1e-3).powi(2);
        }
    }
    squares.map(|sum: f64| (sum / poses.len() as f64).sqrt())
}

/// What a fit to the truth of the same service leaves, um, um, urad.
const FLOOR: [f64; 3] = [1.186, 0.465, 2.341];

/// Each axis within 6 % of the floor; Model (31), fitted to the same log, is a tenth or more above it.
#[test]
fn eight_seconds_give_a_blob_that_decodes_another_run_at_the_noise_floor() {
    let bench = bench();
    let fitted = bench.good(
        "fit log.csv --out p.bin --model field --serial HS-3 --json p.json --report report -v",
    );
    assert!(stdout(&fitted).contains("reference lag"));
    let json = bench.json("p.json");
    assert_eq!(json["model"], "field");
    let reason = json["model_reason"].as_str().expect("a sentence");
    says(reason, "times the noise floor");
    let lag = &json["reference_lag"];
    let error = number(&lag["standard_error_us"]);
    assert!(number(&lag["value_us"]).abs() < 5.0 * error);
    let parameters = json["parameters"].as_object().expect("by name");
    assert_eq!(parameters.len(), 81);
    for (name, p) in parameters {
        assert!(p["standard_error"].as_f64() > Some(0.0), "{name}: {p}");
    }
    let page = bench.text("report/index.html");
    assert!(page.contains("Field model") && page.contains("uw2z"));

    let inspected = bench.figures("inspect p.bin");
    assert_eq!(inspected["layout_version"], 2);
    for (name, p) in parameters {
        let value = |p: &Value| number(&p["value"]);
        let (fitted, stored) = (value(p), value(&inspected["parameters"][name]));
        assert!((stored - fitted).abs() <= 1e-6 * fitted.abs(), "{name}");
    }

    bench.good("decode p.bin service.csv --out pose.csv");
    let of_31 = bench.figures("fit log.csv --out p31.bin --model 31");
    let mut findings = of_31["findings"].as_array().expect("a list").iter();
    let lacks = findings.find(|found| found["code"] == "model_lacks");
    let lacks = lacks.expect("a finding");
    let message = lacks["message"].as_str().expect("a sentence");
    assert!(message.contains("in service expect"), "{lacks}");
    assert_eq!(
        (&lacks["code"], &lacks["severity"]),
        (&"model_lacks".into(), &"note".into())
    );
    bench.good("decode p31.bin service.csv --out pose31.csv");
    let (field, model_31) = (
        rms_against_truth(&bench, "pose.csv"),
        rms_against_truth(&bench, "pose31.csv"),
    );
    let judged = bench.rms("p.bin", "service.csv");
    for axis in 0..3 {
        assert!(field[axis] < 1.06 * FLOOR[axis], "{field:?} {FLOOR:?}");
        assert!(model_31[axis] > 1.1 * field[axis], "{model_31:?} {field:?}");
        assert!(
            (judged[axis] / field[axis] - 1.0).abs() < 0.2,
            "{judged:?} {field:?}"
        );
    }
}

#[test]
fn auto_takes_the_field_model_where_the_log_carries_it_and_else_31() {
    let bench = bench();
    bench.write("paper.csv", log());
    for (log, model, reason) in [
        (
            "log.csv",
            "field",
            "the field model: errors predicted over the range",
        ),
        ("paper.csv", "31", "model (31): by this log the field model"),
    ] {
        let json = bench.figures(&format!("fit {log} --out auto.bin"));
        assert_eq!(json["model"], model);
        let said = json["model_reason"].as_str().expect("a sentence");
        assert!(said.starts_with(reason), "{said}");
        let findings = json["findings"].as_array().expect("a list");
        let note = findings.iter().find(|found| found["code"] == "model_lacks");
        let message = note.and_then(|note| note["message"].as_str());
        assert_eq!(
            message.map(|message| message.contains("in service expect")),
            (model == "31").then_some(true)
        );
        let (verdict, worst) = (&json["verdict"], number(&json["predicted"]["worst_ratio"]));
        assert_eq!(verdict, if model == "31" { "limited" } else { "good" });
        assert_eq!(worst > 1.1, model == "31", "{worst}");
        let rms_um = number(&json["predicted"]["x"]["rms_um"]);
        let floor_um = rms_um / number(&json["predicted"]["x"]["ratio"]);
        assert!((0.8..1.2).contains(&floor_um), "{floor_um}");
        bench.good(&format!("fit {log} --out named.bin --model {model}"));
        assert_eq!(bench.read("auto.bin"), bench.read("named.bin"));
    }
    bench.good("fit log.csv --out p.bin --solver shtlbo --generations 3 --json p.json");
    assert_eq!(bench.json("p.json")["model"], "31");
}

/// A baseline that is known ten times worse: the page, the JSON and each decoded pose say so.
#[test]
fn the_budget_of_a_fit_reaches_the_page_and_the_uncertainty_of_each_pose() {
    let bench = bench();
    let stage =
        bench.text("stage.toml") + "\n[certificate]\nlimit = { rz_rad = 3.5e-6 }\nguarded = true\n";
    bench.write("stage.toml", &stage);
    bench.write(
        "rough.toml",
        stage.replace("baseline_m = 0.17e-3", "baseline_m = 1.7e-3"),
    );
    let [usual, rough] = ["stage", "rough"].map(|stage| {
        let fit = "fit log.csv --out p.bin --json p.json --report report --force";
        bench.good(&format!("{fit} --stage {stage}.toml"));
        let budget = bench.json("p.json")["budget"].clone();
        // The guard band has the declared inputs.
        let code = &bench.json("p.json")["refusal"]["code"];
        let wanted = ["beyond_limit"].into_iter().find(|_| stage == "rough");
        assert_eq!(code.as_str(), wanted);
        let absent = budget["not_included"].to_string();
        assert!(
            absent.contains("beam_angles_rad") && absent.contains("drift"),
            "{absent}"
        );
        let page = bench.text("report/index.html");
        assert!(page.contains("Uncertainty budget") && page.contains("beam_angles_rad"));
        assert!(page.contains("Effective degrees of freedom: "));
        // The stage file of a decoding says nothing of the reference of the fit.
        bench.good("decode p.bin service.csv --out pose.csv --uncertainty --force");
        let poses = bench.text("pose.csv");
        let names = "status,u_x_um,u_y_um,u_rz_urad,uc_x_um,uc_y_um,uc_rz_urad";
        assert!(poses.lines().next().expect("a header").ends_with(names));
        let poses = rows(&poses);
        let mean = |column: usize| {
            poses.iter().map(|row| row[column].powi(2)).sum::<f64>() / poses.len() as f64
        };
        let combined = number(&budget["combined"]["rms"]["rz_urad"]);
        // An evaluation has the reference of the fit, too.
        let eval = "eval p.bin service.csv --json e.json";
        match wanted {
            Some(_) => bench.bad(eval, 4, &["beyond the limit: rz"]),
            None => drop(bench.good(eval)),
        }
        let judged = bench.json("e.json");
        let of_eval = number(&judged["budget"]["combined"]["rms"]["rz_urad"]);
        assert!(
            (of_eval / combined - 1.0).abs() < 0.02,
            "{of_eval} {combined}"
        );
        [combined, mean(11).sqrt(), mean(14).sqrt(), mean(4).sqrt()]
    });
    assert!(
        (usual[1] - rough[1]).abs() < 1e-3 * usual[1],
        "{usual:?} {rough:?}"
    );
    // 1.7 % of Rz: its rms in service is half of 500 urad.
    for (k, rz_urad) in [(0, 250.0), (2, usual[3])] {
        let added = (rough[k].powi(2) - usual[k].powi(2)).sqrt();
        let wanted = 0.017 * rz_urad;
        assert!((added / wanted - 1.0).abs() < 0.02, "{usual:?} {rough:?}");
    }
}

#[test]
fn a_log_of_little_motion_is_a_warning() {
    let bench = bench();
    let stage = bench.text("stage.toml");
    let stage = stage.replace("rz = { service_rad = 500e-6", "rz = { service_rad = 1.2e-3");
    bench.write("wide.toml", stage);
    let fit = bench.good("fit log.csv --stage wide.toml --out p.bin --model field");
    assert!(stderr(&fit).contains("Rz moves +-5"), "{}", stderr(&fit));
    let fit = bench.good("fit log.csv --out p.bin --model field");
    assert_eq!(stderr(&fit), "");
}

/// Its rows at the ends of a movement have no reference after the lag is taken off.
#[test]
fn a_late_probe_is_charged_by_check_and_by_eval_and_has_a_page() {
    let bench = Bench::new();
    bench.good("plan --seconds 20 --out run.csv");
    bench.good("simulate --plan run.csv --seed 4 --out log.csv");
    bench.good("fit log.csv --out p.bin");
    bench.good("simulate --plan run.csv --seed 4 --probe-lag-us 1000,0,0 --out late.csv");
    let said = bench.good("check late.csv --report page");
    says(stderr(&said), "declares for service, errors are");
    assert!(bench.has("page/index.html"));
    bench.good("simulate --protocol service --seed 4 --probe-lag-us 1000,0,0 --out service.csv");
    bench.bad("eval p.bin service.csv", 4, &["beyond the limit"]);
}
