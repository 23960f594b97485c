mod columns;
mod values;

use super::*;
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

/// The error after replacing `old`, which must be there once, by `new`.
#[track_caller]
fn refused(old: &str, new: &str) -> StageError {
    assert_eq!(SOUND.matches(old).count(), 1, "{old}");
    parse(&SOUND.replace(old, new)).expect_err(new)
}

/// Where the error is and which key it names.
fn place_and_key(error: &StageError) -> Option<(usize, usize, &str)> {
    match error {
        StageError::Missing { place, key, .. }
        | StageError::Unknown { place, key, .. }
        | StageError::WrongType { place, key, .. }
        | StageError::Absurd { place, key, .. } => Some((place.line, place.column, key)),
        _ => None,
    }
}

/// The fault of a value that is refused at `line`, `column` as `key`.
#[track_caller]
fn fault_at(error: StageError, line: usize, column: usize, key: &str) -> ValueFault {
    assert_eq!(place_and_key(&error), Some((line, column, key)), "{error}");
    let message = error.to_string();
    assert!(
        message.starts_with(&format!("stage.toml:{line}:{column}: `{key}`")),
        "{message}"
    );
    match error {
        StageError::Absurd { fault, .. } => fault,
        other => panic!("{other}"),
    }
}

#[test]
fn a_sound_file_gives_the_stage_in_si_units() {
    let stage = parse(SOUND).expect("sound");
    assert_eq!(stage.designed.h3y_m, 0.36);
    assert_eq!(stage.hall.m_per_count, 6.25e-8);
    assert_eq!(
        (stage.hall.window.low, stage.hall.window.high),
        (-32767, 32766)
    );
    assert_eq!(stage.capacitive_probes_m[2], [0.0, -0.12]);
    assert_eq!(stage.y_baseline_m, 0.1);
    let theta = 8f64.to_radians();
    assert_eq!(
        stage.search.theta_rad,
        Range {
            low: -theta,
            high: theta
        }
    );
    assert_eq!(stage.search.c_per_rad[1].low, -5000.0);
    assert_eq!(stage.search.delta_m.high, 10e-6);
    assert_eq!(stage.log, crate::input::log::layout::LogLayout::default());
    let crlf = format!("\u{feff}{}", SOUND.replace('\n', "\r\n"));
    assert_eq!(parse(&crlf).expect("sound"), stage);
}

#[test]
fn every_key_is_needed_and_its_absence_named() {
    for line in SOUND.lines().filter(|line| line.contains('=')) {
        let key = line.split(' ').next().expect("a key");
        let without = SOUND.replacen(&format!("{line}\n"), "", 1);
        let error = parse(&without).expect_err(line);
        let StageError::Missing {
            key: named, place, ..
        } = &error
        else {
            panic!("{line}: {error}");
        };
        assert!(named.ends_with(&format!(".{key}")), "{line}: {error}");
        let table = without.lines().nth(place.line - 1).expect("a line");
        assert!(table.starts_with('['), "points at the table: {error}");
        assert!(error.to_string().contains("add it"), "{error}");
    }
    for table in ["hall", "capacitive", "interferometer", "servo", "search"] {
        let error = parse(&SOUND.replace(&format!("[{table}]"), "[log]")).expect_err(table);
        assert!(
            matches!(&error, StageError::Missing { key, .. } if key == table),
            "{error}"
        );
    }
}

#[test]
fn an_unknown_key_is_refused_with_those_that_are_known() {
    for (text, line, column, key) in [
        (SOUND.replace("period_s", "perod_s"), 23, 1, "servo.perod_s"),
        (SOUND.replace("[servo]", "[servos]"), 22, 2, "servos"),
        (format!("serial = 7\n{SOUND}"), 1, 1, "serial"),
        (
            format!("{SOUND}eta_d = [0.0, 1.0]\n"),
            40,
            1,
            "search.eta_d",
        ),
        (format!("{SOUND}[log]\nhal_a = \"x\"\n"), 41, 1, "log.hal_a"),
    ] {
        let error = parse(&text).expect_err(key);
        assert!(matches!(error, StageError::Unknown { .. }), "{error}");
        assert_eq!(place_and_key(&error), Some((line, column, key)), "{error}");
        assert!(
            error.to_string().contains("correct its spelling"),
            "{error}"
        );
    }
}

