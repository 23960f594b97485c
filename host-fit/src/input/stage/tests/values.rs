use super::*;

#[test]
fn a_number_that_cannot_be_true_is_refused() {
    let fault = fault_at(refused("h3y_m = 0.36", "h3y_m = nan"), 8, 9, "hall.h3y_m");
    assert!(matches!(fault, ValueFault::NotFinite { .. }), "{fault}");
    let fault = fault_at(refused("h3y_m = 0.36", "h3y_m = -inf"), 8, 9, "hall.h3y_m");
    assert!(matches!(fault, ValueFault::NotFinite { .. }), "{fault}");
    let fault = fault_at(refused("h3y_m = 0.36", "h3y_m = 360.0"), 8, 9, "hall.h3y_m");
    assert!(
        matches!(fault, ValueFault::Implausible { value: 360.0, .. }),
        "{fault}"
    );
    let fault = fault_at(
        refused("= 6.25e-8", "= -6.25e-8"),
        9,
        15,
        "hall.m_per_count",
    );
    assert!(matches!(fault, ValueFault::NotPositive { .. }), "{fault}");
    let fault = fault_at(refused("= 6.25e-8", "= 6.25e-5"), 9, 15, "hall.m_per_count");
    assert!(matches!(fault, ValueFault::FullScale { .. }), "{fault}");
    let fault = fault_at(
        refused("= 1.5625e-8", "= 1.5e-18"),
        15,
        15,
        "capacitive.m_per_count",
    );
    assert!(matches!(fault, ValueFault::FullScale { .. }), "{fault}");
    let key = "interferometer.y_baseline_m";
    let fault = fault_at(
        refused("y_baseline_m = 0.10", "y_baseline_m = 0"),
        20,
        16,
        key,
    );
    assert!(matches!(fault, ValueFault::NotPositive { .. }), "{fault}");
    for (period, positive) in [
        ("0.0", false),
        ("-0.002", false),
        ("2e-9", true),
        ("2000", true),
    ] {
        let error = refused("period_s = 0.002", &format!("period_s = {period}"));
        let fault = fault_at(error, 23, 12, "servo.period_s");
        assert_eq!(
            matches!(fault, ValueFault::Implausible { .. }),
            positive,
            "{fault}"
        );
        assert_eq!(
            matches!(fault, ValueFault::NotPositive { .. }),
            !positive,
            "{fault}"
        );
    }
}

#[test]
fn codes_that_leave_no_window_are_refused() {
    let with = |low: i64, high: i64| {
        let codes = format!("m_per_count = 6.25e-8\ncode_min = {low}\ncode_max = {high}\n");
        refused(
            "m_per_count = 6.25e-8\ncode_min = -32768\ncode_max = 32767\n",
            &codes,
        )
    };
    for (low, high) in [(5, 5), (32767, -32768), (0, 1)] {
        let fault = fault_at(with(low, high), 11, 12, "hall.code_max");
        assert!(matches!(fault, ValueFault::NoCodes { .. }), "{fault}");
    }
    let fault = fault_at(with(-32768, 1 << 24), 11, 12, "hall.code_max");
    assert_eq!(fault, ValueFault::Beyond24Bits { code: 1 << 24 });
    let fault = fault_at(with(i64::MIN, 0), 10, 12, "hall.code_min");
    assert_eq!(fault, ValueFault::Beyond24Bits { code: i64::MIN });
}

#[test]
fn sensors_that_define_no_plane_are_refused() {
    let fault = fault_at(
        refused("[0.0, -0.12]", "[0.0, 0.00001]"),
        14,
        12,
        "capacitive.probes_m",
    );
    assert_eq!(fault, ValueFault::ProbesInLine);
    let fault = fault_at(
        refused("[-0.12, 0.0]", "[0.12, 0.0]"),
        14,
        12,
        "capacitive.probes_m",
    );
    assert_eq!(fault, ValueFault::ProbesInLine);
    let error = refused("h2x_m = 0.1975", "h2x_m = -0.1975");
    let fault = fault_at(error, 5, 9, "hall.h2x_m");
    assert_eq!(fault, ValueFault::ProbesAlike { x_m: 0.1975 });
}

#[test]
fn ranges_that_are_reversed_or_exclude_the_design_are_refused() {
    let fault = fault_at(
        refused("[0.65, 0.85]", "[0.85, 0.65]"),
        33,
        9,
        "search.eta_b",
    );
    assert_eq!(
        fault,
        ValueFault::Reversed {
            low: 0.85,
            high: 0.65
        }
    );
    let fault = fault_at(
        refused("eta_b = [0.65", "eta_b = [-inf"),
        33,
        10,
        "search.eta_b[0]",
    );
    assert!(matches!(fault, ValueFault::NotFinite { .. }), "{fault}");
    let fault = fault_at(
        refused("a_per_m = [[-5000.0, 0.0]", "a_per_m = [[0.0, -5000.0]"),
        36,
        12,
        "search.a_per_m[0]",
    );
    assert!(matches!(fault, ValueFault::Reversed { .. }), "{fault}");
    let fault = fault_at(
        refused("[0.26, 0.46]", "[0.26, 0.35]"),
        28,
        9,
        "search.h3y_m",
    );
    assert!(
        matches!(fault, ValueFault::ExcludesDesigned { designed: 0.36, .. }),
        "{fault}"
    );
    let fault = fault_at(
        refused("[-8.0, 8.0]", "[1.0, 8.0]"),
        35,
        13,
        "search.theta_deg",
    );
    assert!(
        matches!(fault, ValueFault::ExcludesDesigned { designed: 0.0, .. }),
        "{fault}"
    );
    let fault = fault_at(
        refused("[-8.0, 8.0]", "[-180.0, 8.0]"),
        35,
        14,
        "search.theta_deg[0]",
    );
    assert!(matches!(fault, ValueFault::Implausible { .. }), "{fault}");
    let fault = fault_at(
        refused("[-10e-6, 10e-6]", "[-10.0, 10.0]"),
        39,
        12,
        "search.delta_m[0]",
    );
    assert!(matches!(fault, ValueFault::Implausible { .. }), "{fault}");
    // The designed eta of 1 lies outside its range on purpose.
    assert!(!parse(SOUND).expect("sound").search.eta[0].contains(1.0));
}
