use super::*;
use crate::log::layout::Quantity;
use proptest::prelude::*;
use std::path::Path;

/// A sound stage file; the tests spoil one thing at a time.
pub(crate) const SOUND: &str = r#"# a note
[hall]
h1x_m = 0.1975
h1y_m = 0.40
h2x_m = 0.1975
h2y_m = 0.42
h3x_m = 0.1975
h3y_m = 0.36
m_per_count = 6.25e-8
code_min = -32768
code_max = 32767

[capacitive]
probes_m = [[0.12, 0.0], [-0.12, 0.0], [0.0, -0.12]]
m_per_count = 1.5625e-8
code_min = -32768
code_max = 32767

[interferometer]
y_baseline_m = 0.10

[servo]
period_s = 0.002

[search]
h1x_m = [0.1475, 0.2475]
h2x_m = [0.1475, 0.2475]
h3y_m = [0.26, 0.46]
h3x_m = [0.1475, 0.2475]
h1y_m = [0.30, 0.50]
h2y_m = [0.32, 0.52]
eta_a = [0.78, 0.98]
eta_b = [0.65, 0.85]
eta_c = [0.72, 0.92]
theta_deg = [-8.0, 8.0]
a_per_m = [[-5000.0, 0.0], [-5000.0, 0.0], [-5000.0, 0.0]]
b_per_rad = [[-5000.0, 0.0], [-5000.0, 0.0], [-5000.0, 0.0]]
c_per_rad = [[0.0, 5000.0], [-5000.0, 0.0], [0.0, 5000.0]]
delta_m = [-10e-6, 10e-6]
"#;

fn parse(text: &str) -> Result<Stage, StageError> {
    Stage::from_toml(text, Path::new("stage.toml"))
}

/// The error of a file that is refused at `line`, `column` as `key`; it must name a remedy.
#[track_caller]
fn refused(text: &str, line: usize, column: usize, key: &str) -> String {
    let message = parse(text).expect_err(text).to_string();
    let start = format!("stage.toml:{line}:{column}: `{key}`: ");
    assert!(message.starts_with(&start), "{start}: {message}");
    assert!(message.contains("; "), "names a remedy: {message}");
    message
}

#[test]
fn a_sound_file_gives_the_stage_in_si_units() {
    let stage = parse(SOUND).expect("sound");
    assert_eq!(stage.probes[2].place_m[1], 0.36);
    assert_eq!(stage.hall.m_per_count, 6.25e-8);
    assert_eq!(
        (stage.hall.window.low, stage.hall.window.high),
        (-32767, 32766)
    );
    assert_eq!(stage.capacitive_probes_m[2], [0.0, -0.12]);
    assert_eq!(stage.interferometer.y_baseline_m, 0.1);
    let theta = 8f64.to_radians();
    let range = |low, high| Range { low, high };
    let term = |key| stage.search.get(key).expect(key);
    assert_eq!(term("theta_deg"), [range(-theta, theta); 3]);
    assert_eq!(
        term("eta"),
        [range(0.78, 0.98), range(0.65, 0.85), range(0.72, 0.92)]
    );
    let (falling, rising) = (range(-5000.0, 0.0), range(0.0, 5000.0));
    assert_eq!(term("a_per_m"), [falling; 3]);
    assert_eq!(term("b_per_rad"), [falling; 3]);
    assert_eq!(term("c_per_rad"), [rising, falling, rising]);
    assert_eq!(stage.search.get("d_per_m"), None);
    let mut search = stage.search.clone();
    search.set("d_per_m", [rising; 3]);
    assert_eq!(search.get("d_per_m"), Some([rising; 3]));
    assert_eq!(stage.search.delta_m.high, 10e-6);
    assert_eq!(stage.log, crate::log::layout::LogLayout::default());
    let crlf = format!("\u{feff}{}", SOUND.replace('\n', "\r\n"));
    assert_eq!(parse(&crlf).expect("sound"), stage);
}

