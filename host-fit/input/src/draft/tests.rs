use super::*;
use crate::dataset::Row;
use crate::log::{ReadOptions, read};
use crate::stage::{Stage, StageError};
use proptest::prelude::*;

/// Two movements as the stage that ships with the program would log them: names and units of the
/// columns are to be put in, and a row below them.
fn log(header: &str, below: &str) -> String {
    let rows = (0..24).map(|k| {
        let (run, t) = (k / 12, 2 * (k % 12));
        format!("{run},{t},0.{k},1.{k},2.{k},{k},0,-{k},{k},1{k},2{k}\n")
    });
    format!("{header}\n{below}") + &rows.collect::<String>()
}

const PLAIN: &str =
    "run,time [ms],Laser X [um],Laser Y1 [um],Laser Y2 [um],cap 1,cap 2,cap 3,Hall A,Hall B,Hall C";

struct Drafted {
    draft: Draft,
    path: std::path::PathBuf,
    _folder: tempfile::TempDir,
}

fn drafted(text: &str) -> Drafted {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("log.csv");
    std::fs::write(&path, text).expect("written");
    let draft = draft(&[&path]).expect("a log");
    Drafted {
        draft,
        path,
        _folder: folder,
    }
}

impl Drafted {
    /// The rows by the draft after `fill_in`, or why there are none.
    fn rows(&self, fill_in: impl Fn(&str) -> String) -> Result<Vec<Row>, String> {
        let text = self.draft.text.lines().map(|line| fill_in(line) + "\n");
        let text: String = text.collect();
        let stage = Stage::from_toml(&text, Path::new("stage.toml")).map_err(|e| e.to_string())?;
        let reading = read(&[&self.path], &stage, &ReadOptions::default());
        Ok(reading.map_err(|e| e.to_string())?.dataset.rows)
    }

    #[track_caller]
    fn has(&self, part: &str) {
        assert!(
            self.draft.text.contains(part),
            "{part}: {}",
            self.draft.text
        );
    }
}

fn without_mark(line: &str) -> String {
    line.strip_prefix(MARK).unwrap_or(line).to_owned()
}

#[test]
fn a_draft_with_every_line_filled_in_reads_its_log() {
    let plain = drafted(&log(PLAIN, ""));
    let rows = plain.rows(without_mark).expect("filled in");
    assert_eq!((rows.len(), rows[1].t_us, rows[23].movement), (24, 2000, 1));
    assert_eq!(rows[1].reference[0], 0.1e-6);
    assert_eq!((plain.draft.mapped, plain.draft.ignored.len()), (11, 0));
    plain.has("period_s = 0.002 ");
    // Units in a row below, a pose in place of the beams, and columns to leave out.
    let below = "-,ms,um,um,mrad,-,-,-,-,-,-\n";
    let names = "Run,Time,X,Y,Yaw,gap1,gap2,gap3,probe A,probe B,probe C";
    let other = drafted(&log(names, below));
    let have = other.rows(without_mark).expect("filled in");
    assert_eq!(
        (have[1].reference[2], have[1].frame),
        (2.1 * 1e-3, rows[1].frame)
    );
    let noted = log(&PLAIN.replace("Laser Y2 [um]", "note \\ \"left\""), "");
    let noted = drafted(&noted);
    assert_eq!(noted.draft.ignored, ["note \\ \"left\""]);
    let error = noted.rows(without_mark).expect_err("a beam is missing");
    assert!(
        error.contains("log.ifm_y2") || error.contains("ifm_y2"),
        "{error}"
    );
}

#[test]
fn a_line_that_is_not_filled_in_is_refused_by_its_key() {
    let volts = PLAIN.replace("Hall A", "Hall A [V]");
    for names in [PLAIN, &volts] {
        let drafted = drafted(&log(names, ""));
        let lines = drafted.draft.text.lines();
        let lines: Vec<&str> = lines.filter(|line| line.starts_with(MARK)).collect();
        assert_eq!(lines.len(), drafted.draft.to_fill_in);
        // Places, scales and lengths: nothing else is left.
        assert_eq!(lines.len(), 10 + usize::from(names != PLAIN));
        for left in lines {
            let fill_in = |line: &str| match line == left {
                true => line.to_owned(),
                false => without_mark(line),
            };
            // m_per_count, code_min and code_max stand in two tables.
            let own = without_mark(left);
            let key = own.split(' ').next().unwrap_or_default();
            let error = drafted.rows(fill_in).expect_err(left);
            assert!(error.contains(key), "{key}: {error}");
        }
    }
}

