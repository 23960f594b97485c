//! On a stage made of physics: how far off it is in service after a change, and after what
//! recalibration makes of a few seconds.

use super::{Change, RecalibrateError, Recalibration, StoredPosterior, own_logs, recalibrate};
use crate::fit::{FitSettings, ModelChoice, fit};
use crate::judge::predicted::Predicted;
use crate::plan::run::PlannedRun;
use crate::service_for_tests::worst_ratio;
use hallstage_input::dataset::Dataset;
use hallstage_input::shipped::STAGE_TOML;
use hallstage_input::stage::Stage;
use hallstage_simulate::assembly::Assembly;
use hallstage_simulate::probe::TrimmedProbe;
use hallstage_simulate::protocol::{Run, Trajectory};
use hallstage_simulate::recording::record;
use hallstage_simulate::sensors::SensorErrors;
use hallstage_solver::estimator::model::Model;
use hallstage_solver::estimator::parameters::FieldParameters;
use hallstage_solver::estimator::terms::{PER_PROBE, THETA};
use nalgebra::Vector3;
use runtime::parameters::Text;
use runtime::{ModelKind, MotionCorrection, ParameterSet};

const SEED: u64 = 2;
const RUN: [f64; 6] = [5.0, 8.0, 7.0, 6.0, 4.0, 7.5];
/// Cycles of a run of two seconds.
const SINE_ALONG_Y: [f64; 6] = [0.0, 4.0, 0.0, 0.0, 0.0, 0.0];
const ALL_AXES: [f64; 6] = [3.0, 4.0, 5.0, 2.0, 3.5, 2.5];

/// A sine along each axis, with its number of cycles; an axis with 0 cycles stands still.
fn sines(seconds: f64, cycles: [f64; 6]) -> Trajectory {
    const AMPLITUDES: [f64; 6] = [500e-6, 800e-6, 500e-6, 240e-6, 480e-6, 480e-6];
    let amplitude = |k: usize| if cycles[k] > 0.0 { AMPLITUDES[k] } else { 0.0 };
    let run = PlannedRun {
        tones: [0.0; 6],
        seconds,
        taper_s: 0.5,
        amplitudes: std::array::from_fn(amplitude),
        cycles,
    };
    run.trajectory(0.002)
}

struct Old {
    stage: Stage,
    assembly: Assembly,
    set: ParameterSet,
    known: StoredPosterior,
}

impl Old {
    /// Fitted to a run of 8 s.
    fn new() -> Self {
        let stage = Stage::from_toml(STAGE_TOML, "stage.toml".as_ref()).expect("sound");
        let assembly = Assembly::draw(&stage, SEED);
        let settings = FitSettings::new(ModelChoice::Named(Model::from_kind(ModelKind::Field)));
        let dataset = log(&stage, &assembly, sines(8.0, RUN), SEED);
        let fit = fit(&dataset, &stage, &settings).expect("a fit");
        Self {
            known: StoredPosterior::from_fit(&fit).expect("of the field model"),
            set: ParameterSet {
                motion_correction: Some(MotionCorrection {
                    velocity_s: [[1e-4, 0.0, 0.0]; 3],
                    ..MotionCorrection::default()
                }),
                ..fit.set
            },
            stage,
            assembly,
        }
    }

    /// The stage with its probes (A is 0) changed.
    fn changed(&self, change: impl Fn(usize, TrimmedProbe) -> TrimmedProbe) -> Assembly {
        Assembly {
            probes: [0, 1, 2].map(|k| change(k, self.assembly.probes[k])),
        }
    }

    fn recalibrated(
        &self,
        now: &Assembly,
        run: (f64, [f64; 6]),
        change: Change,
    ) -> Result<Recalibration, RecalibrateError> {
        let dataset = log(&self.stage, now, sines(run.0, run.1), SEED + 100);
        let known = Some(&self.known);
        let new = recalibrate(&self.set, known, &dataset, &self.stage, change, Text::new())?;
        let kept = (self.set.motion_correction, self.set.layout_version());
        assert_eq!((new.set.motion_correction, new.set.layout_version()), kept);
        Ok(new)
    }