#[test]
fn a_value_of_another_kind_is_refused() {
    for (old, new, line, column, key) in [
        ("h1y_m = 0.40", "h1y_m = \"0.40\"", 4, 9, "hall.h1y_m"),
        (
            "period_s = 0.002",
            "period_s = true",
            23,
            12,
            "servo.period_s",
        ),
        (
            "y_baseline_m = 0.10",
            "y_baseline_m = [0.1]",
            20,
            16,
            "interferometer.y_baseline_m",
        ),
        (
            "eta_a = [0.78, 0.98]",
            "eta_a = 0.88",
            32,
            9,
            "search.eta_a",
        ),
        (
            "eta_a = [0.78, 0.98]",
            "eta_a = [0.78]",
            32,
            9,
            "search.eta_a",
        ),
        (
            "eta_a = [0.78, 0.98]",
            "eta_a = [0.78, \"1\"]",
            32,
            16,
            "search.eta_a[1]",
        ),
        (
            "[0.12, 0.0]",
            "[0.12, 0.0, 0.0]",
            14,
            13,
            "capacitive.probes_m[0]",
        ),
        (", [0.0, -0.12]", "", 14, 12, "capacitive.probes_m"),
    ] {
        let error = refused(old, new);
        assert!(matches!(error, StageError::WrongType { .. }), "{error}");
        assert_eq!(place_and_key(&error), Some((line, column, key)), "{error}");
        assert!(error.to_string().contains("; write "), "{error}");
    }
    let error =
        parse(&SOUND.replace("code_min = -32768", "code_min = -32768.0")).expect_err("float");
    assert!(matches!(error, StageError::WrongType { .. }), "{error}");
    let error = parse(&format!("log = 3\n{SOUND}")).expect_err("no table");
    assert_eq!(place_and_key(&error), Some((1, 7, "log")), "{error}");
}

#[test]
fn text_that_is_not_toml_is_refused_with_its_place() {
    let error = refused("h1x_m = 0.1975\nh1y_m", "h1x_m = 0.1975 m\nh1y_m");
    let StageError::Syntax { place, .. } = &error else {
        panic!("{error}");
    };
    assert_eq!(place.line, 3, "{error}");
    let error = refused("h1y_m = 0.40", "h1x_m = 0.40");
    assert!(
        matches!(error, StageError::Syntax { ref place, .. } if place.line == 4),
        "{error}"
    );
}

#[test]
fn a_file_that_cannot_be_read_is_named() {
    let folder = tempfile::tempdir().expect("a folder");
    let error = Stage::from_file(folder.path()).expect_err("a folder");
    assert!(matches!(error, StageError::IsFolder { .. }), "{error}");
    let error = Stage::from_file(&folder.path().join("none.toml")).expect_err("missing");
    assert!(matches!(error, StageError::Unreadable { .. }), "{error}");
    assert!(error.to_string().contains("--stage"), "{error}");
    let binary = folder.path().join("binary.toml");
    std::fs::write(&binary, b"[hall]\n\xff\xfe").expect("written");
    let error = Stage::from_file(&binary).expect_err("binary");
    assert!(
        matches!(error, StageError::NotText { offset: 7, .. }),
        "{error}"
    );
    std::fs::write(&binary, [b'\n'; (1 << 20) + 1]).expect("written");
    let error = Stage::from_file(&binary).expect_err("too large");
    assert!(matches!(error, StageError::TooLarge { .. }), "{error}");
}

proptest! {
    #[test]
    fn no_text_makes_the_reader_panic(at in 0..SOUND.len(), cut in 0..40usize, paste in "[-0-9a-z.=\\[\\]{}\", \n_]{0,20}") {
        let mut text = SOUND.to_owned();
        text.replace_range(at..(at + cut).min(text.len()), &paste);
        if let Err(error) = parse(&text) {
            prop_assert!(error.to_string().contains("; ") || matches!(error, StageError::Absurd { .. }), "{}", error);
        }
    }
}
