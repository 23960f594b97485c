//! The forms of logs from laboratories.

use super::*;

/// The log with numbers of some columns divided by `by`, with `decimals` digits after the point.
fn divided(columns: std::ops::Range<usize>, by: f64, decimals: usize) -> String {
    let mut lines = LOG.lines();
    let header = lines.next().expect("a header").to_owned() + "\n";
    lines.fold(header, |text, line| {
        let cells = line
            .split(',')
            .enumerate()
            .map(|(k, cell)| match cell.parse::<f64>() {
                Ok(number) if columns.contains(&k) => format!("{:.decimals$}", number / by),
                _ => cell.to_owned(),
            });
        text + &cells.collect::<Vec<_>>().join(",") + "\n"
    })
}

#[test]
fn units_stand_in_the_header_in_every_spelling() {
    let um = divided(2..5, 1e3, 3);
    let named = |[x, y1, y2]: [&str; 3]| {
        replaced(
            &um,
            &[("ifm_x_nm", x), ("ifm_y1_nm", y1), ("ifm_y2_nm", y2)],
        )
    };
    same_rows(named(["ifm_x [um]", "IFM Y1 (um)", "ifm_y2/um"]), stage());
    let log = divided(1..2, 1e6, 3)
        .replace("t_us", "Time (s)")
        .replace("hall_a_cnt", "Hall A [counts]");
    same_rows(log.replace("cap1_cnt", "cap 1"), stage());
    // Latin-1, as older programs write it.
    let mut latin = named(["ifm_x [um]", "ifm_y1_um", "ifm_y2_um"]).into_bytes();
    let at = latin.iter().position(|b| *b == b'[').expect("a bracket") + 1;
    latin[at] = 0xb5;
    same_rows(latin, stage());
    // A default name with a unit is no other's once [log] names a column for the quantity.
    let mapped = stage_with("ifm_x = \"laser_nm\"");
    let other = LOG.replace("ifm_x_nm", "ifm_x [nm]");
    refused_with(&other, &mapped, &["`laser_nm` is missing", "ifm_x [nm]"]);
    // A name in [log] stands in the header, letter for letter, and has the unit.
    let mapped = stage_with(
        "ifm_x = \"X [um]\"\nifm_y1 = \"Y left/um\"\nifm_y2 = { column = \"Y (right)\", unit = \"\u{b5}m\" }",
    );
    let log = named(["X [um]", "Y left/um", "Y (right)"]);
    same_rows(&log, &mapped);
}

#[test]
fn a_row_of_units_below_the_header_tells_them_or_agrees() {
    let um = divided(2..5, 1e3, 3);
    let bare = um.replace("_nm", "");
    let with_units = |log: &str, units: &str| log.replacen('\n', &format!("\n{units}\n"), 1);
    same_rows(with_units(&bare, ",us,um,um,um,,,,,,"), stage());
    same_rows(
        with_units(&bare, "-,[\u{b5}s],[\u{b5}m],(um),um,cnt,cnt,cnt,-,-,-"),
        stage(),
    );
    same_rows(
        with_units(LOG, "-,us,nm,nm,nm,cnt,cnt,cnt,cnt,cnt,cnt"),
        stage(),
    );
    for (log, units, column) in [
        (LOG, "-,us,um,nm,nm,cnt,cnt,cnt,cnt,cnt,cnt", 3),
        (LOG, "-,s,nm,nm,nm,cnt,cnt,cnt,cnt,cnt,cnt", 2),
        (LOG, "-,us,nm,nm,nm,cnt,cnt,cnt,V,V,V", 9),
    ] {
        let place = format!("log.csv:1: column {column} ");
        refused_with(
            &with_units(log, units),
            stage(),
            &["row below the header", &place],
        );
    }
    // What is no row of units is a row with bad cells.
    let bad = with_units(LOG, "0,us,nm,nm,nm,cnt,cnt,cnt,cnt,cnt,1");
    let error = refused_with(&bad, stage(), &["no time"]);
    assert_eq!(place(&error).0, 2);
    refused_with(
        &with_units(&bare, ",us,,um,um,,,,,,"),
        stage(),
        &["ifm_x", "no unit"],
    );
}

