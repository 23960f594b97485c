//! A run that shows lags and accelerations, then fast moves: the forecast, and the errors after the correction.

use crate::diagnose::{Diagnosis, diagnose_log};
use crate::fit::{Fit, FitSettings, ModelChoice, fit};
use crate::judge::verdict::Verdict;
use crate::judge::{Decoded, Zeros};
use crate::plan::run::PlannedRun;
use hallstage_input::dataset::Dataset;
use hallstage_input::finding::{Code, Finding};
use hallstage_input::shipped::stage;
use hallstage_input::stage::Stage;
use hallstage_simulate::dynamics::MotionEffects;
use hallstage_simulate::protocol::{Protocol, Run};
use hallstage_simulate::recording::record_stage;
use hallstage_solver::estimator::rows::measured_motion;
use runtime::CommandedMotion;

const SEED: u64 = 7;

/// A run of two tones, over the whole range of service.
fn two_tones(stage: &Stage) -> Run {
    let run = PlannedRun {
        seconds: 30.0,
        taper_s: 0.5,
        amplitudes: stage.motion.axes.map(|axis| axis.service),
        cycles: [5.0, 8.0, 6.0, 7.0, 4.0, 3.0],
        tones: [0.0; 6],
    };
    let run = run.with_tones(&stage.motion);
    Run::planned(run.trajectory(stage.servo_period_s))
}

/// A stage with these effects, with the motion of its fast moves declared for service: fit, diagnosis and the log of
/// these moves.
fn calibrated(dynamics: MotionEffects) -> (Stage, Fit, Diagnosis, Dataset) {
    let mut stage = stage();
    let period_s = stage.servo_period_s;
    let log = |run| {
        let recording = record_stage(&stage, run, None, dynamics, SEED).expect("clear");
        recording.dataset(&stage).expect("a triangle")
    };
    let run = log(two_tones(&stage));
    let fast = log(Protocol::Fast.run(period_s, SEED));
    let motion = measured_motion(&fast, &vec![true; fast.rows.len()]);
    let rms = |of: &dyn Fn(&CommandedMotion) -> f32| {
        let squares = motion.iter().map(|row| f64::from(of(row)).powi(2));
        (squares.sum::<f64>() / motion.len() as f64).sqrt()
    };
    for (axis, motion) in stage.motion.axes.iter_mut().enumerate() {
        motion.service_acceleration_rms = rms(&|row| row.acceleration[axis]);
        if axis < 3 {
            motion.service_speed_rms = rms(&|row| row.velocity[axis]);
        }
    }
    let fitted = fit(&run, &stage, &FitSettings::new(ModelChoice::Auto)).expect("a fit");
    let diagnosis = diagnose_log(&run, &stage, Ok(&fitted));
    (stage, fitted, diagnosis, fast)
}

/// Errors of the fast moves, rms, as decoded and corrected.
fn errors(stage: &Stage, fit: &Fit, fast: &Dataset) -> [[f64; 3]; 2] {
    let decoded = Decoded::new(&fit.set, fast);
    let correction = fit.set.motion_correction.expect("a correction");
    [decoded.corrected(&correction, fast), decoded].map(|decoded| {
        let errors = decoded.judge(fast, stage, Zeros::None).errors;
        errors.axes.map(|axis| axis.rms)
    })
}

