use super::*;
use hal_adapters::can::Layout;
use hal_adapters::can::{BusFrame, Coded, sensor};
use hal_adapters::candump::{LineError, LogLine};
use hallstage_input::log::{self, ReadOptions};
use runtime::RawFrame;
use std::f64::consts::TAU;
use std::fmt::Write;
use tempfile::TempDir;

/// Time of the bus less time of the reference, us: the bus counts from 1970.
pub(super) const OFFSET_US: f64 = 1_735_270_496_123_456.0;
const MOVEMENT_US: f64 = 500_000.0;
pub(super) const M_PER_CODE: f64 = 6.25e-8;
const TICKS: u32 = 750;

/// X, Y, Rz at a time of the reference, m, m, rad: one axis a movement, in turn.
pub(super) fn pose(t_us: f64) -> [f64; 3] {
    let axis = (t_us / MOVEMENT_US).floor() as usize % 3;
    let angle = TAU * (t_us / MOVEMENT_US).fract();
    let mut q = [0.0; 3];
    q[axis] = 300e-6 * angle.sin();
    q
}

/// What the probes read, in codes; probes as designed.
pub(super) fn hall(t_us: f64) -> [i32; 3] {
    signals_m(pose(t_us)).map(|s| (s / M_PER_CODE).round() as i32)
}

/// The displacements that the probes read at a pose.
pub(super) fn signals_m([x, y, rz]: [f64; 3]) -> [f64; 3] {
    [y + 0.1975 * rz, y - 0.1975 * rz, x - 0.36 * rz]
}

/// The record of the bus: jitter of up to 200 us, `skip` decides which frames are missing.
pub(super) fn candump(skip: impl Fn(u32, usize) -> bool) -> String {
    candump_with(skip, hall)
}

/// As [`candump`], with what the probes read.
fn candump_with(skip: impl Fn(u32, usize) -> bool, hall: impl Fn(f64) -> [i32; 3]) -> String {
    let codes = |n: u32| {
        let t_us = 2_000.0 * f64::from(n) + 300.0;
        (hall(t_us), [100, 101, 99], n + 5, t_us as u32)
    };
    record(TICKS, codes, |n, k, _| {
        let jitter_us = f64::from(n * 7919 % 201) - 100.0;
        (!skip(n, k)).then_some(2_000.0 * f64::from(n) + 300.0 + jitter_us)
    })
}

/// Hall and capacitive codes, number and time by the node's clock.
pub(super) type Codes = ([i32; 3], [i32; 3], u32, u32);

/// A record of the codes of each tick; `received_us` says when a frame of it, the k-th, was received,
/// us on the clock of the reference, if it was.
pub(super) fn record(
    ticks: u32,
    codes: impl Fn(u32) -> Codes,
    received_us: impl Fn(u32, usize, &Coded) -> Option<f64>,
) -> String {
    let mut text = String::new();
    for n in 0..ticks {
        let (hall, capacitive, sequence, time_us) = codes(n);
        let frame = RawFrame::new(hall, capacitive, sequence, time_us);
        for (k, coded) in sensor::frames(Layout::Bits16, &frame).enumerate() {
            if let Some(received_us) = received_us(n, k, &coded) {
                let line = LogLine {
                    time_us: (received_us + OFFSET_US) as u64 + 135 * k as u64,
                    interface: "can0",
                    frame: BusFrame::from(coded),
                };
                writeln!(text, "{line}").expect("a string");
            }
        }
    }
    text
}

/// The interferometers' log at 1 kHz, beams in nm.
pub(super) fn reference() -> String {
    reference_of(TICKS, 0.0, None)
}

/// The same for so many ticks, by a clock that runs faster by `fast`. With a pause
/// before each movement its time starts anew.
pub(super) fn reference_of(ticks: u32, fast: f64, pause_us: Option<f64>) -> String {
    let mut text = "movement,t_us,ifm_x_nm,ifm_y1_nm,ifm_y2_nm\n".to_owned();
    for k in 0..2 * ticks {
        let t_us = 1_000.0 * f64::from(k);
        let true_us = t_us / (1.0 + fast);
        let [x, y, rz] = pose(true_us);
        let half = 0.05 * rz.tan();
        let [x, y1, y2] = [x, y + half, y - half].map(|m| m * 1e9);
        let movement = (true_us / MOVEMENT_US).floor();
        let t_us = match pause_us {
            Some(pause_us) if movement > 0.0 => t_us - movement * MOVEMENT_US - pause_us,
            _ => t_us,
        };
        if t_us >= 0.0 {
            writeln!(text, "{movement},{t_us},{x:.3},{y1:.3},{y2:.3}").expect("a string");
        }
    }
    text
}