#[test]
fn every_key_but_a_range_is_needed_and_its_absence_named() {
    let mut table = "";
    for (number, line) in (1..).zip(SOUND.lines()) {
        if let Some(name) = line.strip_prefix('[') {
            table = name.trim_end_matches(']');
            if table == "search" {
                break;
            }
            let end = SOUND.find(line).expect("its start") + line.len();
            let inside = SOUND[end..].split("\n[").next().unwrap_or_default();
            let without = SOUND.replace(&format!("{line}{inside}"), "");
            let message = refused(&without, 1, 1, table);
            let example = format!("missing; add it, for instance `[{table}]`");
            assert!(message.contains(&example), "{message}");
        } else if let Some((key, _)) = line.split_once(" = ") {
            let without = SOUND.lines().enumerate().filter(|(at, _)| at + 1 != number);
            let without: String = without.map(|(_, line)| format!("{line}\n")).collect();
            let header = SOUND.lines().position(|line| line == format!("[{table}]"));
            let line = header.expect("its table") + 1;
            let message = refused(&without, line, 1, &format!("{table}.{key}"));
            let example = format!("missing; add it, for instance `{key} = ");
            assert!(message.contains(&example), "{message}");
        }
    }
}

#[test]
fn ranges_that_are_left_out_follow_from_the_design() {
    let start = SOUND.find("[search]").expect("the table");
    let search = &parse(&SOUND[..start]).expect("sound").search;
    let close = |range: Range, low: f64, high: f64| {
        assert!(
            (range.low - low).abs() < 1e-9 && (range.high - high).abs() < 1e-9,
            "{range:?}"
        );
    };
    close(search.places_m[2][1], 0.26, 0.46);
    close(search.delta_m, -1e-4, 1e-4);
    let term = |key| search.get(key).expect(key);
    for range in term("eta") {
        close(range, 0.5, 1.5);
    }
    for range in term("a_per_m") {
        close(range, -5000.0, 0.0);
    }
    // B stands at x = -0.1975 m, y = 0.42 m.
    close(term("b_per_rad")[1], -2600.0, 0.0);
    close(term("c_per_rad")[1], -1487.5, 0.0);
    close(term("c_per_rad")[2], 0.0, 1487.5);
    // One key alone.
    let eta = parse(&format!(
        "{}[search]\neta_b = [0.6, 0.7]\n",
        &SOUND[..start]
    ));
    let eta = eta.expect("sound").search.get("eta").expect("a range");
    close(eta[0], 0.5, 1.5);
    close(eta[1], 0.6, 0.7);
}

/// What is replaced in the sound file (all of it where nothing is), by what; line, column and
/// key of the error, and a part of its message.
type Case = (
    &'static str,
    &'static str,
    usize,
    usize,
    &'static str,
    &'static str,
);