#[test]
fn decimal_commas_are_read_where_commas_do_not_separate_cells() {
    let um = divided(2..5, 1e3, 3).replace("_nm", "_um");
    for separator in [";", "\t"] {
        same_rows(um.replace(',', separator).replace('.', ","), stage());
        // A comma that may stand between thousands, and one beside a point.
        let log = LOG.replace(',', separator);
        let comma = if separator == ";" { "7,664" } else { "7,5" };
        let log = log.replace("7664", comma).replace("8700", "8700.5");
        let error = refused_with(&log, stage(), &["decimal comma"]);
        assert_eq!(place(&error).0, 3);
    }
    same_rows(
        um.replace(',', "\";\"")
            .replace('.', ",")
            .replace('\n', "\"\n\"")
            .trim_end_matches('"')
            .replacen("movement", "\"movement", 1),
        stage(),
    );
}

#[test]
fn utf_16_is_read_and_hashed_before_it_is_decoded() {
    let text = LOG.replace("ifm_x_nm", "ifm_x (nm)").replace('\n', "\r\n");
    let bytes: Vec<u8> = text.encode_utf16().flat_map(u16::to_be_bytes).collect();
    same_rows(&bytes, stage());
    let hash = read_in(gzip(&bytes), stage())
        .expect("sound")
        .dataset
        .sha256;
    assert_eq!(hash, <[u8; 32]>::from(Sha256::digest(&bytes)));
    let cut = read_in(&bytes[..bytes.len() - 1], stage()).expect_err("half a character");
    is_for(&cut, |why| {
        matches!(why, LogProblem::Source(SourceProblem::Utf16 { .. }))
    });
}

#[test]
fn gaps_in_um_are_read_as_they_are() {
    // 1.5625e-8 m a code.
    let um = divided(5..8, 64.0, 6);
    let named =
        |[a, b, c]: [&str; 3]| replaced(&um, &[("cap1_cnt", a), ("cap2_cnt", b), ("cap3_cnt", c)]);
    let units = "\n-,us,nm,nm,nm,um,um,um,-,-,-\n";
    let below = named(["cap1_um", "Cap 2 [um]", "cap 3"]).replacen('\n', units, 1);
    let log = "gap_1 = { column = \"left\", unit = \"um\" }\ngap_2 = { column = \"right\", unit = \"um\" }\ngap_3 = \"front_um\"";
    let want = sound(LOG).dataset.rows;
    for (text, stage) in [
        (named(["cap1_um", "Cap 2 [um]", "gap_3/um"]), stage()),
        (below, stage()),
        (named(["left", "right", "front_um"]), &stage_with(log)),
    ] {
        let rows = read_in(&text, stage).expect(&text).dataset.rows;
        for (have, want) in rows.iter().zip(&want) {
            let pairs = have.vertical.into_iter().zip(want.vertical);
            assert!({ pairs }.all(|(a, b)| (a - b).abs() < 1e-15), "{have:?}");
            assert_eq!(have.frame.hall(), want.frame.hall());
        }
    }
    let both = LOG.replace("movement", "gap_1_um");
    refused_with(&both, stage(), &["both `cap1_cnt` and `gap1_m`"]);
}

