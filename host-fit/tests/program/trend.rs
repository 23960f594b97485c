//! The calibrations of a stage over time, on a stage made of physics whose gains fall evenly.

use crate::common::{Bench, number, plan, says, stderr, stdout};
use crate::recalibrate::with_gains;

#[test]
fn calibrations_of_falling_gains_say_when_the_errors_reach_their_limit() {
    let bench = Bench::new();
    bench.write("run.csv", plan(8.0, [5.0, 8.0, 7.0, 6.0, 4.0, 7.5]));
    bench.good("simulate --plan run.csv --seed 3 --out log.csv");
    // 0.05 % in 50 days; the errors of Y reach 1.30 times the noise by 0.09 % more.
    for (k, date) in ["2026-01-01", "2026-02-20", "2026-04-11"]
        .iter()
        .enumerate()
    {
        let gain = 1.0 - 5e-4 * k as f64;
        bench.write("later.csv", with_gains(&bench.text("log.csv"), [gain; 3]));
        bench.good(&format!(
            "fit later.csv --out {k}.bin --serial HS-3 --created {date}"
        ));
    }
    let shown = bench.good("trend 2.bin 0.bin 1.bin --json trend.json --report page");
    says(
        stdout(&shown),
        "Errors of Y in service reach their limit of",
    );
    let json = bench.json("trend.json");
    let gain = number(&json["calibrations"][2]["b"]["gain_percent"]);
    assert!((gain + 0.1).abs() < 2e-3, "{gain}");
    let moved = number(&json["calibrations"][2]["moved"]["y_um"]);
    // Half of 800 um.
    assert!((moved - 0.4).abs() < 0.02, "{moved}");
    let reached = json["axes"][1]["reached"].as_str().expect("a date");
    assert!(("2026-06-01".."2026-08-15").contains(&reached), "{json}");
    let page = bench.text("page/index.html");
    assert_eq!(page.matches("<svg ").count(), 2);
    for part in [reached, "Trend of the calibrations", "0.bin", "2026-02-20"] {
        says(&page, part);
    }
    assert!(!page.contains("Nothing is wrong"));

    // Without the posterior of the last blob, its errors are those on the log.
    std::fs::rename(bench.path("2.bin.posterior"), bench.path("away")).expect("there");
    let shown = bench.good("trend 0.bin 1.bin 2.bin --report page");
    says(stderr(&shown), "2.bin, the last blob, has no posterior");
    says(
        bench.text("page/index.html"),
        "2.bin, the last blob, has no posterior",
    );
    bench.good("fit log.csv --out twice.bin --serial HS-3 --created 2026-06-01");
    let parts = ["twice.bin and 0.bin are calibrations by the same log"];
    bench.bad("trend 0.bin 1.bin twice.bin", 3, &parts);

    bench.good("fit log.csv --out other.bin --serial HS-4 --created 2026-05-01");
    bench.bad(
        "trend 0.bin other.bin",
        3,
        &["other.bin is of stage `HS-4`", "`HS-3`"],
    );
    bench.good("fit log.csv --out undated.bin --serial HS-3");
    bench.bad("trend 0.bin undated.bin", 3, &["undated.bin", "--created"]);
    bench.bad("trend 0.bin", 2, &["2 values required"]);
}
