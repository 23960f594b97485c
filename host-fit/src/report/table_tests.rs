use super::*;
use serde_json::json;

#[test]
fn a_result_is_shown_by_name_value_and_unit() {
    let result = json!({
        "rows": 3, "elapsed_s": 1.25, "absent": null, "secret": 7,
        "errors": {
            "x": {"rmse_um": 1.0, "peak_um": 20.5},
            "rz": {"rmse_urad": 0.25, "peak_urad": 0.5},
        },
        "parameters": {"theta_a": {"value": 3.142e-3, "unit": "rad"}},
        "logs": [{"path": "a.csv", "errors": {"x": {"rmse_um": 2.0}, "rz": {"rmse_urad": 3.0}}}],
    });
    let text = as_text(&tables(&result, &["secret"]));
    let want = [
        "  rows     3",
        "  elapsed  1.25 s",
        "",
        "errors",
        "       rmse    peak  unit",
        "  x   1.000  20.500  um",
        "  rz  0.250   0.500  urad",
        "",
        "parameters",
        "           value  unit",
        "  theta_a  3.142  mrad",
        "",
        "logs",
        "  path   errors x rmse, um  errors rz rmse, urad",
        "  a.csv              2.000                 3.000",
        "",
    ];
    assert_eq!(text, want.join("\n"));
}

#[test]
fn a_standard_error_sets_the_digits_of_its_value() {
    assert_eq!(with_error(-192.9812, Some(0.1411)), "-192.98(14)");
    assert_eq!(with_error(0.2, Some(1.234e-5)), "0.200000(12)");
    assert_eq!(with_error(1234.0, Some(120.0)), "1234(120)");
    assert_eq!(with_error(0.85, None), "0.85");
}

#[test]
fn units_have_their_signs_beside_a_number_and_nowhere_else() {
    for (plain, want) in [
        ("um", "µm"),
        ("X rms, um", "X rms, µm"),
        (
            "1.2 um, 3 urad (4 us); 5 um/s",
            "1.2 µm, 3 µrad (4 µs); 5 µm/s",
        ),
        ("2 um: more\n  3 um\n", "2 µm: more\n  3 µm\n"),
        ("`X [um]` is t_us, ask us", "`X [um]` is t_us, ask us"),
    ] {
        assert_eq!(with_signs(plain), want);
    }
}

#[test]
fn numbers_have_the_digits_of_their_unit() {
    let shown = [
        number(1.5, "um"),
        number(0.00012, "um"),
        number(0.1945, "m"),
        number(1e-9, "m"),
        number(12.0, "s"),
        number(0.0, "um"),
    ];
    assert_eq!(shown, ["1.500", "0.00012", "0.1945", "1.000e-9", "12", "0"]);
}
