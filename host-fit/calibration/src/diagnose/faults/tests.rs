//! Faults of known size in simulated logs, and logs without any.

use super::effects::Effects;
use super::estimate::Estimate;
use super::means::Means;
use super::score::Scan;
use crate::diagnose::{Diagnosis, diagnose_log};
use crate::fit::{FitSettings, ModelChoice, fit};
use crate::judge::verdict::Verdict;
use crate::judge::verdict::severity;
use hallstage_input::channel::Channel;
use hallstage_input::dataset::Dataset;
use hallstage_input::finding::{Code, Finding, Kind, Severity};
use hallstage_input::shipped::stage;
use hallstage_simulate::assembly::Assembly;
use hallstage_simulate::protocol::Protocol;
use hallstage_simulate::random::{Purpose, Stream};
use hallstage_simulate::recording::{Recording, Sample, record};
use hallstage_simulate::sensors::SensorErrors;
use hallstage_solver::estimator::parameters::FieldParameters;

/// Three movements of 8 s, all axes moving.
pub(super) fn recording(seed: u64) -> Recording {
    let stage = stage();
    let mut run = Protocol::Combined.run(stage.servo_period_s, seed);
    run.movements.truncate(3);
    let assembly = Assembly::draw(&stage, seed);
    record(&stage, &assembly, run, &SensorErrors::USUAL, seed).expect("clear")
}

/// The diagnosis of the first rows of a recording.
fn diagnosis_of_start(recording: &Recording, rows: usize) -> Diagnosis {
    let stage = stage();
    let mut recording = recording.clone();
    recording.movements.truncate(1);
    recording.movements[0].truncate(rows);
    let dataset = recording.dataset(&stage).expect("a triangle");
    let fitted = fit(&dataset, &stage, &FitSettings::new(ModelChoice::Auto));
    diagnose_log(&dataset, &stage, fitted.as_ref())
}

#[test]
fn a_short_log_is_never_good_and_refused_where_it_leaves_the_field_model_open() {
    let short = diagnosis_of_start(&recording(3), 1000);
    assert!(matches!(
        short.verdict,
        Some(Verdict::Limited | Verdict::Refused)
    ));
    assert!(short.predicted.expect("figures").worst_ratio() > 5.0);
    let longer = diagnosis_of_start(&recording(4), 2000);
    assert_eq!(longer.verdict, Some(Verdict::Refused));
    assert_eq!(longer.findings[0].code(), Code::NotDetermined);
}

/// Offsets within a movement, steps to the end and ramps, of channels of all kinds.
#[test]
fn what_the_scan_promises_is_what_a_refit_gains() {
    let stage = stage();
    let dataset = changed(recording(3), |sample, is_second| {
        sample.hall[1] = gain(sample.hall[1], 0.3);
        sample.beams_nm[0] += if is_second { 3000 } else { 0 };
    });
    let fitted = fit(&dataset, &stage, &FitSettings::new(ModelChoice::Auto)).expect("a fit");
    let parameters = fitted.estimate.parameters;
    let means = Means::new(&dataset, &stage, &parameters, false);
    let estimate = Estimate::new(&means, &parameters, &[]).expect("one");
    let effects = Effects::new(&means, &stage, &estimate.parameters, estimate.lag_s());
    let candidates = Scan::new(&effects, &estimate).expect("one").faults(true);
    let large = candidates.iter().filter(|candidate| candidate.gain > 300.0);
    assert!(large.clone().count() > 10);
    let motion = large.clone().filter(|of| of.suspect.quantity().is_none());
    assert!(motion.count() > 0);
    for candidate in large {
        let column = effects.shaped(candidate.suspect, candidate.shape);
        let with = estimate.with_faults(&means, &[column]).expect("one");
        let gain = estimate.chi_squared - with.chi_squared;
        assert!(
            (gain / candidate.gain - 1.0).abs() < 0.1,
            "{gain} {candidate:?}"
        );
    }
}

/// What is found in a recording, with a change of the samples from the middle of the second movement on.
fn found(recording: Recording, change: impl Fn(&mut Sample, bool)) -> Vec<Finding> {
    diagnosed(recording, change).findings
}

pub(super) fn diagnosed(recording: Recording, change: impl Fn(&mut Sample, bool)) -> Diagnosis {
    let (stage, dataset) = (stage(), changed(recording, change));
    let fitted = fit(&dataset, &stage, &FitSettings::new(ModelChoice::Auto));
    diagnose_log(&dataset, &stage, fitted.as_ref())
}

fn changed(mut recording: Recording, change: impl Fn(&mut Sample, bool)) -> Dataset {
    let middle = recording.movements[1].len() / 2;
    for (movement, samples) in recording.movements.iter_mut().enumerate() {
        for (row, sample) in samples.iter_mut().enumerate() {
            if (movement, row) >= (1, middle) {
                change(sample, movement == 1);
            }
        }
    }
    recording.dataset(&stage()).expect("a triangle")
}

