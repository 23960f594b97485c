//! A recording as CSV: the log and the true poses.

use super::recording::Recording;
use hallstage_input::log::layout::Quantity;
use hallstage_input::log_format::LogFormat;
use hallstage_input::stage::Stage;
use runtime::frame::MISSING_CODE;
use std::fmt::Write;

/// The columns of a truth file.
pub const TRUTH_HEADER: &str = "movement,t_us,x_nm,y_nm,rz_nrad,z_nm,rx_nrad,ry_nrad";

/// The log, in the columns and units of the stage file, by default
/// `movement,t_us,ifm_x_nm,ifm_y1_nm,ifm_y2_nm,cap1_cnt,..,hall_a_cnt,..`. In a climate, the columns of
/// `[temperature]` follow.
pub fn log_csv(recording: &Recording, stage: &Stage) -> String {
    let first = recording.movements.iter().flatten().next();
    let in_climate = first.is_some_and(|sample| sample.temperature_mc != [MISSING_CODE; 2]);
    let format = LogFormat::new(Quantity::BEAMS, Quantity::GAPS, in_climate, stage);
    let mut text = format.header();
    text.reserve(64 * recording.rows());
    let per_nm = Quantity::BEAMS.map(|beam| 1e-9 / stage.log.column(beam).scale);
    for (movement, samples) in (0..).zip(&recording.movements) {
        for s in samples {
            let beams = [0, 1, 2].map(|i| s.beams_nm[i] as f64 * per_nm[i]);
            format.append(&mut text, (movement, s.t_us), beams, &s.codes(0).into());
        }
    }
    text
}

/// The true poses, to 0.01 nm and nrad.
pub fn truth_csv(recording: &Recording) -> String {
    let mut text = format!("{TRUTH_HEADER}\n");
    text.reserve(64 * recording.rows());
    let movements = recording.truth.iter().zip(&recording.movements);
    for (movement, (poses, samples)) in movements.enumerate() {
        for (pose, sample) in poses.iter().zip(samples) {
            let _ = write!(text, "{movement},{}", sample.t_us);
            pose.append_to(&mut text, 2);
            text.push('\n');
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pose::StagePose;
    use crate::recording::Sample;
    use hallstage_input::log::layout::Column;
    use hallstage_input::log::{ReadOptions, read_bytes};
    use hallstage_input::shipped::stage;

    fn recording() -> Recording {
        let sample = Sample {
            t_us: 0,
            beams_nm: [1, -2, 3],
            capacitive: [4, -5, 6],
            hall: [-7, 8, -9],
            temperature_mc: [MISSING_CODE; 2],
        };
        let later = Sample {
            t_us: 2000,
            ..sample
        };
        let pose = StagePose::from_array([1e-9, -2.346e-9, -1e-13, 1.5e-4, 0.0, 3e-7]);
        Recording {
            movements: vec![vec![sample, later], vec![sample]],
            truth: vec![vec![StagePose::default(), pose], vec![pose]],
        }
    }

    #[test]
    fn a_log_in_other_columns_and_units_reads_back() {
        let mut stage = stage();
        let mut recording = recording();
        recording.movements[0][1].temperature_mc = [20_348, MISSING_CODE];
        recording.movements[0][0].temperature_mc = [-40_001, 29_000];
        stage.temperature.columns = ["mount", "body"].map(|name| Some(name.to_owned()));
        stage.log.ignored = ["mount", "body"].map(str::to_owned).to_vec();
        stage.temperature.scale_mc = [1e3, -273_150.0];
        let mut set = |quantity, name: &str, scale| {
            let name = name.to_owned();
            stage.log.set(quantity, Column { name, scale });
        };
        set(Quantity::Movement, "#run, \"no.\"", 1.0);
        set(Quantity::Time, "time_ms", 1e3);
        set(Quantity::BeamX, "ifm_x_um", 1e-6);
        set(Quantity::HallA, "Hall A [V]", 1.0 / 3.125e-4);
        let csv = log_csv(&recording, &stage);
        let options = ReadOptions::default();
        let read = read_bytes(csv.as_bytes(), "log".as_ref(), &stage, &options);
        let rows = read.expect("a sound log").dataset.rows;
        assert_eq!((rows.len(), rows[1].t_us), (3, 2000));
        assert!((rows[2].reference[0] - 1e-9).abs() < 1e-20);
        assert_eq!(rows[2].frame.hall(), [-7, 8, -9]);
        let read = rows.iter().map(|row| row.frame.temperature_mc());
        let written = recording.movements.iter().flatten();
        assert!(read.eq(written.map(|sample| sample.temperature_mc)));
    }
}