    /// Errors in service of the changed stage over the noise floor, worst axis: with the old blob
    /// and with the new one.
    fn ratios(&self, now: &Assembly, new: &Recalibration) -> [f64; 2] {
        [&self.set, &new.set].map(|set| {
            let parameters = FieldParameters::from_set(set, &self.stage).expect("a field model");
            worst_ratio(
                &parameters.constants(1.0).expect("sound"),
                now,
                SEED,
                [0, 1, 2].map(|axis| predicted(new).noise(axis)),
            )
        })
    }
}

fn predicted(new: &Recalibration) -> Predicted {
    new.diagnosis.predicted.expect("a service")
}

fn log(stage: &Stage, assembly: &Assembly, poses: Trajectory, seed: u64) -> Dataset {
    let run = Run::planned(poses);
    let recording = record(stage, assembly, run, &SensorErrors::USUAL, seed).expect("clear");
    recording.dataset(stage).expect("a plane")
}

fn seated(k: usize, probe: TrimmedProbe) -> TrimmedProbe {
    match k {
        0 => probe.reseated(Vector3::new(20e-6, 200e-6, 60e-6)),
        _ => probe,
    }
}

#[test]
fn service_is_back_at_the_noise_floor() {
    let old = Old::new();
    let weaker = old.changed(|_, probe| probe.with_gain(0.99));
    let lower = old.changed(|_, probe| {
        let probe = probe.with_gain(0.99);
        probe.reseated(Vector3::new(0.0, 0.0, 20e-6))
    });
    let one = old.changed(|k, probe| probe.with_gain([1.0, 0.99, 1.0][k]));
    let seated = old.changed(seated);
    for (now, run, change, before, after) in [
        (&weaker, (2.0, SINE_ALONG_Y), Change::Gain, 7.0, 1.02),
        (&lower, (2.0, SINE_ALONG_Y), Change::Gain, 9.0, 1.05),
        (&one, (2.0, ALL_AXES), Change::Gains, 4.0, 1.02),
        (&seated, (4.0, RUN), Change::All, 3.0, 1.06),
        (&seated, (8.0, RUN), Change::All, 3.0, 1.02),
    ] {
        let new = old.recalibrated(now, run, change);
        let new = new.unwrap_or_else(|error| panic!("{change:?} {run:?}: {error}"));
        let [with_old, with_new] = old.ratios(now, &new);
        assert!(with_old > before, "{change:?} {run:?}: {with_old}");
        assert!(with_new < after, "{change:?} {run:?}: {with_new}");
        let after = predicted(&new).worst_ratio();
        assert!((with_new - after).abs() < 0.03, "{with_new} {after}");
        let old = new.predicted_before.worst_ratio();
        assert!((with_old / old - 1.0).abs() < 0.2, "{with_old} {old}");
    }
}

#[test]
fn a_log_that_does_not_tell_the_change_is_refused() {
    let old = Old::new();
    let one = old.changed(|k, probe| probe.with_gain([1.0, 0.99, 1.0][k]));
    let seated = old.changed(seated);
    let not_carried =
        |error: &RecalibrateError| matches!(error, RecalibrateError::NotCarried { .. });
    let not_described =
        |error: &RecalibrateError| matches!(error, RecalibrateError::NotDescribed { .. });
    type Refusal = fn(&RecalibrateError) -> bool;
    for (now, run, change, refusal) in [
        (
            &one,
            (2.0, SINE_ALONG_Y),
            Change::Gains,
            not_carried as Refusal,
        ),
        (&seated, (2.0, ALL_AXES), Change::All, not_carried),
        (&seated, (8.0, SINE_ALONG_Y), Change::All, not_carried),
        (&one, (2.0, SINE_ALONG_Y), Change::Gain, not_described),
        (&seated, (8.0, RUN), Change::Gains, not_described),
    ] {
        let refused = old.recalibrated(now, run, change).expect_err("refused");
        assert!(refusal(&refused), "{change:?} {run:?}: {refused}");
    }
}

