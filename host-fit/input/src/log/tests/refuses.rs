//! Logs that are refused, each with file, line and column, and a remedy.

use super::*;

#[test]
fn what_is_wrong_is_named_with_its_place_and_a_remedy() {
    let x = "3: column 3 (ifm_x_nm), movement 0: ";
    let a = "3: column 9 (hall_a_cnt), movement 0: ";
    let cap = "6: column 6 (cap1_cnt), movement 4: ";
    // What is replaced in the log, by what, and what follows `log.csv:` in the message.
    #[rustfmt::skip]
    let cases: &[(&str, &str, &str, &str)] = &[
        // Cells.
        (",7702,", ",7702nm,", "3: column 5 (ifm_y2_nm), movement 0: ", "\"7702nm\" is not a number"),
        (",97,", ",ERR,", a, "\"ERR\" is not a number"),
        (",161,", ",NaN,", x, "stands for a missing value"),
        (",161,", ",-nan,", x, "stands for a missing value"),
        ("97,87,-6", "97,87,NaN", "3: column 11 (hall_c_cnt), movement 0: ", "stands for a missing value"),
        (",161,", ",inf,", x, "infinite"),
        (",161,", ",-Infinity,", x, "infinite"),
        (",161,", ",1e999,", x, "infinite"),
        (",161,", ",,", x, "empty"),
        (",161,", ", ,", x, "empty"),
        ("\n4,2000", "\n,2000", "6: column 1 (movement): ", "empty"),
        (",161,", ",\"1,161\",", x, "decimal comma"),
        (",161,", ",99999999999,", x, "absurd (more than 8"),
        (",161,", ",-1e30,", x, "m is absurd"),
        (",161,", ",8200000,", x, "m is absurd"),
        ("0,2000,161", "0,1e17,161", "3: column 2 (t_us), movement 0: ", "µs is absurd"),
        ("\n4,2000", "\n1e300,2000", "6: column 1 (movement): ", "absurd"),
        (",97,", ",97.5,", a, "97.5 is not a whole number"),
        (",764,", ",32768,", cap, "code 32768 is outside the converter's range -32768 to 32767"),
        (",764,", ",-32769,", cap, "outside the converter's range"),
        (",764,", ",4000000000,", cap, "outside the converter's range"),
        (",764,", ",9223372036854775807,", cap, "absurd"),
        (",97,", ",32767,", a, "--bad-rows skip"),
        (",97,", ",-32768,", a, "saturated"),
        (",764,", ",32767,", cap, "saturated"),
        ("\n0,2000,161,", "\n\n# a note\n0,2000,x,", "5: column 3 (ifm_x_nm), movement 0: ", "not a number"),
        // Order.
        ("\n4,2000,", "\n4,-1,", "6: column 2 (t_us), movement 4: ", "backwards, from 0 us to -1 us"),
        ("\n0,4000,", "\n0,2000,", "4: column 2 (t_us), movement 0: ", "repeats the time 2000 us"),
        ("\n4,4000,", "\n0,6000,", "7: column 1 (movement), movement 0: ", "left at line 5 and comes back"),
        // Header and lines.
        ("hall_b_cnt", "hall_d_cnt", "1: the column `hall_b_cnt` is missing", "(not known: hall_d_cnt)"),
        ("hall_b_cnt", "hall_a_cnt", "1: the column `hall_b_cnt` is missing", ""),
        ("cap1_cnt", "ifm_x_um", "1: the column `cap1_cnt` is missing", "(not known: ifm_x_um)"),
        ("hall_b_cnt", "", "1: the column `hall_b_cnt` is missing", "column 10 without a name"),
        ("ifm_x_nm,ifm_y1_nm", "ifm_x_um,ifm_x_mm", "1: column 4 (ifm_x_mm): it repeats", "column 3"),
        ("movement", "z_m", "1: both `cap1_cnt` and `z_m`", "same thing"),
        ("ifm_x_nm", "ifm_x", "1: column 3 (ifm_x): it has no unit", "um, nm"),
        ("t_us", "Time", "1: column 2 (Time): it has no unit", "ms"),
        ("ifm_x_nm", "ifm_x [in]", "1: the column `ifm_x_nm` is missing", "(not known: ifm_x [in])"),
        ("ifm_x_nm", "ifm_x [V]", "1: the column `ifm_x_nm` is missing", "ifm_x [V]"),
        ("ifm_x_nm", "ifm_x_us", "1: the column `ifm_x_nm` is missing", "ifm_x_us"),
        ("ifm_x_nm", "ifm_x [cnt]", "1: the column `ifm_x_nm` is missing", "ifm_x [cnt]"),
        ("97,87,-6", "97,87", "3: 10 cells where the header has 11", ""),
        ("97,87,-6", "97,87,-6,5", "3: 12 cells where the header has 11", ""),
        ("170,150,2\n", "", "7: the file ends in the middle of this line (8 of 11 cells)", ""),
        ("150,2\n", "", "7: the file ends in the middle of this line (9 of 11 cells)", ""),
        ("50,2\n", "50,", "7: the file ends in the middle of this line (10 of 11 cells)", ""),
        ("50,2\n", "50", "7: the file ends in the middle of this line (10 of 11 cells)", ""),
    ];
    for (old, new, start, part) in cases {
        for end in ["\n", "\r\n", "\r"] {
            let error = refused(&spoilt(old, new).replace('\n', end)).to_string();
            let start = format!("log.csv:{start}");
            assert!(error.starts_with(&start), "{start}: {error}");
            assert!(error.contains(part), "{part}: {error}");
        }
    }
    for code in ["32766", "-32767"] {
        sound(&spoilt(",97,", &format!(",{code},")));
    }
}

