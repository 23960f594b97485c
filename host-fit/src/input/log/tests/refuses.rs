use super::*;

#[test]
fn missing_unknown_repeated_and_ambiguous_columns() {
    for (column, key) in [
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
