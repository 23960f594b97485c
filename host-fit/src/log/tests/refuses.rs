use super::*;

#[track_caller]
fn refused(text: &str) -> LogError {
    let error = read_text(text, &ReadOptions::default()).expect_err("refused");
    let message = error.to_string();
    assert!(message.starts_with("log.csv"), "names the file: {message}");
    assert!(message.contains("; "), "names a remedy: {message}");
    error
}

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
    let semicolons = LOG.replace(',', ";").replace(";161;", ";161,5;");
    let fault = cell(&semicolons, 3, 3, "ifm_x_nm");
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

#[test]
fn missing_unknown_repeated_and_ambiguous_columns() {
    for (column, key) in [
        ("movement", "movement"),
        ("t_us", "time"),
        ("cap2_cnt", "cap_2"),
        ("hall_c_cnt", "hall_c"),
    ] {
        let place = LOG
            .lines()
            .next()
            .and_then(|header| header.split(',').position(|name| name == column));
        let place = place.expect("in the header");
        let text: String = LOG
            .lines()
            .map(|line| {
                let mut cells: Vec<_> = line.split(',').collect();
                cells.remove(place);
                cells.join(",") + "\n"
            })
            .collect();
        let error = refused(&text);
        let LogError::MissingColumn {
            column: name,
            key: found,
            line: 1,
            ..
        } = &error
        else {
            panic!("{error}");
        };
        assert_eq!((name.as_str(), *found), (column, key), "{error}");
    }
    let error = refused(&spoilt("hall_b_cnt", "hall_d_cnt"));
    assert!(
        matches!(error, LogError::UnknownColumn { line: 1, column: 10, ref name, .. } if name == "hall_d_cnt"),
        "{error}"
    );
    assert!(
        error.to_string().contains("ignore = [\"hall_d_cnt\"]"),
        "{error}"
    );
    assert!(
        error.to_string().contains("ifm_y1_nm, "),
        "lists what is known: {error}"
    );
    let error = refused(&format!("# note\n{}", spoilt("hall_b_cnt", "hall_a_cnt")));
    assert!(
        matches!(
            error,
            LogError::RepeatedColumn {
                line: 2,
                column: 10,
                first: 9,
                ..
            }
        ),
        "{error}"
    );
    let error = refused(&LOG.replace('\n', ",\n"));
    assert!(
        matches!(error, LogError::UnnamedColumn { column: 12, .. }),
        "{error}"
    );
    let both = LOG
        .replace("hall_c_cnt\n", "hall_c_cnt,z_m\n")
        .replace("3\n", "3,0\n");
    let error = refused(&both);
    assert!(
        matches!(error, LogError::AmbiguousColumns { ref one, ref other, .. } if one == "cap1_cnt" && other == "z_m"),
        "{error}"
    );
    for one in ["{\"rows\": 3}\n", "hello\n1\n2\n", &LOG.replace(',', " ")] {
        let error = refused(one);
        assert!(
            matches!(error, LogError::NoSeparator { line: 1, .. }),
            "{error}"
        );
    }
    let headless = LOG.split_once('\n').expect("a header").1;
    let error = refused(headless);
    assert!(
        matches!(error, LogError::NoHeader { line: 1, .. }),
        "{error}"
    );
}

#[test]
fn rows_with_too_few_or_too_many_cells() {
    let error = refused(&spoilt("97,87,-6", "97,87"));
    assert!(
        matches!(
            error,
            LogError::CellCount {
                line: 3,
                expected: 11,
                found: 10,
                ..
            }
        ),
        "{error}"
    );
    let error = refused(&spoilt("97,87,-6", "97,87,-6,5"));
    assert!(
        matches!(
            error,
            LogError::CellCount {
                line: 3,
                found: 12,
                ..
            }
        ),
        "{error}"
    );
}

#[test]
fn a_last_line_that_is_cut_short() {
    for (end, found) in [
        ("170,150,2\n", 8),
        ("150,2\n", 9),
        ("2\n", 10),
        (",2\n", 10),
        ("-860,15000,15300,765,-766,1,170,150,2\n", 2),
    ] {
        let text = LOG.strip_suffix(end).expect("its end");
        let error = refused(text);
        let LogError::CutLine {
            line: 7,
            expected: 11,
            found: cells,
            ..
        } = error
        else {
            panic!("{error}");
        };
        assert_eq!(cells, found, "{end:?}");
    }
}

#[test]
fn time_that_runs_backwards_and_duplicated_rows() {
    let error = refused(&spoilt("\n4,2000,", "\n4,-1,"));
    assert!(
        matches!(
            error,
            LogError::TimeBackwards {
                before_us: 0,
                t_us: -1,
                ..
            }
        ),
        "{error}"
    );
    assert_eq!(place(&error), (6, 2, "t_us", Some(4)));
    let line = "0,2000,161,7664,7702,1,0,1,97,87,-6\n";
    let error = refused(&spoilt(line, &line.repeat(2)));
    assert!(
        matches!(error, LogError::DuplicatedRow { t_us: 2000, .. }),
        "{error}"
    );
    assert_eq!(place(&error), (4, 2, "t_us", Some(0)));
    // Each movement has a time of its own, and so has each log.
    sound(LOG);
}

#[test]
fn a_movement_that_comes_back() {
    let error = refused(&format!("{LOG}0,6000,101,13950,14011,0,2,1,180,160,-9\n"));
    assert!(
        matches!(error, LogError::MovementReturns { left_line: 5, .. }),
        "{error}"
    );
    assert_eq!(place(&error), (8, 1, "movement", Some(0)));
}

#[test]
fn logs_without_rows() {
    for empty in ["", "\n\n", "# only a note\n", "\u{feff}"] {
        let error = refused(empty);
        assert!(matches!(error, LogError::Empty { .. }), "{error}");
    }
    let header = LOG.lines().next().expect("a header");
    for text in [header.to_owned(), format!("# note\n{header}\n\n# end\n")] {
        let error = refused(&text);
        assert!(matches!(error, LogError::HeaderOnly { .. }), "{error}");
    }
}