#[test]
fn dates_and_times_become_microseconds() {
    let dated = |zone: &str, time: &str| {
        let mut lines = LOG.lines();
        let header = lines.next().expect("a header").replace("t_us", time) + "\n";
        lines.fold(header, |text, line| {
            let cells: Vec<_> = line.splitn(3, ',').collect();
            let ms = cells[1].parse::<i64>().expect("a time") / 1000;
            let date = format!("2026-01-02T03:04:0{}.{ms:03}", cells[0]);
            text + &format!("{},{date}{zone},{}\n", cells[0], cells[2])
        })
    };
    let steps = |text: &str, stage: &Stage| -> Vec<i64> {
        let rows = read_in(text, stage).expect("sound").dataset.rows;
        rows[..3]
            .windows(2)
            .map(|p| p[1].t_us - p[0].t_us)
            .collect()
    };
    let want = steps(LOG, stage());
    for (zone, name) in [("Z", "t_us"), ("", "Time"), ("+01:00", "t")] {
        assert_eq!(steps(&dated(zone, name), stage()), want);
    }
    let mapped = stage_with("time = { column = \"Zeit\", unit = \"iso\" }");
    assert_eq!(steps(&dated("Z", "Zeit"), &mapped), want);
    let mixed = dated("Z", "Time").replace("04.002Z", "04.002");
    let error = refused_with(&mixed, stage(), &["another way"]);
    assert_eq!(place(&error), (6, 2, "Time", Some(4)));
}

#[test]
fn voltages_become_the_codes_of_the_converter() {
    // 20.48 V over 65536 codes.
    let volts = divided(8..11, 1.0 / 3.125e-4, 6);
    let named = |volts: &str, [a, b, c]: [&str; 3]| {
        replaced(
            volts,
            &[("hall_a_cnt", a), ("hall_b_cnt", b), ("hall_c_cnt", c)],
        )
    };
    let in_volts = named(&volts, ["Hall A [V]", "hall_b/V", "hall_c_V"]);
    refused_with(
        &in_volts,
        stage(),
        &["column 9 ", "volts_per_count", "[hall]"],
    );
    let with_volts = |volts: &str, log: &str| {
        let text = SOUND.replacen(
            "code_min",
            &format!("volts_per_count = {volts}\ncode_min"),
            1,
        );
        Stage::from_toml(&format!("{text}[log]\n{log}\n"), Path::new("stage.toml"))
    };
    let stage = with_volts("3.125e-4", "").expect("sound");
    same_rows(&in_volts, &stage);
    let mv = divided(8..11, 1.0 / 0.3125, 3);
    let mv = named(&mv, ["ADC 1", "hall_b [mV]", "hall_c [mV]"]);
    let mapped = with_volts("3.125e-4", "hall_a = { column = \"ADC 1\", unit = \"mV\" }");
    same_rows(&mv, &mapped.expect("sound"));
    // Counts stay counts.
    same_rows(LOG, &stage);
    let error = with_volts("-1.0", "").expect_err("no converter");
    assert!(
        error.to_string().contains("hall.volts_per_count"),
        "{error}"
    );
    let text = format!("{SOUND}[log]\ncap_1 = \"gap 1 [V]\"\n");
    let error = Stage::from_toml(&text, Path::new("stage.toml")).expect_err("no scale");
    assert!(error.to_string().contains("[capacitive]"), "{error}");
    // Another scale than the converter's: voltages fall between codes.
    let other = with_volts("3.2e-4", "").expect("sound");
    let reading = read_in(in_volts.as_bytes(), &other).expect("read, with a warning");
    assert!(
        matches!(reading.warnings.as_slice(), [found] if found.code() == Code::BetweenCodes && found.value() > Some(0.15)),
        "{:?}",
        reading.warnings
    );
    let far = in_volts.replace("0.030312", "11.0");
    let error = refused_with(&far, &stage, &["outside the converter's range"]);
    assert_eq!(place(&error).1, 9);
}

/// The cells of each line, with another function for the header.
fn lines(header: impl Fn(&str) -> String, row: impl Fn(usize, &str) -> String) -> String {
    let mut all = LOG.lines();
    let header = header(all.next().expect("a header"));
    let rows = all.enumerate().map(|(k, line)| row(k, line) + "\n");
    header + "\n" + &rows.collect::<String>()
}