#[test]
fn what_a_draft_cannot_tell_is_left_to_the_user() {
    let unit = drafted(&log(&PLAIN.replace("Laser X [um]", "Laser X"), ""));
    unit.has("# FILL IN: ifm_x = { column = \"Laser X\", unit = \"..\" }");
    let error = unit.rows(|line| match line.contains("ifm_x") {
        true => line.to_owned(),
        false => without_mark(line),
    });
    let error = error.expect_err("the unit is not known");
    assert!(
        error.contains("Laser X") && error.contains("[log]"),
        "{error}"
    );
    let twice = drafted(&log(&PLAIN.replace("cap 2", "gap 1"), ""));
    twice.has("# FILL IN: cap_1 = \"cap 1\" or \"gap 1\"");
    // X beside Y1 and Y2 is a beam.
    let beam = drafted(&log(&PLAIN.replace("Laser ", ""), ""));
    beam.has("\nifm_x = \"X [um]\"");
    let none = drafted(&log(&PLAIN.replace("run", "note"), ""));
    none.has("# no column for the movement");
}

#[test]
fn times_are_found_under_any_name_and_in_any_unit() {
    let with_times = |header: &str, time: &dyn Fn(i64) -> String| {
        let text = log(&PLAIN.replace("time [ms]", header), "");
        let row = |(k, line): (i64, &str)| match line.split(',').collect::<Vec<_>>() {
            mut cells if k > 0 => {
                let time = time(2 * ((k - 1) % 12));
                cells[1] = &time;
                cells.join(",") + "\n"
            }
            cells => cells.join(",") + "\n",
        };
        let drafted = drafted(&(0..).zip(text.lines()).map(row).collect::<String>());
        let text = &drafted.draft.text;
        assert!(text.contains("period_s = 0.002 "), "{header}: {text}");
        let rows = drafted.rows(without_mark).expect(header);
        let steps = rows[..12]
            .windows(2)
            .map(|pair| pair[1].t_us - pair[0].t_us);
        assert_eq!(steps.collect::<Vec<_>>(), [2000; 11], "{header}");
    };
    for header in ["Zeit", "clock / ms", "Uhr [ms]", "time"] {
        with_times(header, &|ms| ms.to_string());
    }
    for header in ["t", "Zeit [s]", "Uhr_s"] {
        with_times(header, &|ms| format!("0.{ms:03}"));
    }
    for header in ["Datum und Uhrzeit", "time"] {
        with_times(header, &|ms| format!("2026-01-02T03:04:05.{ms:03}"));
    }
}

#[test]
fn gaps_in_a_unit_of_length_and_converters_of_24_bits_are_drafted() {
    let um = PLAIN.replace("cap 1,cap 2,cap 3", "cap 1 [um],gap2_um,Cap3 (\u{b5}m)");
    let gaps = drafted(&log(&um, ""));
    gaps.has("\ngap_1 = \"cap 1 [um]\"");
    let rows = gaps.rows(without_mark).expect("filled in");
    // Gaps 1 and 2 of 5 um and 0 at x = +-0.12 m.
    assert!((rows[5].vertical[0] - 2.5e-6).abs() < 1e-15);
    assert_eq!(rows[5].frame.capacitive(), None);
    let text = &gaps.draft.text;
    assert_eq!(text.matches("\ncode_max = 32767 ").count(), 2, "{text}");
    let large = drafted(&log(PLAIN, "").replace(",23,123,", ",70000,123,"));
    let text = &large.draft.text;
    assert_eq!(text.matches("\ncode_max = 32767 ").count(), 1, "{text}");
    assert_eq!(text.matches("\ncode_max = 8388607 ").count(), 1, "{text}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]
    #[test]
    fn a_draft_is_always_toml_whatever_the_columns_are_called(
        names in prop::collection::vec("[^\\p{Cc},;]{0,12}|(hall|ifm|cap)_[abxy12] ?[\\[(/\"\\\\]?[um#]{0,2}", 2..8),
        below in "[-,um\"#V]{0,12}",
    ) {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a #\"log\".csv");
        let row = vec!["1"; names.len()].join(",");
        std::fs::write(&path, format!("{}\n{below}\n{row}\n{row}\n", names.join(","))).expect("written");
        if let Ok(draft) = draft(&[&path]) {
            let error = Stage::from_toml(&draft.text, Path::new("stage.toml")).expect_err("not filled in");
            prop_assert!(matches!(error, StageError::Key { .. }), "{}: {}", error, draft.text);
        }
    }
}
