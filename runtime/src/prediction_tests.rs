//! Tests of the prediction: against `f64` least squares, and of what is refused.

use super::*;
use crate::pose::Pose;
use crate::sample;
use crate::status::Status;
use crate::tracker::OnInvalid;
use proptest::prelude::*;
use std::vec::Vec;

extern crate std;

const AGE_MAX_US: u16 = 4_000;

fn frame(time_us: u32) -> RawFrame {
    RawFrame::new([0; 3], [0; 3], 0, time_us)
}

fn reading(pose: [f32; 3]) -> Reading {
    Reading {
        pose: Pose {
            planar: PlanarPose::from_array(pose),
            ..Pose::default()
        },
        status: Status::GOOD,
    }
}

/// A predictor that has taken poses, each with its time.
fn fed(samples: &[(u32, [f32; 3])]) -> Predictor {
    let decoder = sample::parameters().decoder();
    let tracker = PoseTracker::new(decoder, OnInvalid::Zero);
    let mut predictor = Predictor::new(AGE_MAX_US);
    for (time_us, pose) in samples {
        predictor.take(&tracker, &frame(*time_us), &reading(*pose));
    }
    predictor
}

/// Eight poses 2 ms apart, the last at `end_us`.
fn every_2_ms(end_us: u32, pose_at: impl Fn(usize) -> [f32; 3]) -> Vec<(u32, [f32; 3])> {
    let time_us = |k: usize| end_us.wrapping_sub(2_000 * (7 - k as u32));
    (0..8).map(|k| (time_us(k), pose_at(k))).collect()
}

/// Times from any start on, at steps up to the largest age, and poses within a stage's range.
fn walks() -> impl Strategy<Value = Vec<(u32, [f32; 3])>> {
    let step = (
        1..=u32::from(AGE_MAX_US),
        prop::array::uniform3(-6e-4f32..6e-4),
    );
    (any::<u32>(), prop::collection::vec(step, 8..20)).prop_map(|(start, steps)| {
        let mut time_us = start;
        let walk = steps.into_iter().map(|(step_us, pose)| {
            time_us = time_us.wrapping_add(step_us);
            (time_us, pose)
        });
        walk.collect()
    })
}

proptest! {
    #[test]
    fn it_is_the_least_squares_slope_of_the_last_eight_poses(walk in walks(), age_us in 0..=4_000u32) {
        let last = &walk[walk.len() - 8..];
        let (end_us, newest) = last[7];
        let predictor = fed(&walk);
        let at_end = predictor.pose_at(end_us).expect("poses in a row");
        prop_assert_eq!(at_end.to_array().map(f32::to_bits), newest.map(f32::to_bits));
        let got = predictor.pose_at(end_us.wrapping_add(age_us)).expect("poses in a row");
        let t: Vec<f64> = last.iter().map(|(t, _)| -f64::from(end_us.wrapping_sub(*t))).collect();
        let mean = t.iter().sum::<f64>() / 8.0;
        let squares: f64 = t.iter().map(|t| (t - mean) * (t - mean)).sum();
        for (axis, got) in got.to_array().into_iter().enumerate() {
            let products = t.iter().zip(last).map(|(t, (_, q))| (t - mean) * f64::from(q[axis]));
            let carried = f64::from(age_us) * products.sum::<f64>() / squares;
            let want = f64::from(newest[axis]) + carried;
            let size = 1e-3 + carried.abs();
            prop_assert!((f64::from(got) - want).abs() < 1e-6 * size, "{got:e}, {want:e}");
        }
    }

    #[test]
    fn invalid_and_held_poses_change_nothing(walk in walks(), bad in prop::array::uniform3(any::<f32>()), held: bool) {
        let decoder = sample::parameters().decoder();
        let tracker = PoseTracker::new(decoder, OnInvalid::Zero);
        let mut predictor = fed(&walk);
        let before = predictor;
        let time_us = walk[walk.len() - 1].0.wrapping_add(1);
        let marks = if held { Status::PLANAR_HELD } else { Status::GOOD };
        let invalid = Reading { status: Status::PLANAR_INVALID.with(marks), ..reading(bad) };
        predictor.take(&tracker, &frame(time_us), &invalid);
        prop_assert_eq!(predictor, before);
    }

    #[test]
    fn whatever_the_poses_the_result_is_finite(
        poses in prop::array::uniform8(prop::array::uniform3(-f32::MAX..=f32::MAX)),
        age_us: u32,
    ) {
        let predicted = fed(&every_2_ms(14_000, |k| poses[k])).pose_at(14_000u32.wrapping_add(age_us));
        prop_assert!(predicted.is_none_or(|pose| pose.to_array().iter().all(|q| q.is_finite())));
        prop_assert!(predicted.is_none() || age_us <= 4_000);
    }
}

#[test]
fn there_is_none_before_eight_poses_nor_at_another_time() {
    let samples = every_2_ms(14_000, |_| [1e-6; 3]);
    assert_eq!(fed(&[]).pose_at(0), None);
    assert_eq!(fed(&samples[1..]).pose_at(14_000), None);
    let predictor = fed(&samples);
    for (time_us, there) in [
        (13_999, false),
        (14_000, true),
        (18_000, true),
        (18_001, false),
    ] {
        assert_eq!(predictor.pose_at(time_us).is_some(), there, "{time_us} us");
    }
}

#[test]
fn a_gap_or_a_time_that_stands_starts_the_poses_anew() {
    let samples = every_2_ms(14_000, |_| [1e-6; 3]);
    for (next_us, in_a_row) in [
        (18_000, true),
        (18_001, false),
        (14_000, false),
        (12_000, false),
    ] {
        let mut walk = samples.clone();
        walk.push((next_us, [1e-6; 3]));
        assert_eq!(
            fed(&walk).pose_at(next_us).is_some(),
            in_a_row,
            "{next_us} us"
        );
    }
}

#[test]
fn a_zero_deviation_that_changes_is_no_movement() {
    let decoder = sample::parameters().decoder();
    let mut tracker = PoseTracker::new(decoder, OnInvalid::Zero);
    let mut predictor = Predictor::new(AGE_MAX_US);
    let mut tick = |tracker: &mut PoseTracker, k: u32| {
        let frame = RawFrame {
            sequence: k,
            ..frame(2_000 * k)
        };
        let reading = tracker.tick(&frame);
        predictor.take(tracker, &frame, &reading);
        let pose = predictor.pose_at(frame.time_us + 300);
        (pose, reading.planar())
    };
    for k in 0..30 {
        if k == 12 {
            let zero = PlanarPose {
                x_m: 20e-6,
                ..PlanarPose::ZERO
            };
            assert!(tracker.set_zero(zero));
        }
        let (predicted, measured) = tick(&mut tracker, k);
        assert_eq!(predicted.is_some(), (7..12).contains(&k) || k >= 20, "{k}");
        // The stage stands: predicted and measured pose are equal.
        assert!(predicted.is_none() || predicted == measured);
    }
}