#[test]
fn where_gains_change_no_other_parameter_moves_and_the_posterior_has_its_errors() {
    let old = Old::new();
    let now = old.changed(|k, probe| probe.with_gain([1.0, 0.99, 1.0][k]));
    let new = old.recalibrated(&now, (2.0, ALL_AXES), Change::Gains);
    let new = new.expect("determined");
    let of = |set| FieldParameters::from_set(set, &old.stage).expect("a field model");
    let (before, after) = (of(&old.set), of(&new.set));
    let errors = |known: &StoredPosterior| known.covariance.diagonal().map(f64::sqrt);
    let errors = [&old.known, new.known.as_ref().expect("known")].map(errors);
    let only_gains = before.gain_change(new.gains.map(|(change, _)| change));
    let values = before.probes.iter().zip(&after.probes);
    let moved = values.flat_map(|(from, to)| from.iter().zip(to).map(|(from, to)| to - from));
    for (k, (moved, gains)) in moved.zip(only_gains).enumerate() {
        // The numbers of a blob are rounded.
        let rounding = 1e-6 * before.probes.as_flattened()[k].abs() + 1e-3 * errors[0][k];
        assert!((moved - gains).abs() < rounding, "{k}: {moved} {gains}");
    }
    // The gains are within their errors; the others are as unknown as before.
    for ((change, error), gain) in new.gains.into_iter().zip([1.0, 0.99, 1.0]) {
        assert!(
            (change + 1.0 - gain).abs() < 4.0 * error,
            "{change} {error}"
        );
    }
    let theta = (0..3).map(|probe| probe * PER_PROBE + THETA);
    for k in theta {
        let part = errors[1][k] / errors[0][k];
        assert!((0.9..1.1).contains(&part), "{k}: {part}");
    }
}

#[test]
fn a_log_or_an_excerpt_is_no_evidence_if_any_fit_before_has_used_it() {
    let old = Old::new();
    let logs = [SEED, 70, 71, 72].map(|seed| log(&old.stage, &old.assembly, sines(8.0, RUN), seed));
    let set = ParameterSet {
        logs_sha256: [1; 32],
        ..old.set.clone()
    };
    let own =
        |known: Option<&StoredPosterior>, log: &Dataset| !own_logs(&set, known, log).is_empty();
    // Rows of a log as another log, re-zeroed and with other times.
    let part = |log: &Dataset, first: usize, every: usize| {
        let rows = log.rows[first..].iter().step_by(every);
        let mut part = Dataset {
            rows: rows.copied().collect(),
            ..Dataset::default()
        };
        part.rows
            .iter_mut()
            .for_each(|row| row.t_us -= log.rows[first].t_us);
        part.end_log("part.csv");
        part
    };
    let known = old.known.clone().with_logs(&logs[0]).with_logs(&logs[1]);
    for (k, log) in logs.iter().enumerate() {
        for (first, every) in [(0, 1), (3600, 1), (0, 9)] {
            assert_eq!(
                own(Some(&known), &part(log, first, every)),
                k < 2,
                "{k} {first}"
            );
        }
    }
    assert!(!own(None, &part(&logs[0], 0, 1)));
    // Rows at rest, with codes that are all alike, mark nothing.
    let mut still = part(&logs[0], 0, 1);
    let frames: Vec<_> = still.rows.iter().take(20).map(|row| row.frame).collect();
    let rows = still.rows.iter_mut().zip(frames.iter().cycle());
    rows.for_each(|(row, frame)| row.frame = *frame);
    assert!(!own(Some(&old.known.clone().with_logs(&still)), &still));
}