/// Two records and their stage in a folder, and how they are joined.
pub(super) struct Import {
    _folder: TempDir,
    pub(super) settings: JoinSettings,
}

pub(super) fn files(bus: &str, reference: &str) -> Import {
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| folder.path().join(name);
    std::fs::write(path("bus.log"), bus).expect("written");
    std::fs::write(path("ifm.csv"), reference).expect("written");
    std::fs::write(path("stage.toml"), hallstage_input::shipped::STAGE_TOML).expect("written");
    let settings = JoinSettings {
        a: path("bus.log"),
        b: path("ifm.csv"),
        stage: StageFile {
            path: path("stage.toml"),
        },
        out: path("log.csv"),
        tolerance_us: None,
        offset_us: None,
        search_s: Some(0.4),
        interface: None,
        bad_rows: BadRows::Refuse,
    };
    Import {
        _folder: folder,
        settings,
    }
}

/// Joins by the stage of the settings.
pub(super) fn run(settings: &JoinSettings) -> Result<JoinReport, JoinError> {
    let stage = Stage::from_file(&settings.stage.path).expect("sound");
    super::run(settings, &stage, Watch::NONE)
}

impl Import {
    /// With another setting.
    pub(super) fn with(mut self, change: impl FnOnce(&mut JoinSettings)) -> Self {
        change(&mut self.settings);
        self
    }

    pub(super) fn run(&self) -> JoinReport {
        run(&self.settings).unwrap_or_else(|error| panic!("{error}"))
    }

    /// Joins, sees that it is refused, and that nothing is written.
    #[track_caller]
    pub(super) fn refused(&self, is_why: impl Fn(&JoinError) -> bool) -> String {
        let error = run(&self.settings).expect_err("refused");
        assert!(is_why(&error), "{error}");
        assert!(!self.settings.out.exists(), "{error}");
        error.to_string()
    }

    /// The reference of each row is the pose at its time, and its codes are of that time.
    #[track_caller]
    pub(super) fn check_poses(&self, apart: f64) {
        for row in &self.log().rows {
            let want = pose(row.t_us as f64);
            for (have, want) in row.reference.iter().zip(want) {
                assert!((have - want).abs() < apart, "{} {have} {want}", row.t_us);
            }
            let hall = hall(row.t_us as f64);
            for (have, want) in row.frame.hall().iter().zip(hall) {
                // 4 um a ms at most: 15 us of offset are 0.06 um, a code.
                assert!((have - want).abs() <= 2, "{} {have} {want}", row.t_us);
            }
        }
    }

    /// The log that it wrote.
    pub(super) fn log(&self) -> hallstage_input::dataset::Dataset {
        let stage = Stage::from_file(&self.settings.stage.path).expect("sound");
        let paths = std::slice::from_ref(&self.settings.out);
        let read = log::read(paths, &stage, &ReadOptions::default());
        read.expect("a sound log").dataset
    }
}

#[test]
fn two_clocks_are_joined_and_the_offset_is_found() {
    let import = files(&candump(|_, _| false), &reference());
    let report = import.run();
    // The earliest frames of each half second give the recorder's clock, up to 100 us early here; this is part
    // of the offset.
    let found_us = report.offset.us - OFFSET_US;
    assert!((-160.0..160.0).contains(&found_us), "{found_us}");
    assert!(report.offset.explained > 0.999);
    let standard_error_us = report.offset.standard_error_us;
    assert!(
        (0.01..20.0).contains(&standard_error_us),
        "{standard_error_us}"
    );
    assert_eq!(report.bus().ticks, TICKS as usize);
    let dataset = import.log();
    assert_eq!(dataset.movements.len(), 3);
    assert!(dataset.rows.len() > 730);
    import.check_poses(1e-9);
}

/// Each movement moves one axis, at the same frequency: a run shifted by a whole movement looks
/// much the same, and a record that ends early must not be taken for one.
#[test]
fn a_record_that_ends_early_is_not_shifted_by_a_movement() {
    let import = files(&candump(|n, _| n >= 460), &reference());
    let report = import.with(|settings| settings.search_s = Some(1.2)).run();
    let found_us = report.offset.us - OFFSET_US;
    assert!((-160.0..160.0).contains(&found_us), "{found_us}");
    assert!(report.join.rows > 445);
}

