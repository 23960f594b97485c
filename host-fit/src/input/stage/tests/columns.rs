use super::*;
use crate::input::log::layout::Quantity;

fn with(log: &str) -> Result<Stage, StageError> {
    parse(&format!("{SOUND}[log]\n{log}\n"))
}

#[test]
fn names_units_and_scales_are_mapped() {
    let log = "movement = \"run\"\nhall_b = { column = \"ADC 2\" }\nifm_x = \"stage_x_um\"\n\
               ifm_y1 = { column = \"left\", unit = \"mm\" }\n\
               ifm_y2 = { column = \"right\", scale = -6.25e-10 }\n\
               time = { column = \"t\", scale = 0.002 }\nignore = [\"temperature\", \"x_m\"]";
    let stage = with(log).expect("sound");
    let column = |quantity| {
        let column = stage.log.column(quantity);
        (column.name.as_str(), column.scale)
    };
    assert_eq!(column(Quantity::Movement), ("run", 1.0));
    assert_eq!(column(Quantity::HallB), ("ADC 2", 1.0));
    assert_eq!(column(Quantity::BeamX), ("stage_x_um", 1e-6));
    assert_eq!(column(Quantity::BeamY1), ("left", 1e-3));
    assert_eq!(column(Quantity::BeamY2), ("right", -6.25e-10));
    assert_eq!(column(Quantity::Time), ("t", 2000.0));
    assert_eq!(column(Quantity::HallC), ("hall_c_cnt", 1.0), "not mapped");
    assert!(stage.log.ignores("temperature") && stage.log.ignores("x_m"));
}

/// A table `[log]`, the column and the key of its fault, and which fault it is.
type Case = (&'static str, usize, &'static str, fn(&ValueFault) -> bool);

#[test]
fn what_is_wrong_with_a_column_is_named() {
    let cases: [Case; 9] = [
        ("ifm_x = \"laser\"", 9, "log.ifm_x", |f| {
            matches!(f, ValueFault::NoUnit { .. })
        }),
        ("rz = \"rz_um\"", 6, "log.rz", |f| {
            matches!(f, ValueFault::NoUnit { .. })
        }),
        (
            "ifm_x = { column = \"a\", unit = \"in\" }",
            32,
            "log.ifm_x.unit",
            |f| matches!(f, ValueFault::UnknownUnit { .. }),
        ),
        (
            "ifm_x = { column = \"a\", unit = \"m\", scale = 1.0 }",
            45,
            "log.ifm_x.scale",
            |f| matches!(f, ValueFault::UnitAndScale),
        ),
        (
            "ifm_x = { column = \"a\", scale = 0.0 }",
            33,
            "log.ifm_x.scale",
            |f| matches!(f, ValueFault::Implausible { .. }),
        ),
        (
            "cap_1 = { column = \"a\", scale = 2.0 }",
            33,
            "log.cap_1.scale",
            |f| matches!(f, ValueFault::NoScaleHere { .. }),
        ),
        ("cap_1 = \"\"", 9, "log.cap_1", |f| {
            matches!(f, ValueFault::NoName)
        }),
        ("cap_1 = \"cap2_cnt\"", 9, "log.cap_1", |f| {
            matches!(f, ValueFault::ColumnTwice { .. })
        }),
        (
            "cap_1 = \"a\"\nignore = [\"a\"]",
            11,
            "log.ignore[0]",
            |f| matches!(f, ValueFault::ColumnTwice { .. }),
        ),
    ];
    for (log, column, key, expected) in cases {
        let line = 40 + log.lines().count();
        let fault = fault_at(with(log).expect_err(log), line, column, key);
        assert!(expected(&fault), "{fault}");
    }
}
