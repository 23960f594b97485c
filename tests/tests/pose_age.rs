//! The errors in service of a pose with an age, raw and predicted: the figures of the runtime's README.

use host_fit::calibration::fit::{FitSettings, ModelChoice, fit};
use host_fit::input::shipped;
use host_fit::simulate::assembly::Assembly;
use host_fit::simulate::protocol::Protocol;
use host_fit::simulate::recording::{Recording, Sample, record};
use host_fit::simulate::sensors::SensorErrors;
use host_fit::solver::estimator::model::Model;
use runtime::{ModelKind, OnInvalid, ParameterSet, PoseTracker, Predictor, RawFrame};

/// The simulated stage, with magnets as designed.
const SEED: u64 = 2;
const PERIOD_US: u32 = 2_000;

/// Age (us), rms error of X, Y, Rz (um, um, urad), raw and predicted.
const DOCUMENTED: [(u32, [f64; 3], [f64; 3]); 6] = [
    (0, [1.08, 0.44, 2.47], [1.08, 0.44, 2.47]),
    (150, [1.09, 0.55, 2.48], [1.08, 0.44, 2.49]),
    (300, [1.14, 0.80, 2.50], [1.09, 0.44, 2.50]),
    (500, [1.25, 1.20, 2.54], [1.10, 0.45, 2.52]),
    (1_000, [1.64, 2.28, 2.75], [1.12, 0.48, 2.58]),
    (2_000, [2.70, 4.50, 3.44], [1.18, 0.58, 2.70]),
];

/// The pose of the stage at an age after a sample, by the cubic through the sample before and the two after: they
/// are 2 ms apart, and the motion is slow.
fn truth_at(truth: &[[f64; 3]], sample: usize, age_us: u32) -> [f64; 3] {
    let x = f64::from(age_us) / f64::from(PERIOD_US);
    let weights = [
        -x * (x - 1.0) * (x - 2.0) / 6.0,
        (x + 1.0) * (x - 1.0) * (x - 2.0) / 2.0,
        -(x + 1.0) * x * (x - 2.0) / 2.0,
        (x + 1.0) * x * (x - 1.0) / 6.0,
    ];
    [0, 1, 2].map(|axis| {
        let poses = truth[sample - 1..sample + 3].iter().zip(weights);
        poses.map(|(pose, weight)| weight * pose[axis]).sum()
    })
}

/// Adds the squared errors of a movement's poses at an age, raw and predicted; gives their number.
fn add_squares(
    set: &ParameterSet,
    samples: &[Sample],
    truth: &[[f64; 3]],
    age_us: u32,
    sums: &mut [[f64; 3]; 2],
) -> usize {
    let decoder = set.decoder();
    let mut tracker = PoseTracker::new(decoder, OnInvalid::Zero);
    let mut predictor = Predictor::new(4_000);
    let mut count = 0;
    for (k, sample) in samples[..samples.len() - 2].iter().enumerate() {
        let frame = RawFrame::new(sample.hall, sample.capacitive, k as u32, sample.t_us as u32);
        let reading = tracker.tick(&frame);
        predictor.take(&tracker, &frame, &reading);
        let Some(predicted) = predictor.pose_at(frame.time_us + age_us) else {
            continue;
        };
        let truth = truth_at(truth, k, age_us);
        for (sums, pose) in sums.iter_mut().zip([reading.pose.planar, predicted]) {
            for ((sum, q), truth) in sums.iter_mut().zip(pose.to_array()).zip(truth) {
                *sum += (f64::from(q) - truth).powi(2);
            }
        }
        count += 1;
    }
    count
}

#[test]
fn the_errors_of_an_age_are_those_of_the_readme_raw_and_predicted() {
    let stage = shipped::stage();
    let assembly = Assembly::draw(&stage, SEED);
    let recorded = |protocol: Protocol| -> Recording {
        let run = protocol.run(stage.servo_period_s, SEED);
        record(&stage, &assembly, run, &SensorErrors::USUAL, SEED).expect("within the gaps")
    };
    let field = FitSettings::new(ModelChoice::Named(Model::from_kind(ModelKind::Field)));
    let log = recorded(Protocol::Combined)
        .dataset(&stage)
        .expect("a sound stage");
    let set = fit(&log, &stage, &field).expect("a fit").set;
    let service = recorded(Protocol::Service);
    for (age_us, as_is, predicted) in DOCUMENTED {
        let (mut sums, mut count) = ([[0.0; 3]; 2], 0);
        for (samples, truth) in service.movements.iter().zip(&service.truth) {
            let truth: Vec<_> = truth.iter().map(|pose| pose.planar).collect();
            count += add_squares(&set, samples, &truth, age_us, &mut sums);
        }
        let rms = sums.map(|sums| sums.map(|sum| (sum / count as f64).sqrt() * 1e6));
        for (rms, documented) in rms
            .as_flattened()
            .iter()
            .zip([as_is, predicted].as_flattened())
        {
            assert!(
                (rms - documented).abs() < 0.006,
                "{age_us} us: {rms:.2?} {rms} where {documented} is documented"
            );
        }
    }
}
