//! `plan` from the command line: what it writes, and what it refuses.

use crate::common::{Bench, number, says, stdout};
use host_fit::input::shipped::STAGE_TOML;

/// A run that is short enough to be planned fast, rehearsed, and written nowhere else.
#[test]
fn a_planned_run_is_written_shown_and_can_be_rehearsed() {
    let bench = Bench::new();
    let planned = bench.good("plan --seconds 60 --out run.csv --json plan.json");
    let shown = stdout(&planned);
    says(&shown, "30001");
    assert!(shown.contains("least determined") && shown.contains("wrote run.csv"));
    let json = bench.json("plan.json");
    for axis in ["x", "y", "rz"] {
        let ratio = number(&json["service"][axis]["ratio"]);
        assert!((1.0..1.01).contains(&ratio), "{axis}: {ratio}");
    }
    let parameters = json["parameters"].as_object().expect("by name");
    assert_eq!(parameters.len(), 81);
    let rz = shown.lines().find(|line| line.starts_with("  rz "));
    assert!(rz.is_some_and(|line| line.contains("500.0")), "{shown}");

    bench.good("simulate --plan run.csv --seed 2 --out log.csv");
    assert_eq!(bench.text("log.csv").lines().count(), 30_002);
}

#[test]
fn what_cannot_be_planned_leaves_no_file() {
    let bench = Bench::new();
    let plan = "plan --out run.csv --json plan.json";
    bench.bad(
        &format!("{plan} --seconds 2"),
        4,
        &["no run was written", "make it longer"],
    );
    let parts = ["expected a number of seconds"];
    bench.bad(&format!("{plan} --seconds nan"), 2, &parts);
    bench.bad("plan --seconds 20 --out stage.toml", 2, &["also an input"]);
    bench.write(
        "far.toml",
        STAGE_TOML.replace("\nz = { service_m = 240e-6", "\nz = { amplitude_m = 1.0"),
    );
    let parts = ["`motion.z.amplitude_m`: 1 m is outside"];
    bench.bad(&format!("{plan} --stage far.toml --seconds 20"), 3, &parts);
    assert!(bench.holds_only(&["far.toml"]));
}
