use super::*;
use runtime::VerticalPose;

#[test]
fn codes_and_beams_become_si_units_by_movement() {
    let LogReading {
        dataset,
        warnings,
        skipped_rows,
        ..
    } = sound(LOG);
    assert_eq!((warnings.as_slice(), skipped_rows), (&[][..], 0));
    assert_eq!(dataset.rows.len(), 6);
    assert_eq!(movements(&dataset), [(0, 0, 0..3), (0, 4, 3..6)]);
    assert_eq!(
        (dataset.logs[0].rows.clone(), dataset.logs[0].has_reference),
        (0..6, true)
    );
    let row = &dataset.rows[4];
    assert_eq!((row.movement, row.t_us, row.frame.sequence()), (1, 2000, 1));
    assert_eq!(row.frame.hall(), [90, 75, 1]);
    assert_eq!(row.frame.capacitive(), Some([764, -765, 0]));
    assert_eq!(row.signal_m, [90.0 * 6.25e-8, 75.0 * 6.25e-8, 6.25e-8]);
    let near = |have: f64, want: f64| {
        assert!(
            (have - want).abs() <= 1e-12 * want.abs() + 1e-18,
            "{have} {want}"
        )
    };
    // Gaps 1 and 2 at x = +-0.12 m, gap 3 at y = -0.12 m.
    near(row.vertical[0], (764.0 - 765.0) / 2.0 * 1.5625e-8);
    near(row.vertical[1], (row.vertical[0] - 0.0) / 0.12);
    near(row.vertical[2], -(764.0 + 765.0) * 1.5625e-8 / 0.24);
    near(row.reference[0], -871e-9);
    near(row.reference[1], 8901e-9);
    near(row.reference[2], (-402e-9f64 / 0.1).atan());
}

#[test]
fn separators_line_ends_comments_and_marks_do_not_matter() {
    let commented = LOG.replace("\n4,0", "\n# second, movement\n\n4,0");
    for text in [
        LOG.replace(',', ";"),
        LOG.replace(',', "\t"),
        LOG.replace('\n', "\r\n"),
        format!("\u{feff}{LOG}"),
        format!("\u{feff}# a note; of; many; parts; on; the; log; and; how; it; was; made\n{LOG}"),
        format!("# made, by hand; twice\n\n{commented}\n  \n# end"),
        LOG.replace(',', " , "),
        LOG.replace("movement", "\"movement\""),
        replaced(LOG, &[(",97,", ",97.0,"), (",2000,161,", ",2.0e3,161.0,")]),
    ] {
        same_rows(text, stage());
    }
}

#[test]
fn columns_come_in_any_order_and_under_any_name() {
    same_rows(with_cells(|cells| cells.reverse()), stage());
    let named = replaced(LOG, &[("movement", "run"), ("hall_b_cnt", "ADC 2")]);
    let mapped = stage_with("movement = \"run\"\nhall_b = \"ADC 2\"");
    same_rows(&named, &mapped);
    let long = "a column with a name that is longer than any message would show it";
    let named = LOG.replace("cap3_cnt", long);
    same_rows(&named, &stage_with(&format!("cap_3 = \"{long}\"")));
    let wider = LOG.replace("\n", ",note\n");
    same_rows(&wider, &stage_with("ignore = [\"note\"]"));
}

#[test]
fn si_columns_stand_in_for_beams_and_for_gaps() {
    let want = sound(LOG).dataset;
    let header =
        "movement,t_us,x_m,y_m,rz_rad,z_m,rx_rad,ry_rad,hall_a_cnt,hall_b_cnt,hall_c_cnt\n";
    let line = |row: &Row| {
        let (q, v, hall) = (row.reference, row.vertical, row.frame.hall());
        let movement = want.movements[row.movement].index;
        format!(
            "{movement},{},{},{},{},{},{},{},{},{},{}\n",
            row.t_us, q[0], q[1], q[2], v[0], v[1], v[2], hall[0], hall[1], hall[2]
        )
    };
    let text: String = want.rows.iter().map(line).collect();
    let have = sound(&format!("{header}{text}")).dataset;
    for (have, want) in have.rows.iter().zip(&want.rows) {
        assert_eq!(
            (have.reference, have.vertical, have.signal_m),
            (want.reference, want.vertical, want.signal_m)
        );
        assert_eq!(have.frame.capacitive(), None, "no codes were logged");
        let rounded = VerticalPose::from_array(want.vertical.map(|x| x as f32));
        assert_eq!(have.frame.vertical, Some(rounded));
        assert_eq!(have.frame.hall(), want.frame.hall());
        assert_eq!(have.frame.sequence(), want.frame.sequence());
    }
}

#[test]
fn decode_needs_no_reference() {
    let text = with_cells(|cells| drop(cells.drain(2..5)));
    refused_with(&text, stage(), &["the column `ifm_x_nm` is missing"]);
    let dataset = read_text(&text, &ReadOptions::DECODE)
        .expect("sound")
        .dataset;
    assert!(!dataset.logs[0].has_reference);
    assert_eq!(dataset.rows[3].reference, [0.0; 3]);
    assert_eq!(dataset.rows[3].frame, sound(LOG).dataset.rows[3].frame);
    let beam = [
        ("movement,", "ifm_x_nm,movement,"),
        ("\n0,", "\n5,0,"),
        ("\n4,", "\n5,4,"),
    ];
    let partly = replaced(&text, &beam);
    let error = read_text(&partly, &ReadOptions::DECODE).expect_err("one beam of three");
    assert!(
        error.to_string().contains("`ifm_y1_nm` is missing"),
        "{error}"
    );
}