#[test]
fn a_given_offset_is_the_start_of_the_search() {
    let import = |start_us| {
        let import = files(&candump(|_, _| false), &reference());
        import.with(|settings| {
            (settings.search_s, settings.offset_us) = (Some(0.05), Some(OFFSET_US + start_us));
        })
    };
    for start_us in [-40_000.0, 40_000.0] {
        let found_us = import(start_us).run().offset.us - OFFSET_US;
        assert!((-160.0..160.0).contains(&found_us), "{found_us}");
    }
    // Few common rows, and none.
    for start_us in [-1e6, 9e8] {
        import(start_us).refused(|error| matches!(error, JoinError::NoOffset { .. }));
    }
}

/// Three rows of one movement have a partner in another, which explains them with its axes exchanged.
#[test]
fn a_few_rows_blame_no_column_and_no_unit() {
    let ifm = reference();
    let (head, rows) = ifm.split_once('\n').expect("a header");
    let second: Vec<&str> = rows.lines().skip(500).take(500).collect();
    for scale in ["_nm", "_pm"] {
        let ifm = format!("{}\n{}\n", head.replace("_nm", scale), second.join("\n"));
        let import = files(&candump(|_, _| false), &ifm).with(|settings| {
            (settings.search_s, settings.offset_us) = (Some(0.01), Some(OFFSET_US - 500_000.0));
        });
        import.refused(|error| matches!(error, JoinError::NoOffset { .. }));
        let import = import.with(|settings| settings.offset_us = Some(OFFSET_US + 490_000.0));
        import.refused(|error| matches!(error, JoinError::NoOffset { .. }));
    }
}

/// The motion is 212 um rms. With noise of 40 um 96 % of it is explained, but the offset is uncertain by a quarter
/// of a servo period.
#[test]
fn an_offset_that_noise_leaves_uncertain_is_refused() {
    let standard_error_us = |noise_codes: f64| {
        let noise = |t_us: f64, k: u32| {
            let hash = (t_us as u32 / 7 + k).wrapping_mul(2_654_435_761) >> 16;
            (12.0_f64.sqrt() * noise_codes * (f64::from(hash) / 65_536.0 - 0.5)) as i32
        };
        let noisy = |t_us| {
            let [a, b, c] = hall(t_us);
            [a + noise(t_us, 0), b + noise(t_us, 1), c + noise(t_us, 2)]
        };
        let bus = candump_with(|_, _| false, noisy);
        let import = files(&bus, &reference());
        let outcome = run(&import.settings);
        assert_eq!(outcome.is_ok(), import.settings.out.exists());
        outcome.map(|report| report.offset.standard_error_us)
    };
    let little_us = standard_error_us(64.0).expect("4 um of noise");
    assert!((30.0..120.0).contains(&little_us), "{little_us}");
    match standard_error_us(640.0) {
        Err(JoinError::UncertainOffset {
            standard_error_us,
            most_us: 200.0,
        }) => assert!((300.0..1_200.0).contains(&standard_error_us)),
        other => panic!("{other:?}"),
    }
}

/// On a circle a shift in time is a rotation of the probes, so the offset is uncertain; records of different
/// runs are another fault.
#[test]
fn on_a_circle_the_offset_is_uncertain() {
    let circle = |t_us: f64| {
        let (sin, cos) = (TAU * t_us / MOVEMENT_US).sin_cos();
        [300e-6 * sin, 300e-6 * cos]
    };
    let hall = |t_us| {
        let [x, y] = circle(t_us);
        [y, y, x].map(|s| (s / 6.25e-8).round() as i32)
    };
    let bus = candump_with(|_, _| false, hall);
    let mut ifm = "t_us,x_m,y_m,rz_rad\n".to_owned();
    for k in 0..1_500 {
        let [x, y] = circle(1e3 * f64::from(k));
        writeln!(ifm, "{k}000,{x:.12},{y:.12},0").expect("a string");
    }
    let import = files(&bus, &ifm).with(|settings| settings.search_s = Some(0.1));
    import.refused(|error| matches!(error, JoinError::UncertainOffset { .. }));
}

