//! Fits that succeed, with something that the user must know.

use crate::common::{Bench, number, says, thinned_log};
use host_fit::input::shipped::STAGE_TOML;

#[test]
fn a_range_narrower_than_the_errors_is_a_warning_and_one_without_width_holds_its_parameter() {
    let bench = Bench::with_log();
    for range in ["[0.8374, 0.83745]", "[0.85, 0.85]"] {
        bench.write(
            "stage.toml",
            STAGE_TOML.replace("eta_a = [0.78, 0.98]", &format!("eta_a = {range}")),
        );
        let json = bench.figures("fit log.csv --out p.bin");
        let eta = &json["parameters"]["eta_a"];
        if range == "[0.85, 0.85]" {
            assert_eq!(eta["value"], 0.85);
            assert!(eta["standard_error"].is_null());
            assert!(
                !json["warnings"].to_string().contains("eta_a"),
                "{}",
                json["warnings"]
            );
        } else {
            let value = number(&eta["value"]);
            assert!((value - 0.8374).abs() < 1e-3, "{value}");
            says(json["warnings"].to_string(), "eta_a");
        }
    }
}

#[test]
fn a_blob_of_other_scales_is_refused() {
    let bench = Bench::with_log();
    bench.good("fit log.csv --out p.bin");
    for (from, to, key) in [
        (
            "m_per_count = 6.25e-8",
            "m_per_count = 6.26e-8",
            "hall.m_per_count",
        ),
        (
            "m_per_count = 1.5625e-8",
            "m_per_count = 1.5626e-8",
            "capacitive.m_per_count",
        ),
    ] {
        assert!(STAGE_TOML.contains(from));
        bench.write("stage.toml", STAGE_TOML.replace(from, to));
        bench.bad("eval p.bin log.csv", 3, &[key]);
        bench.bad("decode p.bin log.csv --out pose.csv", 3, &[key]);
    }
    assert!(bench.holds_only(&["log.csv", "p.bin"]));
}

#[test]
fn movements_of_several_logs_are_distinguished() {
    let bench = Bench::new();
    bench.write("a.csv", thinned_log(20, |m| m < 30));
    bench.write("b.csv", thinned_log(20, |m| m < 57));
    let json = bench.figures("fit a.csv b.csv --out p.bin");
    assert_eq!(json["zero_deviations"][0]["movement"], "a.csv:0");
    assert_eq!(json["zero_deviations"][30]["movement"], "b.csv:0");
}
