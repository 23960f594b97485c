//! What `plan` refuses. The package's tests compare its run with the program's.

use crate::common::{Bench, number, stdout};
use host_fit::input::shipped::STAGE_TOML;

#[test]
fn a_stage_that_cannot_follow_the_fast_tone_is_told_what_its_run_lacks() {
    let bench = Bench::new();
    let says = "cannot tell errors that follow the acceleration of z:";
    let planned = |stage: &str| {
        let command = format!("plan --stage {stage} --seconds 8 --json plan.json");
        let shown = stdout(&bench.good(&command));
        let error = bench.json("plan.json")["acceleration"]["z"]["standard_error"].clone();
        (shown.contains(says), number(&error))
    };
    let limited = "\nz = { acceleration_m_per_s2 = 0.01, service_m = 240e-6";
    bench.write("usual.toml", STAGE_TOML);
    bench.write(
        "stiff.toml",
        STAGE_TOML.replace("\nz = { service_m = 240e-6", limited),
    );
    let (is_told, error) = planned("usual.toml");
    assert!(!is_told && error < 0.2, "{error}");
    let (is_told, error) = planned("stiff.toml");
    assert!(is_told && error > 1.0, "{error}");
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
