//! A small simulated log for the tests of faults.

use super::signal_findings;
use hallstage_input::channel::Channel;
use hallstage_input::channels::columns;
use hallstage_input::dataset::Dataset;
use hallstage_input::finding::{Code, Finding, Severity};
use hallstage_input::shipped::stage;
use hallstage_simulate::assembly::Assembly;
use hallstage_simulate::protocol::Protocol;
use hallstage_simulate::random::{Purpose, Stream};
use hallstage_simulate::recording::{Recording, Sample, record};
use hallstage_simulate::sensors::SensorErrors;
use std::ops::Range;

/// Rows of each of its movements, and their servo period, s.
pub(super) const ROWS: usize = 2000;
pub(super) const PERIOD_S: f64 = 0.002;

/// Three movements of 4 s, all axes moving.
pub(super) fn recording() -> Recording {
    with_rests(0)
}

/// The same log, followed by `count` movements of a stage that stands still.
pub(super) fn with_rests(count: usize) -> Recording {
    let stage = stage();
    let mut run = Protocol::Combined.run(PERIOD_S, 3);
    run.movements.truncate(3);
    (run.movements.iter_mut()).for_each(|poses| poses.truncate(ROWS));
    let rest = vec![run.movements[0][0]; ROWS];
    run.movements.extend(std::iter::repeat_n(rest, count));
    let assembly = Assembly::draw(&stage, 3);
    record(&stage, &assembly, run, &SensorErrors::USUAL, 3).expect("clear")
}

/// The recording with one of the nine channels held at the value of the first row, over some rows of a movement, with
/// this part of its usual noise.
pub(super) fn held(
    recording: &Recording,
    channel: usize,
    movement: usize,
    rows: Range<usize>,
    noise: f64,
) -> Recording {
    let mut held = recording.clone();
    let mut random = Stream::new(7, Purpose::Sensors, channel as u64);
    let first = held.movements[movement][rows.start];
    for sample in &mut held.movements[movement][rows] {
        let mut codes = |deviation: f64| random.normal(deviation * noise).round();
        let k = channel % 3;
        match channel / 3 {
            0 => sample.hall[k] = first.hall[k] + codes(8.0) as i32,
            1 => sample.beams_nm[k] = first.beams_nm[k] + codes(5.0) as i64,
            _ => sample.capacitive[k] = first.capacitive[k] + codes(0.8) as i32,
        }
    }
    held
}

pub(super) fn dataset(recording: &Recording) -> Dataset {
    let mut dataset = recording.dataset(&stage()).expect("a triangle");
    let period_us = dataset.rows[1].t_us - dataset.rows[0].t_us;
    for row in &mut dataset.rows {
        row.frame = row.frame.with_sequence((row.t_us / period_us) as u32);
    }
    dataset
}

pub(super) fn found(dataset: &Dataset) -> Vec<Finding> {
    signal_findings(dataset, &stage(), &columns(dataset, &stage())).0
}

/// The warnings about a log.
pub(super) fn warnings(dataset: &Dataset) -> Vec<Finding> {
    let mut findings = found(dataset);
    findings.retain(|finding| finding.severity > Severity::Note);
    findings
}

/// The only warning about a recording, of this code and channel.
pub(super) fn only(recording: &Recording, code: Code, channel: Option<Channel>) -> Finding {
    let found = warnings(&dataset(recording));
    let [finding] = &found[..] else {
        panic!("{found:#?}");
    };
    let channels = finding.channels().first().copied();
    assert_eq!((finding.code(), channels), (code, channel));
    finding.clone()
}

/// Long rests beside three movements make no test of a gain or of hum more certain.
#[test]
fn rests_make_no_other_test_of_residuals_more_certain() {
    let found = found(&dataset(&with_rests(150)));
    let codes: Vec<Code> = found.iter().map(|finding| finding.code()).collect();
    assert_eq!(codes, [Code::IdleMovement], "{found:#?}");
}

/// In minutes the interferometers drift by more than a stage at rest moves.
#[test]
fn a_long_rest_is_idle_though_its_reference_drifts() {
    let mut recording = with_rests(1);
    let mut rest = Vec::new();
    for k in 0..40 {
        rest.extend(recording.movements[3].iter().map(|sample| Sample {
            t_us: sample.t_us + k * 2000 * ROWS as i64,
            beams_nm: sample.beams_nm.map(|nm| nm + 100 * k),
            ..*sample
        }));
    }
    recording.movements[3] = rest;
    only(&recording, Code::IdleMovement, None);
}

#[test]
fn a_sound_log_raises_no_warning_whole_or_thinned() {
    let recording = recording();
    assert_eq!(warnings(&dataset(&recording)), []);
    let mut thinned = recording;
    for samples in &mut thinned.movements {
        *samples = samples.iter().step_by(5).copied().collect();
    }
    assert_eq!(warnings(&dataset(&thinned)), []);
}