#[test]
fn what_is_wrong_is_named_with_its_place_its_key_and_a_remedy() {
    #[rustfmt::skip]
    let cases: &[Case] = &[
        // Unknown keys, with the intended key or the known keys.
        ("period_s", "perod_s", 23, 1, "servo.perod_s", "did you mean `period_s`?"),
        ("[servo]", "[servos]", 22, 2, "servos", "did you mean `servo`?"),
        ("[search]", "[serach]", 25, 2, "serach", "did you mean `search`?"),
        ("eta_b = [0.65, 0.85]", "et_b = [0.65, 0.85]", 33, 1, "search.et_b", "did you mean `eta_b`?"),
        // A key that is missing beside others that look like it.
        ("h1x_m = 0.1975\n", "", 2, 1, "hall.h1x_m", "missing; add it"),
        // Decimal commas: four numbers in place of two.
        ("[0.78, 0.98]", "[0,78, 0,98]", 32, 9, "search.eta_a", "write it like `eta_a = [0.78, 0.98]`"),
        ("# a note", "serial = 7", 1, 1, "serial", "capacitive, certificate, hall"),
        ("delta_m", "eta_d", 39, 1, "search.eta_d", "eta_c, h1x_m"),
        // Another kind of value.
        ("= 0.40", "= \"0.40\"", 4, 9, "hall.h1y_m", "does not fit; write it like `h1y_m = 0.40`"),
        ("= 0.002", "= true", 23, 12, "servo.period_s", "does not fit"),
        ("= 0.10", "= [0.1]", 20, 16, "interferometer.y_baseline_m", "does not fit"),
        ("h1x_m = 0.1975", "h1x_m = 1975-01-01", 3, 9, "hall.h1x_m", "does not fit"),
        ("[0.78, 0.98]", "0.88", 32, 9, "search.eta_a", "like `eta_a = [0.78, 0.98]`"),
        ("[0.78, 0.98]", "[0.78]", 32, 9, "search.eta_a", "does not fit"),
        ("[0.78, 0.98]", "[0.78, \"1\"]", 32, 16, "search.eta_a[1]", "does not fit"),
        ("[0.12, 0.0]", "[0.12, 0.0, 0.0]", 14, 13, "capacitive.probes_m[0]", "does not fit"),
        (", [0.0, -0.12]", "", 14, 12, "capacitive.probes_m", "does not fit"),
        ("6.25e-8\ncode_min = -32768", "6.25e-8\ncode_min = -32768.0", 10, 12, "hall.code_min", "this float does not fit"),
        ("# a note", "log = 3", 1, 7, "log", "does not fit"),
        // Numbers that cannot be true.
        ("= 0.36", "= nan", 8, 9, "hall.h3y_m", "NaN"),
        ("= 0.36", "= -inf", 8, 9, "hall.h3y_m", "-inf"),
        ("= 0.36", "= 1e999", 8, 9, "hall.h3y_m", "overflowed"),
        ("= 0.36", "= 360.0", 8, 9, "hall.h3y_m", "360 m is outside"),
        ("= 6.25e-8", "= -6.25e-8", 9, 15, "hall.m_per_count", "a full scale of -2"),
        ("= 6.25e-8", "= 6.25e-5", 9, 15, "hall.m_per_count", "a full scale of 2.0479375e0 m"),
        ("= 6.25e-8", "= nan", 9, 15, "hall.m_per_count", "NaN m per code"),
        ("= 1.5625e-8", "= 1.5e-18", 15, 15, "capacitive.m_per_count", "a full scale"),
        ("= 0.10", "= 0", 20, 16, "interferometer.y_baseline_m", "0 m is outside"),
        ("= 0.10", "= 0.10\nreset_sd = { x_m = 2e-6, y_m = 2.0, rz_rad = 1e-6 }", 21, 32, "interferometer.reset_sd.y_m", "2 m is outside"),
        ("= 0.10", "= 0.10\ny1 = { x_m = 50 }", 21, 14, "interferometer.y1.x_m", "50 m is outside"),
        ("= 0.10", "= 0.10\nx = { y_m = 0.0, towards_x_rad = 0.0 }", 21, 18, "interferometer.x.towards_x_rad", "did you mean `towards_y_rad`?"),
        ("= 0.10", "= 0.10\ny1 = { x_m = 0.06 }\ny2 = { x_m = -0.06 }", 22, 14, "interferometer.y2.x_m", "y1.x_m - y2.x_m is 0.12 m"),
        ("= 0.10", "= 0.10\ny1 = { towards_x_rad = 0.1 }\nx = { y_m = -1.5 }", 20, 16, "interferometer.y_baseline_m", "do not follow from such beams"),
        ("= 0.10", "= 0.10\nscale = [1, 1, 0]", 21, 16, "interferometer.scale[2]", "0 m per m is outside"),
        ("= 0.10", "= 0.10\nair = { index = 1 }", 21, 7, "interferometer.air.temperature_c", "missing"),
        ("= 0.002", "= 0.0", 23, 12, "servo.period_s", "0 s is outside"),
        ("= 0.002", "= -0.002", 23, 12, "servo.period_s", "is outside"),
        ("= 0.002", "= 2e-9", 23, 12, "servo.period_s", "is outside"),
        ("= 0.002", "= 2000", 23, 12, "servo.period_s", "is outside"),
        // Codes that leave no window, or are not decoded exactly.
        ("32767\n\n[cap", "-32768\n\n[cap", 11, 12, "hall.code_max", "no code lies between"),
        ("32767\n\n[cap", "-32767\n\n[cap", 11, 12, "hall.code_max", "no code lies between"),
        ("32767\n\n[cap", "-40000\n\n[cap", 11, 12, "hall.code_max", "no code lies between"),
        ("32767\n\n[cap", "16777216\n\n[cap", 11, 12, "hall.code_max", "beyond 24 bits"),
        ("32767\n\n[int", "9223372036854775807\n\n[int", 17, 12, "capacitive.code_max", "beyond 24 bits"),
        // Sensors that define no plane, or cannot tell X, Y and Rz apart.
        ("[0.0, -0.12]", "[0.0, 0.00001]", 14, 12, "capacitive.probes_m", "one line"),
        ("[-0.12, 0.0]", "[0.12, 0.0]", 14, 12, "capacitive.probes_m", "one line"),
        ("[-0.12, 0.0]", "[-12, 0.0]", 14, 27, "capacitive.probes_m[1][0]", "-12 m is outside"),
        ("[[0.12, 0.0], [-0.12, 0.0], [0.0, -0.12]]", "[[0.0, 0.0], [1e-9, 0.0], [0.0, 1e-9]]", 14, 12, "capacitive.probes_m", "1.024e6 rad"),
        ("h2x_m = 0.1975", "h2x_m = -0.1975", 5, 9, "hall.h2x_m", "the same x"),
        ("# a note\n[hall]", "[hall]\ndirection_deg = [90, 90, 90]", 5, 9, "hall.h2x_m", "two probes sense the same"),
        ("# a note\n[hall]", "[hall]\ndirection_deg = [90, 90]", 2, 17, "hall.direction_deg", "does not fit"),
        ("# a note\n[hall]", "[hall]\ndirection_deg = [90, 900, 0]", 2, 22, "hall.direction_deg[1]", "900 degrees is outside"),
        // Ranges that are reversed, out of bounds, or exclude the design.
        ("[0.65, 0.85]", "[0.85, 0.65]", 33, 9, "search.eta_b", "reversed"),
        ("[0.65, 0.85]", "[-inf, 0.85]", 33, 10, "search.eta_b[0]", "-inf"),
        ("a_per_m = [[-5000.0, 0.0]", "a_per_m = [[0.0, -5.0]", 36, 12, "search.a_per_m[0]", "reversed"),
        ("[0.26, 0.46]", "[0.26, 0.35]", 28, 9, "search.h3y_m", "the designed value 0.36"),
        ("[-8.0, 8.0]", "[1.0, 8.0]", 35, 13, "search.theta_deg", "the designed value 0"),
        ("[-8.0, 8.0]", "[-180.0, 8.0]", 35, 14, "search.theta_deg[0]", "-180 degrees is outside"),
        ("[-10e-6, 10e-6]", "[-10.0, 10.0]", 39, 12, "search.delta_m[0]", "-10 m is outside"),
    ];
    for (old, new, line, column, key, part) in cases {
        assert_eq!(SOUND.matches(old).count(), 1, "{old}");
        let message = refused(&SOUND.replace(old, new), *line, *column, key);
        assert!(message.contains(part), "{part}: {message}");
    }
    // The designed eta of 1 lies outside its range on purpose.
    let eta = parse(SOUND).expect("sound").search.get("eta");
    assert!(eta.is_some_and(|eta| !eta[0].contains(1.0)));
}