#[test]
fn late_probes_arms_that_bend_and_coils_are_found_forecast_and_corrected() {
    let (stage, sound, diagnosis, fast) = calibrated(MotionEffects::NONE);
    let [corrected, floor] = errors(&stage, &sound, &fast);
    assert_eq!(diagnosis.verdict, Some(Verdict::Good));
    for axis in 0..3 {
        let cost = corrected[axis] / floor[axis];
        assert!((0.99..1.005).contains(&cost), "{axis}: {cost}");
    }
    for (lags_s, coil_m, arm_hz) in [
        ([3e-4, -3e-4, 0.0], None, Some(120.0)),
        ([0.0; 3], Some(0.05), None),
    ] {
        let dynamics = MotionEffects::draw(lags_s, coil_m, arm_hz, SEED);
        let (stage, bent, diagnosis, fast) = calibrated(dynamics);
        for (found_s, lag_s) in bent.estimate.motion.dynamics.probe_lag_s.iter().zip(lags_s) {
            assert!((found_s - lag_s).abs() < 10e-6, "{found_s} {lag_s}");
        }
        assert_eq!(diagnosis.verdict, Some(Verdict::Limited));
        assert_eq!(diagnosis.findings[0].code(), Code::Motion);
        let forecast = diagnosis.predicted.expect("figures").ratio;
        let [corrected, decoded] = errors(&stage, &bent, &fast);
        for axis in 0..3 {
            let [left, ratio] = [corrected[axis], decoded[axis]].map(|rms| rms / floor[axis]);
            assert!(
                (forecast[axis] / ratio - 1.0).abs() < 0.1,
                "{forecast:?} {axis} {ratio}"
            );
            assert!(left < 1.03, "{axis}: {left}");
        }
        let expected = diagnosis.motion.expect("figures").corrected_ratio;
        assert!((0.99..1.03).contains(&expected), "{expected}");
        let correction = bent.set.motion_correction.expect("a correction");
        let row = fast.rows.len() / 2;
        let mut spiked = fast.clone();
        spiked.rows[row].reference[0] += 1e-3;
        let [mut sound, mut bent] = [&fast, &spiked].map(|log| {
            let decoded = Decoded::new(&bent.set, log);
            decoded.corrected(&correction, log).errors
        });
        (sound[row], bent[row]) = (None, None);
        for (sound, bent) in sound.iter().flatten().zip(bent.iter().flatten()) {
            let off = (0..3).map(|axis| (sound[axis] - bent[axis]).abs());
            assert!(off.fold(0.0, f64::max) < 1e-6, "{sound:?} {bent:?}");
        }
    }
}

#[test]
fn probes_that_are_late_by_the_same_time_are_told_with_their_cost() {
    let calibrated = [[0.0; 3], [1.8e-4; 3]].map(|lags_s| {
        let (stage, fit, diagnosis, fast) =
            calibrated(MotionEffects::draw(lags_s, None, None, SEED));
        (errors(&stage, &fit, &fast)[1], diagnosis)
    });
    let [(floor, sound), (late, diagnosis)] = calibrated;
    assert!(sound.findings.is_empty(), "{:?}", sound.findings);
    assert_eq!(diagnosis.verdict, Some(Verdict::Limited));
    let [found] = diagnosis.findings.as_slice() else {
        panic!("{:?}", diagnosis.findings);
    };
    assert_eq!(found.code(), Code::ReferenceLag);
    let worst = (0..3)
        .map(|axis| late[axis] / floor[axis])
        .fold(0.0, f64::max);
    let cost = found.cost.expect("a cost");
    assert!((cost / worst - 1.0).abs() < 0.1, "{cost} {worst}");
}

#[test]
fn one_late_probe_is_named_stays_late_in_service_and_is_corrected() {
    let (stage, sound, _, fast) = calibrated(MotionEffects::NONE);
    let [_, floor] = errors(&stage, &sound, &fast);
    let (stage, late, diagnosis, fast) =
        calibrated(MotionEffects::draw([1e-3, 0.0, 0.0], None, None, SEED));
    let codes: Vec<Code> = diagnosis.findings.iter().map(Finding::code).collect();
    assert_eq!(codes, [Code::Motion, Code::ReferenceLag]);
    let named = crate::words::message(&diagnosis.findings[1]);
    assert!(
        named.contains("In service the channel stays late"),
        "{named}"
    );
    assert_eq!(diagnosis.verdict, Some(Verdict::Limited));
    // The two other probes keep their time.
    let [corrected, _] = errors(&stage, &late, &fast);
    for axis in 0..3 {
        let cost = corrected[axis] / floor[axis];
        assert!(cost < 1.03, "{axis}: {cost}");
    }
}
