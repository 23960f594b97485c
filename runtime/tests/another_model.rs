//! A model is a type: one that the crate knows nothing of decodes through a servo as its own do.

use runtime::decoder::DecoderConstants;
use runtime::frame::CodeWindow;
use runtime::model::{Sensitivity, planar_pose, sensitivity_at, with_gain};
use runtime::real::Real;
use runtime::{
    Decode, Decoder, LinearModel, Model, OnInvalid, PlanarPose, PoseTracker, RawFrame, Reading,
    Status, Temperature, VerticalPose,
};

/// phi = eta + a Z + b Rx + c Ry + d Z^2.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Bent {}

#[derive(Clone, Copy, Debug, PartialEq)]
struct BentProbe<T> {
    linear: Sensitivity<T>,
    per_z2_m2: T,
}

impl Model for Bent {
    type Probe<T: Real> = BentProbe<T>;

    fn planar_pose<T: Real>(
        probes: &[BentProbe<T>; 3],
        pose_rows: &[[T; 3]; 3],
        signal: [T; 3],
        gain_change: [T; 3],
        vertical: &VerticalPose<T>,
        zero: &PlanarPose<T>,
    ) -> ([T; 3], PlanarPose<T>) {
        let z2 = vertical.z_m * vertical.z_m;
        let at = |p: &BentProbe<T>| sensitivity_at(&p.linear, vertical) + p.per_z2_m2 * z2;
        let phi = [0, 1, 2].map(|k| with_gain(at(&probes[k]), gain_change[k]));
        (phi, planar_pose(pose_rows, signal, phi, zero))
    }
}

/// One code is 10 nm of Hall displacement or gap; PM and the capacitive plane are the
/// simplest that there are.
const CONSTANTS: DecoderConstants<f32> = DecoderConstants {
    vertical_per_code: [[1e-8, 0.0, 0.0], [0.0, 1e-8, 0.0], [0.0, 0.0, 1e-8]],
    planar_per_code: [[1e-8, 0.0, 0.0], [0.0, 1e-8, 0.0], [0.0, 0.0, 1e-8]],
    calibrated_vertical: [1e-3; 3],
    calibrated_planar: [1e-3; 3],
    sensitivity_min: 0.1,
    hall_window: CodeWindow {
        low: -32767,
        high: 32766,
    },
    capacitive_window: CodeWindow {
        low: -32767,
        high: 32766,
    },
    temperature: Temperature::NONE,
};

const LINEAR: Sensitivity<f32> = Sensitivity {
    eta: 1.0,
    per_z_m: 1000.0,
    per_rx_rad: 0.0,
    per_ry_rad: 0.0,
};

const fn bent(per_z2_m2: f32) -> Decoder<Bent> {
    let probe = BentProbe {
        linear: LINEAR,
        per_z2_m2,
    };
    Decoder::new(CONSTANTS, [probe; 3])
}

/// At Z = 0.1 mm.
fn frame(sequence: u32) -> RawFrame {
    RawFrame::new([1000, -500, 250], [10_000, 0, 0], sequence, 0)
}

fn first_reading(decoder: &dyn Decode) -> Reading {
    PoseTracker::new(decoder, OnInvalid::Zero).tick(&frame(0))
}

#[test]
fn its_poses_are_those_of_its_own_equation() {
    // phi = 1 + 0.1 + 9e7 * 1e-8 = 2: half of what the codes say.
    let reading = first_reading(&bent(9e7));
    assert!(reading.status.is_good());
    for (have, want) in reading
        .pose
        .planar
        .to_array()
        .iter()
        .zip([5e-6, -2.5e-6, 1.25e-6])
    {
        assert!((have - want).abs() < 1e-12, "{have:e}");
    }
}

#[test]
fn without_its_further_term_it_gives_the_words_of_the_linear_model() {
    let linear = Decoder::<LinearModel>::new(CONSTANTS, [LINEAR; 3]);
    assert_eq!(first_reading(&bent(0.0)), first_reading(&linear));
    assert_ne!(first_reading(&bent(9e7)), first_reading(&linear));
}

#[test]
fn its_sensitivities_are_checked_as_those_of_every_model() {
    // phi = 1 + 0.1 - 1.05: below the smallest one.
    let reading = first_reading(&bent(-1.05e8));
    assert!(reading.status.any(Status::SENSITIVITY));
    assert_eq!(
        (reading.planar(), reading.pose.planar),
        (None, PlanarPose::ZERO)
    );
    assert!(reading.vertical().is_some());
}
