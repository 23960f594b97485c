use super::*;

/// The fault of the cell at this line and column, which must name its movement too.
#[track_caller]
fn cell(text: &str, line: usize, column: usize, name: &str) -> CellFault {
    let error = refused(text);
    let (at_line, at_column, at_name, movement) = place(&error);
    assert_eq!(
        (at_line, at_column, at_name),
        (line, column, name),
        "{error}"
    );
    let start = format!("log.csv:{line}: column {column} ({name})");
    assert!(error.to_string().starts_with(&start), "{error}");
    if column > 1 {
        let movement = movement.expect("its cell is good");
        assert!(
            error.to_string().contains(&format!("movement {movement}")),
            "{error}"
        );
    }
    match error {
        LogError::Cell { fault, .. } => fault,
        other => panic!("{other}"),
    }
}

#[test]
fn text_nan_infinity_and_empty_cells() {
    let fault = cell(&spoilt(",7702,", ",7702nm,"), 3, 5, "ifm_y2_nm");
    assert_eq!(
        fault,
        CellFault::NotANumber {
            text: "7702nm".to_owned()
        }
    );
    let fault = cell(&spoilt(",97,", ",ERR,"), 3, 9, "hall_a_cnt");
    assert_eq!(
        fault,
        CellFault::NotANumber {
            text: "ERR".to_owned()
        }
    );
    for nan in ["NaN", "nan", "-NaN"] {
        assert_eq!(
            cell(&spoilt(",161,", &format!(",{nan},")), 3, 3, "ifm_x_nm"),
            CellFault::Nan
        );
        assert_eq!(
            cell(
                &spoilt("97,87,-6", &format!("97,87,{nan}")),
                3,
                11,
                "hall_c_cnt"
            ),
            CellFault::Nan
        );
    }
    for infinity in ["inf", "-Infinity", "1e999"] {
        let fault = cell(&spoilt(",161,", &format!(",{infinity},")), 3, 3, "ifm_x_nm");
        assert!(matches!(fault, CellFault::Infinite { .. }), "{fault}");
    }
    for empty in ["", " "] {
        assert_eq!(
            cell(&spoilt(",161,", &format!(",{empty},")), 3, 3, "ifm_x_nm"),
            CellFault::Empty
        );
    }
    assert_eq!(
        cell(&spoilt("\n4,2000", "\n,2000"), 6, 1, "movement"),
        CellFault::Empty
    );
    // A comma that may stand between thousands, and one beside a point.
    for (separator, old, new) in [(";", ";7664;", ";7,664;"), ("\t", "\t7664\t", "\t7,5\t")] {
        let log = LOG.replace(',', separator).replace(old, new);
        let log = log.replace(
            &format!("{separator}8700{separator}"),
            &format!("{separator}8700.5{separator}"),
        );
        let fault = cell(&log, 3, 4, "ifm_y1_nm");
        assert!(fault.to_string().contains("decimal comma"), "{fault}");
    }
    let quoted = LOG.replace(",161,", ",\"161,5\",");
    let fault = cell(&quoted, 3, 3, "ifm_x_nm");
    assert!(fault.to_string().contains("decimal comma"), "{fault}");
}

#[test]
fn absurd_numbers_fractions_and_codes_no_converter_gives() {
    for absurd in ["99999999999", "-1e30", "8200000"] {
        let fault = cell(&spoilt(",161,", &format!(",{absurd},")), 3, 3, "ifm_x_nm");
        assert!(
            matches!(fault, CellFault::Absurd { unit: "m", .. }),
            "{fault}"
        );
    }
    let fault = cell(&spoilt("0,2000,161", "0,1e17,161"), 3, 2, "t_us");
    assert!(
        matches!(fault, CellFault::Absurd { unit: "us", .. }),
        "{fault}"
    );
    let fault = cell(&spoilt("\n4,2000", "\n1e300,2000"), 6, 1, "movement");
    assert!(matches!(fault, CellFault::Absurd { .. }), "{fault}");
    let fault = cell(&spoilt(",97,", ",97.5,"), 3, 9, "hall_a_cnt");
    assert!(
        matches!(fault, CellFault::NotWhole { value: 97.5, .. }),
        "{fault}"
    );
    for code in [32768i64, -32769, 4_000_000_000, i64::MAX] {
        let fault = cell(&spoilt(",764,", &format!(",{code},")), 6, 6, "cap1_cnt");
        let absurd = matches!(fault, CellFault::Absurd { .. });
        assert!(
            absurd
                || matches!(
                    fault,
                    CellFault::OutsideConverter {
                        code_max: 32767,
                        ..
                    }
                ),
            "{fault}"
        );
        assert_eq!(absurd, code == i64::MAX, "{fault}");
    }
}

#[test]
fn codes_at_a_rail() {
    for (old, code, column, name) in [
        (",97,", 32767, 9, "hall_a_cnt"),
        (",97,", -32768, 9, "hall_a_cnt"),
        (",764,", 32767, 6, "cap1_cnt"),
    ] {
        let line = if column == 6 { 6 } else { 3 };
        let fault = cell(&spoilt(old, &format!(",{code},")), line, column, name);
        assert_eq!(fault, CellFault::Saturated { code });
        assert!(fault.to_string().contains("--bad-rows skip"), "{fault}");
    }
    sound(&spoilt(",97,", ",32766,"));
    sound(&spoilt(",97,", ",-32767,"));
}

#[test]
fn a_place_counts_comments_blank_lines_and_carriage_returns() {
    let text = spoilt(",161,", ",x,").replace("\n0,2000", "\n\n# a note\n0,2000");
    cell(&text, 5, 3, "ifm_x_nm");
    cell(&text.replace('\n', "\r\n"), 5, 3, "ifm_x_nm");
}