#[test]
fn a_last_line_without_line_break_is_whole_but_gives_a_warning() {
    let reading = sound(LOG.trim_end());
    assert_eq!(reading.dataset.rows, sound(LOG).dataset.rows);
    let [cut] = reading.warnings.as_slice() else {
        panic!("{:?}", reading.warnings);
    };
    assert!(
        matches!(&cut.kind, Kind::FileCut { line: 7, .. }),
        "{cut:?}"
    );
}

#[test]
fn a_movement_with_one_row_gives_a_warning() {
    let reading = sound(&format!("{LOG}9,0,0,0,0,0,0,0,0,0,0\n"));
    assert_eq!(reading.dataset.movements.len(), 3);
    let [single] = reading.warnings.as_slice() else {
        panic!("{:?}", reading.warnings);
    };
    assert!(
        matches!(
            &single.kind,
            Kind::SingleRows {
                first: 9,
                movements: 1,
                ..
            }
        ),
        "{single:?}"
    );
}

#[test]
fn a_gap_in_time_shows_as_frames_missed_and_another_period_does_not() {
    let sequences = |reading: &LogReading| -> Vec<u32> {
        let rows = &reading.dataset.rows;
        rows.iter().map(|row| row.frame.sequence()).collect()
    };
    for late_us in ["7900", "8100"] {
        let gap = sound(&LOG.replace("0,4000,", &format!("0,{late_us},")));
        assert_eq!(sequences(&gap), [0, 1, 4, 0, 1, 2]);
    }
    let slow = sound(&replaced(
        LOG,
        &[(",2000,", ",20000,"), (",4000,", ",40000,")],
    ));
    assert_eq!(sequences(&slow), [0, 1, 2, 0, 1, 2]);
}

#[test]
fn several_logs_are_one_dataset_hashed_in_their_order() {
    let folder = tempfile::tempdir().expect("a folder");
    let (plain, packed) = (folder.path().join("a.csv.gz"), folder.path().join("b.csv"));
    // Names say nothing: the plain one is called gz, the packed one is not.
    std::fs::write(&plain, LOG).expect("written");
    let other = LOG.replace("\n0,", "\n3,").replace(",97,", ",98,");
    let (head, tail) = other.split_at(200);
    let members = [gzip(head.as_bytes()), gzip(tail.as_bytes())].concat();
    std::fs::write(&packed, members).expect("written");
    let dataset = read(&[&plain, &packed], stage(), &ReadOptions::default())
        .expect("sound")
        .dataset;
    let want = [(0, 0, 0..3), (0, 4, 3..6), (1, 3, 6..9), (1, 4, 9..12)];
    assert_eq!(movements(&dataset), want);
    assert!(dataset.movement_name(&dataset.movements[2]).ends_with(":3"));
    let slots: Vec<_> = dataset.rows.iter().map(|row| row.movement).collect();
    assert_eq!(slots, [0, 0, 0, 1, 1, 1, 2, 2, 2, 3, 3, 3]);
    assert_eq!(
        (dataset.logs[1].path.clone(), dataset.logs[1].rows.clone()),
        (packed.clone(), 6..12)
    );
    let both: [u8; 32] = Sha256::digest(format!("{LOG}{other}").as_bytes()).into();
    assert_eq!(dataset.sha256, both);
    let turned = read(&[&packed, &plain], stage(), &ReadOptions::default())
        .expect("sound")
        .dataset;
    assert_ne!(turned.sha256, dataset.sha256);
    let own: [u8; 32] = Sha256::digest(other.as_bytes()).into();
    assert_eq!([dataset.logs[1].sha256, turned.logs[0].sha256], [own; 2]);
}

#[test]
fn temperatures_are_read_in_their_unit_and_an_empty_cell_is_missing() {
    let mut lines = LOG.lines();
    let header = lines.next().expect("a header").to_owned() + ",mount\n";
    let log = lines.enumerate().fold(header, |text, (k, line)| {
        let cell = if k == 0 { "" } else { "293.65" };
        text + &format!("{line},{cell}\n")
    });
    let toml = crate::shipped::STAGE_TOML.to_owned();
    let toml = toml + "\n[temperature]\nmount = \"mount\"\nunit = \"K\"\n";
    let stage = Stage::from_toml(&toml, "stage.toml".as_ref()).expect("sound");
    let rows = read_in(&log, &stage).expect("sound").dataset.rows;
    let missing = runtime::frame::MISSING_CODE;
    assert_eq!(rows[0].frame.temperature_mc(), [missing; 2]);
    assert_eq!(rows[1].frame.temperature_mc(), [20_500, missing]);
    let taken_for_c = Stage::from_toml(&toml.replace("\"K\"", "\"C\""), "stage.toml".as_ref());
    let refused = read_in(&log, &taken_for_c.expect("sound")).expect_err("293.65 degC");
    assert!(refused.to_string().contains("unit"), "{refused}");
}