#[test]
fn names_units_and_scales_of_columns_are_mapped() {
    let log = "movement = \"run\"\nhall_b = { column = \"ADC 2\" }\nifm_x = \"stage_x_um\"\n\
               ifm_y1 = { column = \"left\", unit = \"mm\" }\n\
               ifm_y2 = { column = \"right\", scale = -6.25e-10 }\n\
               time = { column = \"t\", scale = 0.002 }\nignore = [\"temperature\", \"x_m\"]";
    let stage = parse(&format!("{SOUND}[log]\n{log}")).expect("sound");
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
    assert_eq!(stage.log.ignored, ["temperature", "x_m"]);
}

#[test]
fn theta_counts_from_the_directions_of_the_paper() {
    let theta = |directions: &str| {
        let new = format!("[hall]\ndirection_deg = {directions}");
        let stage = parse(&SOUND.replace("[hall]", &new)).expect("sound");
        stage
            .probes
            .map(|probe| probe.theta_rad.to_degrees().round())
    };
    assert_eq!(parse(SOUND).expect("sound").probes[1].theta_rad, 0.0);
    assert_eq!(theta("[90, 90, 0]"), [0.0; 3]);
    assert_eq!(theta("[90, -90, 30.0]"), [0.0, -180.0, 30.0]);
}