#[test]
fn columns_without_name_cells_or_meaning_are_left_out_with_a_note() {
    // An index of pandas, separators at the ends of rows or of the header, a column of remarks.
    for (text, left_out) in [
        (
            lines(|header| format!(",{header}"), |k, row| format!("{k},{row}")),
            "column 1 without a name",
        ),
        (
            lines(
                |header| format!("{header},Comment"),
                |_, row| row.to_owned(),
            ),
            "Comment",
        ),
        (
            lines(|header| format!("{header},"), |_, row| row.to_owned()),
            "column 12 without a name (the header ends with a separator)",
        ),
        (
            lines(
                |header| format!("{header},operator"),
                |k, row| format!("{row},{}", if k > 3 { "ab" } else { "" }),
            ),
            "operator",
        ),
    ] {
        let reading = sound(&text);
        let Some(Kind::ColumnsLeftOut { columns, .. }) =
            reading.warnings.first().map(|found| &found.kind)
        else {
            panic!("{:?}: {text}", reading.warnings);
        };
        assert_eq!(columns, &[left_out], "{text}");
        assert_eq!(reading.dataset.rows.len(), 6);
    }
    same_rows(lines(str::to_owned, |_, row| format!("{row},")), stage());
}

#[test]
fn a_file_of_labview_is_read() {
    let head = "LabVIEW Measurement\t\r\nSeparator\tTab\r\n***End_of_Header***\t\r\n\t\r\nChannels\t10\t\t\r\n";
    let samples = |tag: &str, value: &str| format!("{tag}\t{}\r\n", [value; 10].join("\t"));
    let units = "Y_Unit_Label\tus\tnm\tnm\tnm\t-\t-\t-\t-\t-\t-\r\n";
    let head = head.to_owned()
        + &samples("Samples", "6")
        + &samples("Date", "2026/05/12")
        + units
        + &samples("X0", "0.0E+0")
        + &samples("Delta_X", "0.002")
        + "***End_of_Header***\t\r\n";
    let table = lines(
        |header| header.replace("_nm", "") + "\tComment",
        |_, row| row.to_owned(),
    );
    same_rows_but_notes(&(head + &table.replace(',', "\t").replace('\n', "\r\n")));
}

/// As `same_rows`, with columns that are left out.
#[track_caller]
fn same_rows_but_notes(text: &str) {
    let reading = read_text(text, &ReadOptions::default()).expect("read");
    let is_note = |found: &Finding| found.severity == Severity::Note;
    assert!(
        reading.warnings.iter().all(is_note),
        "{:?}",
        reading.warnings
    );
    let want = sound(LOG).dataset.rows;
    let places = |rows: &[Row]| {
        rows.iter()
            .map(|row| (row.t_us, row.reference))
            .collect::<Vec<_>>()
    };
    assert_eq!(places(&reading.dataset.rows), places(&want));
}

#[test]
fn times_are_dates_durations_or_numbers_of_rows() {
    let time = |name: &str, text: &dyn Fn(usize) -> String| {
        lines(
            |header| header.replace("t_us", name),
            |k, row| {
                let cells: Vec<&str> = row.split(',').collect();
                format!("{},{},{}", cells[0], text(k % 3), cells[2..].join(","))
            },
        )
    };
    let named = |name: &str, text: &dyn Fn(usize) -> String| {
        let reading = sound(&time(name, text));
        let times = reading.dataset.rows.iter().map(|row| row.t_us);
        times.collect::<Vec<_>>()
    };
    let day = |k: usize| format!("12.05.2026 10:00:00.00{}", 2 * k);
    let times = named("Timestamp", &day);
    assert_eq!(times[2] - times[1], 2000);
    let times = named("time", &|k| format!("0.00{} sec", 2 * k));
    assert_eq!(times, [0, 2000, 4000, 0, 2000, 4000]);
    assert_eq!(named("time [rows]", &|k| k.to_string()), times);
    assert_eq!(named("Zeit (ms)", &|k| (2 * k).to_string()), times);
}