#[test]
fn tables_that_are_no_log() {
    let (header, rows) = LOG.split_once('\n').expect("a header");
    let without = |column: &str| {
        let at = header.split(',').position(|name| name == column);
        with_cells(|cells| {
            cells.remove(at.expect("in the header"));
        })
    };
    #[rustfmt::skip]
    let cases: &[(&str, &str, &str)] = &[
        (&without("t_us"), ":1: the column `t_us` is missing", "`time = "),
        (&without("cap2_cnt"), ":1: the column `cap2_cnt` is missing", "`cap_2 = "),
        (&without("hall_c_cnt"), ":1: the column `hall_c_cnt` is missing", "`hall_c = "),
        (rows, ":1: the first line holds numbers", ""),
        ("{\"rows\": 3}\n", ":1: no table", "JSON"),
        ("(1780000000.000005) can0 15A#6C00\n", ":1: no table", "host-fit join"),
        ("hello\n1\n2\n", ":1: \"hello\"", "separate the cells"),
        ("", ": the log is empty", ""),
        ("\n\n", ": the log is empty", ""),
        ("# only a note\n", ": the log is empty", ""),
        ("\u{feff}", ": the log is empty", ""),
        (header, ":1: a header but no rows", ""),
        (&format!("# note\n{header}\n\n# end\n"), ":2: a header but no rows", ""),
    ];
    for (text, start, part) in cases {
        let error = refused(text).to_string();
        assert!(error.starts_with(&format!("log.csv{start}")), "{error}");
        assert!(error.contains(part), "{part}: {error}");
    }
}

#[test]
fn a_pose_in_place_of_the_beams_is_refused_beside_their_places() {
    let pose = replaced(
        LOG,
        &[("ifm_x_nm,ifm_y1_nm,ifm_y2_nm", "x_nm,y_nm,rz_nrad")],
    );
    for line in ["x = { z_m = 0.01 }", "scale = [1.0, 1.0, 1.001]"] {
        let baseline = "y_baseline_m = 0.10";
        let text = SOUND.replace(baseline, &format!("{baseline}\n{line}"));
        let stage = Stage::from_toml(&text, Path::new("stage.toml")).expect("sound");
        assert!(read_in(LOG, &stage).is_ok());
        refused_with(
            &pose,
            &stage,
            &["1: the log holds X, Y, Rz", "[interferometer]"],
        );
    }
    assert!(read_in(&pose, stage()).is_ok());
}