#[test]
fn what_is_wrong_with_a_column_is_named() {
    #[rustfmt::skip]
    let cases = [
        ("hal_a = \"x\"", 1, "log.hal_a", "did you mean `hall_a`?"),
        ("note = \"x\"", 1, "log.note", "expected one of cap_1, cap_2, "),
        ("hall_a = 3", 10, "log.hall_a", "does not fit"),
        ("ifm_x = { name = \"a\" }", 11, "log.ifm_x.name", "expected one of column"),
        ("ifm_x = { colum = \"a\" }", 11, "log.ifm_x.colum", "did you mean `column`?"),
        ("ifm_x = { column = \"a_um\", units = \"m\" }", 28, "log.ifm_x.units", "did you mean `unit`?"),
        ("ifm_x = { unit = \"m\" }", 9, "log.ifm_x.column", "missing"),
        ("ifm_x = { column = \"a\", unit = 3 }", 32, "log.ifm_x.unit", "does not fit"),
        ("ifm_x = \"laser\"", 9, "log.ifm_x", "m, mm, um"),
        ("rz = \"rz_um\"", 6, "log.rz", "rad, mrad"),
        ("ifm_x = { column = \"a\", unit = \"in\" }", 32, "log.ifm_x.unit", "m, mm, um"),
        ("ifm_x = { column = \"a\", unit = \"m\", scale = 1.0 }", 45, "log.ifm_x.scale", "both"),
        ("ifm_x = { column = \"a\", scale = 0.0 }", 33, "log.ifm_x.scale", "outside"),
        ("cap_1 = { column = \"a\", scale = 2.0 }", 33, "log.cap_1.scale", "without a unit"),
        ("cap_1 = { column = \"a\", unit = \"m\" }", 32, "log.cap_1.unit", "without a unit"),
        ("cap_1 = \"\"", 9, "log.cap_1", "empty"),
        ("cap_1 = \"cap2_cnt\"", 9, "log.cap_1", "twice (also by `cap_2`)"),
        ("cap_1 = \"a\"\nignore = [\"a\"]", 11, "log.ignore[0]", "twice (also by `cap_1`)"),
    ];
    for (log, column, key, part) in cases {
        let line = 40 + log.lines().count();
        let message = refused(&format!("{SOUND}[log]\n{log}\n"), line, column, key);
        assert!(message.contains(part), "{part}: {message}");
    }
}

#[test]
fn text_that_is_not_toml_is_refused_with_its_place() {
    let comma = "write a decimal point, as 0.1975";
    for (old, new, at, part) in [
        ("h1x_m = 0.1975\n", "h1x_m = 0.1975 m\n", 3, "not TOML"),
        ("h1y_m = 0.40", "h1x_m = 0.40", 4, "not TOML"),
        (
            "h1x_m = 0.1975\n",
            "h1x_m = 0,1975  # of the drawing\n",
            3,
            comma,
        ),
    ] {
        let error = parse(&SOUND.replacen(old, new, 1)).expect_err(new);
        assert!(
            matches!(error, StageError::Syntax { ref place, .. } if place.line == at),
            "{error}"
        );
        assert!(error.to_string().contains(part), "{error}");
    }
}

#[test]
fn a_file_that_cannot_be_read_is_named() {
    let folder = tempfile::tempdir().expect("a folder");
    let write = |name: &str, bytes: &[u8]| {
        let path = folder.path().join(name);
        std::fs::write(&path, bytes).expect("written");
        path
    };
    for (path, part) in [
        (folder.path().to_owned(), "is a folder"),
        (folder.path().join("none.toml"), "check the path"),
        (write("binary.toml", b"[hall]\n\xff\xfe"), "byte 7"),
        (write("large.toml", &[b'\n'; (1 << 20) + 1]), "1048576"),
    ] {
        let error = Stage::from_file(&path).expect_err(part).to_string();
        assert!(error.contains(part), "{part}: {error}");
    }
}

proptest! {
    #[test]
    fn no_text_makes_the_reader_panic(at in 0..SOUND.len(), cut in 0..40usize, paste in "[-0-9a-z.=\\[\\]{}\", \n_]{0,20}") {
        let mut text = SOUND.to_owned();
        text.replace_range(at..(at + cut).min(text.len()), &paste);
        if let Err(error) = parse(&text) {
            prop_assert!(error.to_string().contains("; "), "{}", error);
        }
    }
}

#[test]
fn codes_of_temperatures_need_a_scale() {
    for line in [
        "c_at_zero = 25.0",
        "c_per_count = 0.0",
        "unit = \"K\"\nc_per_count = 0.01",
    ] {
        let toml = format!("{SOUND}\n[temperature]\nmount = \"mount\"\n{line}\n");
        let refused = parse(&toml).expect_err(line);
        assert!(refused.to_string().contains("`c_per_count`"), "{refused}");
    }
}
