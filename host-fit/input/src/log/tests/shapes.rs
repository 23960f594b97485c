//! Shapes of loggers and spreadsheets: read right, or refused with their pattern.

use super::*;

/// The log without the columns of movement and its second movement, after a change of its cells.
fn one_movement(change: impl Fn(usize, &mut Vec<String>)) -> String {
    let line = |(number, line): (usize, &str)| {
        let mut cells: Vec<String> = line.split(',').skip(1).map(str::to_owned).collect();
        change(number, &mut cells);
        cells.join(",") + "\n"
    };
    LOG.lines().take(4).enumerate().map(line).collect()
}

#[test]
fn a_header_that_stands_again_is_passed_over_and_a_movement_may_begin() {
    let (head, rows) = LOG.split_at(LOG.find("4,0,").expect("a row"));
    let header = LOG.lines().next().expect("a header");
    same_rows(format!("{head}{header}\n{rows}"), stage());
    // Without a column for the movement: the time starts again, and not where it began.
    let later = |number: usize, cells: &mut Vec<String>| {
        if number > 0 {
            cells[0] = (10_000 + 2_000 * number).to_string();
        }
    };
    let first = one_movement(later);
    let second = one_movement(|number, cells| {
        later(number, cells);
        cells[0] = cells[0].replacen("12000", "13000", 1);
    });
    let reading = sound(&format!("{first}{second}"));
    let found = movements(&reading.dataset);
    assert_eq!(found, [(0, 0, 0..3), (0, 1, 3..6)]);
}

#[test]
fn another_table_in_the_same_file_is_named() {
    let (header, rows) = LOG.split_once('\n').expect("a header");
    let other = header.replace("hall_a_cnt,hall_b_cnt", "hall_b_cnt,hall_a_cnt");
    for (between, line, header_line) in [
        (format!("{other}\n"), 8, 8),
        (format!("Logger,7\nnote\n{header}\n"), 8, 10),
        (format!("a,b,c,d,e,f,g,h,i,j,k\n\n{header}\n"), 8, 8),
    ] {
        let error = refused(&format!("{LOG}{between}{rows}"));
        assert_eq!(error.place.line, Some(line), "{error}");
        is_for(
            &error,
            |why| matches!(why, LogProblem::OtherTable { header } if *header == header_line),
        );
    }
    // A footer is none.
    let footer = refused(&format!("{LOG}Rows,6\n"));
    is_for(&footer, |why| matches!(why, LogProblem::CellCount { .. }));
}

#[test]
fn a_time_for_each_signal_is_one_column_as_long_as_all_agree() {
    let pairs = |late: &str| {
        let line = |(number, line): (usize, &str)| {
            let cells: Vec<&str> = line.split(',').skip(1).collect();
            let time = |at| {
                if at == 5 && number == 2 {
                    late
                } else {
                    cells[0]
                }
            };
            let signals = cells.iter().enumerate().skip(1);
            let pairs: Vec<String> = signals
                .map(|(at, cell)| format!("{},{cell}", time(at)))
                .collect();
            pairs.join(",") + "\n"
        };
        LOG.lines()
            .take(4)
            .enumerate()
            .map(line)
            .collect::<String>()
    };
    let reading = sound(&pairs("2000"));
    assert_eq!(reading.dataset.rows.len(), 3);
    let error = refused(&pairs("2001"));
    assert_eq!(place(&error).1, 9);
    is_for(&error, |why| {
        matches!(why, LogProblem::RepeatedColumn { first: 1 })
    });
}

#[test]
fn white_space_and_bars_separate_cells_where_nothing_else_does() {
    let spaced = LOG.replace(',', "   ").replace("0   0   221", " 0 0   221");
    same_rows(spaced, stage());
    same_rows(LOG.replace(',', "|"), stage());
}

#[test]
fn numbers_have_marks_between_thousands_where_no_other_reading_is_possible() {
    let grouped = |text: &str, mark: &str| {
        let cell = |cell: &str| match cell.len() {
            5.. if cell.parse::<i64>().is_ok() => {
                let (thousands, rest) = cell.split_at(cell.len() - 3);
                format!("{thousands}{mark}{rest}")
            }
            _ => cell.to_owned(),
        };
        let line = |line: &str| line.split(',').map(cell).collect::<Vec<_>>().join(";") + "\n";
        text.lines().map(line).collect::<String>()
    };
    for mark in [" ", "'", "\u{a0}", "\u{202f}", "\u{2019}"] {
        same_rows(grouped(LOG, mark), stage());
    }
    let exact = LOG
        .replacen(",221,", ",1221.0,", 1)
        .replacen(",1221.0,", ",221.0,", 1);
    same_rows(grouped(&exact, "").replace("13950", "13,950.0"), stage());
    let german = grouped(LOG, "").replace("13950", "13.950,0");
    same_rows(german, stage());
    let error = refused(&grouped(LOG, ","));
    is_for(&error, |why| {
        matches!(why, LogProblem::Cell(CellFault::NotANumber { .. }))
    });
    same_rows(LOG.replace('-', "\u{2212}"), stage());
}

#[test]
fn an_index_of_times_without_a_name_is_the_time() {
    let text = one_movement(|number, cells| {
        cells[0] = match number {
            0 => String::new(),
            _ => format!("2026-05-12 10:00:00.{:03}", 2 * number),
        };
    });
    let reading = sound(&text);
    let t_us: Vec<i64> = reading.dataset.rows.iter().map(|row| row.t_us).collect();
    assert_eq!([t_us[1] - t_us[0], t_us[2] - t_us[1]], [2000; 2]);
}

/// A line that begins with `#N/A` is no comment.
#[test]
fn words_for_missing_values_are_named_wherever_they_stand() {
    for word in ["#N/A", "null", "NA", "-1.#IND", "--", "\u{221e}"] {
        let error = refused(&spoilt("0,2000,161", &format!("0,2000,{word}")));
        is_for(&error, |why| {
            matches!(why, LogProblem::Cell(CellFault::Missing { .. }))
        });
    }
    let error = refused(&spoilt("0,2000,161", "#N/A,2000,161"));
    assert_eq!(place(&error).1, 1);
}