fn gain(code: i32, percent: f64) -> i32 {
    (f64::from(code) * (1.0 + percent / 100.0)).round() as i32
}

#[test]
fn a_clean_log_raises_nothing_above_a_note() {
    for seed in [3, 4] {
        let found = found(recording(seed), |_, _| {});
        assert!(
            found.iter().all(|f| f.severity == Severity::Note),
            "{found:#?}"
        );
    }
}

/// The finding has its original cost, and the calibration has the gain at the end.
#[test]
fn a_gain_that_changes_is_named_with_channel_onset_size_and_cost_and_taken_off() {
    let (stage, sound) = (stage(), recording(3).dataset(&stage()).expect("a triangle"));
    let sound = fit(&sound, &stage, &FitSettings::new(ModelChoice::Auto)).expect("a fit");
    for percent in [0.3, 1.0, 3.0] {
        let diagnosis = diagnosed(recording(3), |sample, _| {
            sample.hall[1] = gain(sample.hall[1], percent)
        });
        let first = &diagnosis.findings[0];
        assert_eq!(
            (first.code(), first.channel().as_deref()),
            (Code::GainDrift, Some("hall_b"))
        );
        assert_eq!(
            (first.movement(), first.severity),
            (Some("1"), Severity::Warn),
            "{first:#?}"
        );
        assert!(
            (first.t_us().expect("a time") - 4_000_000).abs() < 500_000,
            "{first:?}"
        );
        assert!(
            (first.value().expect("a size") / percent - 1.0).abs() < 0.1,
            "{first:?}"
        );
        assert_eq!(severity(first.cost.expect("a cost")), Severity::Refuse);
        assert_eq!(diagnosis.verdict, Some(Verdict::Good));
        let repair = diagnosis.repair.expect("a repair");
        let eta = |parameters: &FieldParameters| parameters.model_31().eta()[1];
        let before = &sound.estimate.parameters;
        let change = 100.0 * (eta(&repair.parameters) / eta(before) - 1.0);
        assert!((change - percent).abs() < 0.05, "{change}");
    }
}

#[test]
fn causes_that_a_log_cannot_tell_apart_are_named_together() {
    let found = found(recording(3), |sample, _| {
        sample.hall = sample.hall.map(|code| gain(code, -1.0))
    });
    let causes = (&found[0].channels[..], &found[0].alike[..]);
    let mut both = [causes.0, causes.1].concat();
    both.sort_unstable();
    assert_eq!(both, [Channel::Halls, Channel::Beams], "{found:#?}");
    assert_eq!(
        (found[0].channel().as_deref(), found[0].severity),
        (None, Severity::Refuse)
    );
}

/// Its slow lines are in the means over a few rows, where the end of a log can take them for anything.
#[test]
fn hum_is_not_taken_for_another_fault() {
    let codes = 2e-6 / stage().hall.m_per_count;
    for (seed, hertz) in [(3, 7.0), (4, 7.0), (3, 12.0), (4, 12.0)] {
        let mut hums = recording(seed);
        for sample in hums.movements.iter_mut().flatten() {
            let phase = std::f64::consts::TAU * hertz * sample.t_us as f64 * 1e-6;
            sample.hall[0] += (codes * libm::sin(phase)).round() as i32;
        }
        let diagnosis = diagnosed(hums, |_, _| {});
        let is_fault =
            |f: &&Finding| matches!(f.code(), Code::GainDrift | Code::Step | Code::LogsDisagree);
        assert_eq!(
            diagnosis.findings.iter().find(is_fault),
            None,
            "{seed} {hertz}"
        );
    }
}

/// At rest near zero a signal is all noise, which a gain of -100 % would explain.
#[test]
fn a_log_that_ends_at_rest_is_sound() {
    let stage = stage();
    let mut run = Protocol::Combined.run(stage.servo_period_s, 3);
    run.movements.truncate(2);
    for movement in &mut run.movements {
        // Backwards it ends where it began, at zero.
        movement.reverse();
        movement.resize(movement.len() + 500, movement[movement.len() - 1]);
    }
    let assembly = Assembly::draw(&stage, 3);
    let rests = record(&stage, &assembly, run, &SensorErrors::USUAL, 3).expect("clear");
    let diagnosis = diagnosed(rests, |_, _| {});
    assert_eq!(diagnosis.findings, []);
    assert_eq!(diagnosis.verdict, Some(Verdict::Good));
}

