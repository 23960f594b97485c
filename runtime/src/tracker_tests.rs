//! Tests of what lasts from tick to tick: counters at their end, re-zero. Hold, sequence, zero and
//! counters over all kinds of ticks: `tests/soak.rs`.

use super::*;
use crate::frame::MISSING_CODE;
use crate::sample;

fn frame(sequence: u32) -> RawFrame {
    RawFrame::new([1200, 900, 700], [300, -200, 100], sequence, 0)
}

fn bad_hall(sequence: u32) -> RawFrame {
    RawFrame {
        hall: [MISSING_CODE, 900, 700],
        ..frame(sequence)
    }
}

fn bad_gap(sequence: u32) -> RawFrame {
    RawFrame {
        capacitive: [300, MISSING_CODE, 100],
        ..frame(sequence)
    }
}

const HOLD_2: OnInvalid = OnInvalid::Hold { ticks: 2 };

#[test]
fn counters_stay_at_their_largest_value() {
    let decoder = sample::parameters().decoder();
    let mut tracker = PoseTracker::new(decoder, HOLD_2);
    tracker.health = Health {
        ticks: u32::MAX,
        planar_invalid: u32::MAX,
        vertical_invalid: u32::MAX,
        held: u32::MAX,
        frames_missed: u32::MAX - 1,
        frames_repeated: u32::MAX,
    };
    let full = Health {
        frames_missed: u32::MAX,
        ..tracker.health
    };
    tracker.tick(&frame(0));
    tracker.tick(&bad_gap(10));
    tracker.tick(&frame(10));
    tracker.tick_without_frame();
    assert_eq!(tracker.health(), full);
}

/// A frame of a stage some um from its zero.
fn near_zero(sequence: u32) -> RawFrame {
    RawFrame {
        hall: [120, 90, 70],
        ..frame(sequence)
    }
}

#[test]
fn a_re_zero_at_rest_is_taken_off_from_then_on() {
    let decoder = sample::parameters().decoder();
    let mut tracker = PoseTracker::new(decoder, OnInvalid::Zero);
    let rest = tracker.tick(&near_zero(0)).pose.planar.to_array();
    let settings = ZeroOffsetSettings {
        ticks: 250,
        ..ZeroOffsetSettings::default()
    };
    tracker.start_zero_offset(settings);
    for sequence in 1..=250 {
        assert!(
            matches!(tracker.zero_offset_state(), ZeroOffsetState::Running { ticks_left } if u32::from(ticks_left) == 251 - sequence)
        );
        assert_eq!(tracker.tick(&near_zero(sequence)).status, Status::GOOD);
    }
    assert!(matches!(
        tracker.zero_offset_state(),
        ZeroOffsetState::Done { .. }
    ));
    let reading = tracker.tick(&near_zero(251));
    assert_eq!(reading.status, Status::ZERO_SET);
    let after = reading.pose.planar.to_array();
    for ((rest, after), zero) in rest.into_iter().zip(after).zip(tracker.zero().to_array()) {
        assert!(
            rest.abs() > 1e-7 && after.abs() < 1e-11,
            "{rest:e} {after:e}"
        );
        assert!((rest - zero).abs() < 1e-11);
    }
    // A second run measures from the pose without the zero, not from what is left of it.
    let before = tracker.zero();
    tracker.start_zero_offset(settings);
    for sequence in 252..502 {
        tracker.tick(&near_zero(sequence));
    }
    assert!(matches!(
        tracker.zero_offset_state(),
        ZeroOffsetState::Done { .. }
    ));
    for (before, again) in before.to_array().into_iter().zip(tracker.zero().to_array()) {
        assert!((before - again).abs() < 1e-11);
    }
}

#[test]
fn a_pose_less_another_zero_deviation_is_not_held() {
    let decoder = sample::parameters().decoder();
    let mut tracker = PoseTracker::new(decoder, HOLD_2);
    tracker.tick(&frame(0));
    tracker.set_zero(PlanarPose {
        x_m: 1e-6,
        ..PlanarPose::ZERO
    });
    let reading = tracker.tick(&bad_gap(1));
    assert_eq!(reading.planar_or_held(), None);
    assert!(reading.status.any(Status::VERTICAL_HELD));
}

#[test]
fn a_bad_or_missing_frame_refuses_the_re_zero_and_keeps_the_zero_in_use() {
    let decoder = sample::parameters().decoder();
    let mut tracker = PoseTracker::new(decoder, HOLD_2);
    let zero = PlanarPose {
        x_m: 1e-6,
        y_m: 2e-6,
        rz_rad: 3e-6,
    };
    assert!(tracker.set_zero(zero));
    tracker.tick(&frame(0));
    tracker.start_zero_offset(ZeroOffsetSettings::default());
    tracker.tick(&bad_hall(1));
    assert!(matches!(
        tracker.zero_offset_state(),
        ZeroOffsetState::Refused(ZeroOffsetRefusal::NoPose { status }) if status.any(Status::HALL_A)
    ));
    tracker.start_zero_offset(ZeroOffsetSettings::default());
    tracker.tick_without_frame();
    assert!(matches!(
        tracker.zero_offset_state(),
        ZeroOffsetState::Refused(ZeroOffsetRefusal::NoPose {
            status: Status::FRAMES_MISSED
        })
    ));
    tracker.start_zero_offset(ZeroOffsetSettings {
        ticks: 249,
        ..ZeroOffsetSettings::default()
    });
    assert_eq!(
        tracker.zero_offset_state(),
        ZeroOffsetState::Refused(ZeroOffsetRefusal::TooShort { ticks: 249 })
    );
    assert_eq!(tracker.zero(), zero);
}

#[test]
fn a_zero_that_is_no_number_is_ignored() {
    let decoder = sample::parameters().decoder();
    let mut tracker = PoseTracker::new(decoder, OnInvalid::Zero);
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        assert!(!tracker.set_zero(PlanarPose {
            y_m: bad,
            ..PlanarPose::ZERO
        }));
    }
    assert_eq!(tracker.zero(), PlanarPose::ZERO);
    assert!(tracker.tick(&frame(0)).status.is_good());
}
