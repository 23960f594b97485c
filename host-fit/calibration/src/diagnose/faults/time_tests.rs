//! Channels and logs with wrong times.

use super::tests::{diagnosed, recording};
use crate::judge::verdict::Verdict;
use hallstage_input::channel::Channel;
use hallstage_input::finding::{Code, Finding};
use hallstage_simulate::recording::Sample;

/// Only Hall C senses X, so that it may be early as well.
#[test]
fn a_beam_along_x_that_lags_is_named_beside_the_probe_that_senses_x_and_taken_off() {
    let mut late = recording(3);
    for samples in &mut late.movements {
        let shown: Vec<i64> = samples.iter().map(|s| s.beams_nm[0]).collect();
        for (sample, shown) in samples.iter_mut().skip(3).zip(shown) {
            sample.beams_nm[0] = shown;
        }
    }
    let diagnosis = diagnosed(late, |_, _| {});
    let is_late = |found: &&Finding| found.code() == Code::ReferenceLag;
    let found = diagnosis.findings.iter().find(is_late).expect("a lag");
    assert_eq!(found.channels, [Channel::BeamX], "{found:#?}");
    assert_eq!(found.alike, [Channel::HallC], "{found:#?}");
    assert!((found.value().expect("ms") - 6.0).abs() < 0.2, "{found:?}");
    assert_eq!(diagnosis.verdict, Some(Verdict::Limited));
    assert!(diagnosis.repair.is_some());
}

/// A Hall probe a row late, gaps three, and a clock of the reference that ends two rows late.
#[test]
fn channels_that_are_late_and_a_clock_that_drifts_are_named_and_taken_off() {
    type Late = (&'static str, f64, fn(&mut Sample, [Sample; 4], f64));
    let cases: [Late; 3] = [
        ("hall_b", 2.0, |sample, [before, ..], _| {
            sample.hall[1] = before.hall[1]
        }),
        ("cap", 6.0, |sample, [.., before, _], _| {
            sample.capacitive = before.capacitive
        }),
        ("ifm", 4.0, |sample, [before, ..], part| {
            for (nm, before_nm) in sample.beams_nm.iter_mut().zip(before.beams_nm) {
                *nm -= (2.0 * part * (*nm - before_nm) as f64).round() as i64;
            }
        }),
    ];
    for (channel, late_ms, change) in cases {
        let mut late = recording(3);
        let (mut row, rows) = (0.0, late.rows() as f64);
        for samples in &mut late.movements {
            let shown = samples.clone();
            for (k, sample) in samples.iter_mut().enumerate() {
                let before = [1, 2, 3, 4].map(|rows| shown[k.saturating_sub(rows)]);
                change(sample, before, row / rows);
                row += 1.0;
            }
        }
        let diagnosis = diagnosed(late, |_, _| {});
        let is_late = |found: &&Finding| found.code() == Code::ReferenceLag;
        let found = diagnosis.findings.iter().find(is_late).expect("a lag");
        assert_eq!(found.channel().as_deref(), Some(channel), "{found:#?}");
        assert!(
            (found.value().expect("ms") - late_ms).abs() < 0.1 * late_ms,
            "{found:?}"
        );
        // A late sensor is late in service, too.
        let verdict = match channel {
            "ifm" => Verdict::Good,
            "cap" => Verdict::Refused,
            _ => Verdict::Limited,
        };
        assert_eq!(diagnosis.verdict, Some(verdict), "{channel}");
        let is_repaired = verdict != Verdict::Refused;
        assert_eq!(diagnosis.repair.is_some(), is_repaired, "{channel}");
    }
}

/// A row of the reference is lost, so that all later rows are a row early.
#[test]
fn a_lost_row_is_named_with_its_place_and_taken_off() {
    let mut lost = recording(3);
    for samples in &mut lost.movements[1..] {
        let shown: Vec<_> = samples.iter().map(|sample| sample.beams_nm).collect();
        for (sample, next) in samples.iter_mut().zip(&shown[1..]) {
            sample.beams_nm = *next;
        }
    }
    let diagnosis = diagnosed(lost, |_, _| {});
    assert_eq!(diagnosis.verdict, Some(Verdict::Good));
    let found = &diagnosis.findings[0];
    assert_eq!(
        (found.code(), found.channel().as_deref(), found.movement()),
        (Code::ReferenceLag, Some("ifm"), Some("1")),
        "{found:#?}"
    );
    assert!((found.value().expect("ms") + 2.0).abs() < 0.1, "{found:?}");
    assert!(diagnosis.repair.is_some());
}