#[test]
fn missing_frames_and_repeated_samples_are_reported_and_leave_gaps() {
    let bus = candump(|n, k| n == 100 && k == 0 || (200..203).contains(&n));
    let line = "0,50000,";
    let ifm = reference();
    let at = ifm.find(line).expect("that sample");
    let row = ifm[at..].lines().next().expect("a line").to_owned();
    let ifm = ifm.replacen(&row, &format!("{row}\n{row}"), 1);
    let import = files(&bus, &ifm);
    let report = import.run();
    assert_eq!(report.reference.duplicates, 1);
    assert_eq!(report.bus().health.incomplete, 1);
    // Three ticks are gone; the next tick only resumes the sequence.
    assert_eq!((report.bus().gaps, report.bus().ticks_missing), (2, 5));
    assert_eq!(report.join.rows, import.log().rows.len());
}

#[test]
fn a_broken_line_is_refused_with_its_number_or_left_out() {
    let bus = candump(|_, _| false);
    let cut = bus.lines().nth(6).expect("a line").len() - 3;
    let mut lines: Vec<&str> = bus.lines().collect();
    lines[6] = &lines[6][..cut];
    let import = files(&lines.join("\n"), &reference());
    import.refused(|error| {
        matches!(
            error,
            JoinError::BadLine {
                line: 7,
                fault: LineError::Malformed { column: 30, .. },
                ..
            }
        )
    });
    let report = import
        .with(|settings| settings.bad_rows = BadRows::Skip)
        .run();
    assert_eq!(report.bus().bad_lines, 1);
}

#[test]
fn records_of_different_runs_and_clocks_are_refused() {
    let mut other = "movement,t_us,ifm_x_nm,ifm_y1_nm,ifm_y2_nm\n".to_owned();
    for k in 0..1_500 {
        writeln!(other, "0,{},{},5,{}", k * 1_000, k * 7 % 13, k * 3 % 7).expect("a string");
    }
    let import = files(&candump(|_, _| false), &other);
    import.refused(|error| matches!(error, JoinError::NoOffset { .. }));
}

/// It is read as every log is, without the columns of the probes.
#[test]
fn a_fault_of_the_reference_has_its_place() {
    let head = "movement,t_us,ifm_x_nm,ifm_y1_nm,ifm_y2_nm\n";
    for (reference, place) in [
        (head.replace(",ifm_y2_nm", ""), "ifm.csv:1: "),
        (head.to_owned(), "ifm.csv: fewer than two rows"),
        (
            format!("{head}0,0,1,2,3\n0,1000,1,x,3\n"),
            "ifm.csv:3: column 4 (ifm_y1_nm)",
        ),
    ] {
        let message = files(&candump(|_, _| false), &reference).refused(|_| true);
        let is_told = message.contains(place) && message.contains("; ");
        assert!(is_told, "{message}");
    }
    let spoilt = reference().replacen("0,50000,", "0,50000,x", 1);
    let import = files(&candump(|_, _| false), &spoilt);
    import.refused(|error| matches!(error, JoinError::Log(_)));
    let report = import
        .with(|settings| settings.bad_rows = BadRows::Skip)
        .run();
    assert_eq!((report.reference.bad, report.reference.gaps), (1, 1));
}

#[test]
fn a_record_without_sensor_frames_and_one_of_two_interfaces_are_refused() {
    let ifm = reference();
    let none = files("(1.000000) can0 123#00\n", &ifm);
    none.refused(|error| matches!(error, JoinError::NoTicks { frames: 1, .. }));
    let two = "(1.000000) can0 123#00\n(1.000000) can1 123#00\n";
    let two = files(two, &ifm);
    two.refused(|error| matches!(error, JoinError::SeveralInterfaces { line: 2, .. }));
    let no_file = files("", &ifm).with(|settings| settings.a = "/no/such/file".into());
    no_file.refused(|error| matches!(error, JoinError::Log(_)));
}

#[test]
fn movements_that_start_their_time_anew_follow_each_other_unless_the_bus_saw_a_pause() {
    let import = |pause_us| {
        let reference = reference_of(TICKS, 0.0, Some(pause_us));
        files(&candump(|_, _| false), &reference)
    };
    let report = import(0.0).run();
    assert_eq!(report.reference.restarts, 2);
    assert!(report.join.rows > 730);
    // No offset fits all movements.
    use JoinError::{Astray, NoOffset};
    import(150_000.0).refused(|error| matches!(error, Astray { .. } | NoOffset { .. }));
}
