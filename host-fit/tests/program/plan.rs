//! What `plan` refuses. The package's tests compare its run with the program's.

use crate::common::Bench;
use host_fit::input::shipped::STAGE_TOML;

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
