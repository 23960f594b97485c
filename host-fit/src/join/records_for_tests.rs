//! Records of a bus and of a reference with known clocks, and their join.

use super::*;
use hal_adapters::can::Layout;
use hal_adapters::can::{BusFrame, Coded, sensor};
use hal_adapters::candump::LogLine;
use hallstage_input::log::{self, ReadOptions};
use runtime::RawFrame;
use std::f64::consts::TAU;
use std::fmt::Write;
use tempfile::TempDir;

/// Time of the bus less time of the reference, us: the bus counts from 1970.
pub(super) const OFFSET_US: f64 = 1_735_270_496_123_456.0;
pub(super) const MOVEMENT_US: f64 = 500_000.0;
pub(super) const M_PER_CODE: f64 = 6.25e-8;
pub(super) const TICKS: u32 = 750;

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
pub(super) fn candump_with(
    skip: impl Fn(u32, usize) -> bool,
    hall: impl Fn(f64) -> [i32; 3],
) -> String {
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