/// Steps can follow it, but between them the gain is not theirs: they leave too much for a cause.
#[test]
fn a_gain_that_rises_and_falls_smoothly_is_unexplained_and_not_taken_off() {
    let mut rises = recording(3);
    for samples in &mut rises.movements {
        let count = samples.len() as f64;
        for (row, sample) in samples.iter_mut().enumerate() {
            let phase = std::f64::consts::TAU * row as f64 / count;
            sample.hall[1] = gain(sample.hall[1], 1.0 - libm::cos(phase));
        }
    }
    let diagnosis = diagnosed(rises, |_, _| {});
    let first = &diagnosis.findings[0];
    assert_eq!((first.code(), first.channel()), (Code::ModelLacks, None));
    assert!(diagnosis.repair.is_none());
    assert_eq!(diagnosis.verdict, Some(Verdict::Refused));
}

/// Of Hall A by 50 um and of Hall C by -25 um.
#[test]
fn channels_that_step_together_are_one_event() {
    let diagnosis = diagnosed(recording(3), |sample, _| {
        sample.hall[0] += 800;
        sample.hall[2] -= 400;
    });
    let is_step = |found: &&Finding| found.code() == Code::Step;
    let steps: Vec<&Finding> = diagnosis.findings.iter().filter(is_step).collect();
    assert_eq!(steps.len(), 1, "{steps:#?}");
    assert_eq!(steps[0].channel().as_deref(), Some("hall_a, hall_c"));
    let size_um = steps[0].value().expect("um");
    assert!((size_um - 50.0).abs() < 1.0, "{size_um}");
    assert_eq!(diagnosis.verdict, Some(Verdict::Good));
}

#[test]
fn a_probe_that_becomes_noisy_is_not_taken_for_one_whose_gain_changes() {
    let codes = 3e-6 / stage().hall.m_per_count;
    for seed in [6, 7, 9, 11] {
        let random = std::cell::RefCell::new(Stream::new(seed, Purpose::Sensors, 0));
        let found = found(recording(seed), |sample, is_second| {
            if !is_second {
                sample.hall[1] += random.borrow_mut().normal(codes).round() as i32;
            }
        });
        let is_change = |found: &Finding| matches!(found.kind, Kind::Change { .. });
        assert!(!found.iter().any(is_change), "{seed}: {found:#?}");
    }
}

/// The fit holds these rows; the calibration is without them.
#[test]
fn rows_in_which_a_gap_repeats_its_code_bend_no_calibration() {
    let mut stands = recording(3);
    let held = stands.movements[1][1000].capacitive[2];
    for sample in &mut stands.movements[1][1000..1600] {
        sample.capacitive[2] = held;
    }
    let diagnosis = diagnosed(stands, |_, _| {});
    let stuck = diagnosis.findings.iter().find(|f| f.code() == Code::Stuck);
    let stuck = stuck.expect("a finding");
    assert_eq!(stuck.channel().as_deref(), Some("cap_3"));
    assert!(diagnosis.repair.is_some());
    assert!(diagnosis.repaired().eq([stuck]));
    assert_eq!(diagnosis.verdict, Some(Verdict::Good));
}

/// A step of 25 um, 10 um, 5 um: at the probe, the gap and the beam. That of a beam ends with its movement.
#[test]
fn a_step_of_a_channel_is_named_and_that_of_a_probe_taken_off() {
    type Step = (&'static str, Severity, fn(&mut Sample, bool));
    let steps: [Step; 3] = [
        ("hall_a", Severity::Note, |sample, _| sample.hall[0] += 400),
        ("cap_2", Severity::Refuse, |sample, _| {
            sample.capacitive[1] += 640
        }),
        ("ifm_y1", Severity::Note, |sample, is_second| {
            sample.beams_nm[1] += 5000 * i64::from(is_second)
        }),
    ];
    for (channel, least, change) in steps {
        let diagnosis = diagnosed(recording(4), change);
        let is_step = |f: &&Finding| f.code() == Code::Step;
        let step = diagnosis.findings.iter().find(is_step).expect("a step");
        assert_eq!(step.channel().as_deref(), Some(channel));
        assert!(severity(step.cost.unwrap_or(1.0)) >= least, "{step:?}");
        match channel {
            "hall_a" => assert_eq!(diagnosis.verdict, Some(Verdict::Good)),
            "ifm_y1" => assert!((step.value().expect("um") - 5.0).abs() < 1.0, "{step:?}"),
            _ => assert_eq!(diagnosis.findings[0].code(), Code::Step),
        }
    }
}

#[test]
fn another_stage_from_a_movement_on_is_refused() {
    let (first, mut second) = (recording(3), recording(4));
    second.movements[0].clone_from(&first.movements[0]);
    let found = found(second, |_, _| {});
    let first = &found[0];
    assert_eq!(
        (first.code(), first.severity),
        (Code::LogsDisagree, Severity::Refuse),
        "{found:#?}"
    );
    assert_eq!(first.movement(), Some("1"));
}
