//! Faults of many rows.

use super::*;

/// A sound log of 200 rows, a cell of each changed.
fn long(column: usize, change: impl Fn(usize, i64) -> String) -> String {
    let header = LOG.lines().next().expect("a header");
    let row = |k: usize| {
        let wave = |to: f64| (to * (k as f64 / 20.0).sin()) as i64;
        let cells = [
            0,
            2000 * k as i64,
            wave(5e4),
            wave(6e4),
            wave(6e4),
            wave(90.0),
            wave(80.0),
            wave(70.0),
            wave(3e3),
            wave(4e3),
            wave(2e3),
        ];
        let text = cells
            .iter()
            .enumerate()
            .map(|(at, cell)| match at == column {
                true => change(k, *cell),
                false => cell.to_string(),
            });
        text.collect::<Vec<_>>().join(",") + "\n"
    };
    header.to_owned() + "\n" + &(0..200).map(row).collect::<String>()
}

fn pattern(text: &str) -> Pattern {
    let error = read_text(text, &ReadOptions::default()).expect_err("refused");
    let LogProblem::Pattern { pattern, .. } = error.problem else {
        panic!("{error}");
    };
    pattern
}

#[test]
fn a_fault_of_many_rows_is_named_by_its_pattern() {
    assert!(read_text(&long(99, |_, _| String::new()), &ReadOptions::default()).is_ok());
    let second = |k: usize, _| format!("2026-05-12T10:00:{:02}", k / 100);
    assert_eq!(
        pattern(&long(1, second).replace("t_us", "Time")),
        Pattern::CoarseTimes
    );
    assert_eq!(
        pattern(&long(1, |k, _| (k / 5 * 10_000).to_string())),
        Pattern::CoarseTimes
    );
    let no_sign = Pattern::NoSign {
        bits: 16,
        code_max: 32767,
    };
    assert_eq!(
        pattern(&long(8, |_, code| (code & 0xffff).to_string())),
        no_sign
    );
    let offset = Pattern::OffsetBinary { code_max: 32767 };
    assert_eq!(
        pattern(&long(8, |_, code| (code + 32768).to_string())),
        offset
    );
    assert_eq!(
        pattern(&long(8, |_, code| (code + 90_000).to_string())),
        Pattern::OtherCodes
    );
    let bits = 16;
    assert_eq!(
        pattern(&long(8, |_, code| (code << bits).to_string())),
        Pattern::LeftJustified { bits }
    );
    let value = 9.91e37;
    assert_eq!(
        pattern(&long(2, |k, nm| if k % 9 == 8 {
            "9.91E+37".to_owned()
        } else {
            nm.to_string()
        })),
        Pattern::Sentinel { value }
    );
    assert_eq!(
        pattern(&long(8, |_, code| format!("{:.3}", code as f64 / 3.1e3))),
        Pattern::NotCodes
    );
    assert_eq!(
        pattern(&long(2, |_, nm| format!("0x{nm:x}"))),
        Pattern::NotNumbers {
            text: "0x0".to_owned()
        }
    );
    assert_eq!(
        pattern(&long(2, |k, nm| if k % 4 == 0 {
            nm.to_string()
        } else {
            String::new()
        })),
        Pattern::Empty
    );
    assert_eq!(
        pattern(&long(2, |_, nm| (nm * 1_000_000).to_string())),
        Pattern::TooLarge
    );
    assert_eq!(
        pattern(&long(9, |_, _| "32767".to_owned())),
        Pattern::Saturated
    );
    let cells = Pattern::CellCount {
        expected: 11,
        found: 12,
    };
    assert_eq!(pattern(&long(2, |_, nm| format!("{},5", nm / 1000))), cells);
}

/// The first bad code is at the rail.
#[test]
fn offset_binary_is_named_where_codes_cross_zero() {
    let text = long(8, |k, code| (code - i64::from(k == 0) + 32768).to_string());
    assert_eq!(pattern(&text), Pattern::OffsetBinary { code_max: 32767 });
}

#[test]
fn a_fault_of_one_row_is_the_fault_of_its_row() {
    let error = refused(&long(8, |k, code| {
        if k == 7 {
            "x".to_owned()
        } else {
            code.to_string()
        }
    }));
    assert!(
        matches!(
            error.problem,
            LogProblem::Cell(CellFault::NotANumber { .. })
        ),
        "{error}"
    );
    let error = refused(&long(1, |k, t_us| {
        if k == 7 {
            "12000".to_owned()
        } else {
            t_us.to_string()
        }
    }));
    assert!(
        matches!(error.problem, LogProblem::DuplicatedRow { .. }),
        "{error}"
    );
}

#[test]
fn a_clock_that_is_full_is_named_with_its_bits() {
    for (bits, unit) in [(32, "us"), (24, "us"), (16, "ms")] {
        let per_row = if unit == "us" { 2000 } else { 2 };
        let full = 1i64 << bits;
        let text = long(1, |k, _| {
            ((full - 100 + per_row * k as i64) % full).to_string()
        });
        let error = refused(&text.replace("t_us", &format!("time [{unit}]")));
        assert!(
            matches!(error.problem, LogProblem::ClockWraps { bits: found } if found == bits),
            "{error}"
        );
    }
    let back = refused(&long(1, |k, t_us| {
        if k == 90 {
            "5".to_owned()
        } else {
            t_us.to_string()
        }
    }));
    assert!(
        matches!(back.problem, LogProblem::TimeBackwards { .. }),
        "{back}"
    );
    let seconds = refused(&long(1, |_, t_us| (t_us % 300_000).to_string()));
    assert!(
        matches!(seconds.problem, LogProblem::ClockRestarts { t_us: 0, .. }),
        "{seconds}"
    );
}

#[test]
fn a_few_bad_cells_are_counted_once_for_all() {
    let bad = |k: usize, code: i64| match k % 40 {
        20 => "ERR".to_owned(),
        _ => code.to_string(),
    };
    let error = refused(&long(8, bad)).to_string();
    assert!(error.contains("5 of 180 rows: \"ERR\""), "{error}");
    assert!(error.contains("--bad-rows skip"), "{error}");
    // A fault of another cell in the same rows hides none.
    let both = long(8, bad).replace(",ERR,", ",ERR,x");
    let error = refused(&both).to_string();
    assert!(error.contains("5 of 180 rows"), "{error}");
}
