//! Tests of what lasts from tick to tick: counters at their end, re-zero. Hold, sequence, zero and
//! counters over all kinds of ticks: `tests/soak.rs`.

use super::*;
use crate::frame::MISSING_CODE;
use crate::sample;

const HOLD_2: OnInvalid = OnInvalid::Hold { ticks: 2 };

fn tracker(on_invalid: OnInvalid) -> PoseTracker {
    PoseTracker::new(sample::parameters().decoder(), on_invalid)
}

/// A frame of a stage some um from its zero.
fn frame(sequence: u32) -> RawFrame {
    RawFrame::new([120, 90, 70], [300, -200, 100], sequence, 0)
}

fn bad_frame(sequence: u32) -> RawFrame {
    RawFrame::new([MISSING_CODE; 3], [MISSING_CODE; 3], sequence, 0)
}

#[test]
fn counters_stay_at_their_largest_value() {
    let mut tracker = tracker(HOLD_2);
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
    tracker.tick(&bad_frame(10));
    tracker.tick(&frame(10));
    tracker.tick_without_frame();
    assert_eq!(tracker.health(), full);
}

#[test]
fn a_re_zero_at_rest_is_taken_off_from_then_on() {
    let mut tracker = tracker(OnInvalid::Zero);
    let rest = tracker.tick(&frame(0)).pose.planar.to_array();
    assert!(rest.iter().all(|rest| rest.abs() > 1e-7), "{rest:?}");
    let is = |have: [f32; 3], want: [f32; 3]| {
        let off = have.into_iter().zip(want).map(|(have, want)| have - want);
        assert!({ off }.all(|off| off.abs() < 1e-11), "{have:?} {want:?}");
    };
    // The second run measures from the pose without the zero, not from what is left of it.
    for (start, status) in [(1, Status::GOOD), (252, Status::ZERO_SET)] {
        tracker.start_zero_offset(ZeroOffsetSettings {
            ticks: 250,
            ..ZeroOffsetSettings::default()
        });
        for ticks_left in (1..=250).rev() {
            let running = ZeroOffsetState::Running { ticks_left };
            assert_eq!(tracker.zero_offset_state(), running);
            let sequence = start + 250 - u32::from(ticks_left);
            assert_eq!(tracker.tick(&frame(sequence)).status, status);
        }
        let zero = tracker.zero();
        let done = ZeroOffsetState::Done { zero };
        assert_eq!(tracker.zero_offset_state(), done);
        is(zero.to_array(), rest);
        let reading = tracker.tick(&frame(start + 250));
        assert_eq!(reading.status, Status::ZERO_SET);
        is(reading.pose.planar.to_array(), [0.0; 3]);
    }
}

#[test]
fn a_pose_less_another_zero_deviation_is_not_held() {
    let mut tracker = tracker(HOLD_2);
    tracker.tick(&frame(0));
    assert!(tracker.set_zero(PlanarPose::from_array([1e-6, 0.0, 0.0])));
    let reading = tracker.tick(&bad_frame(1));
    assert_eq!(reading.planar_or_held(), None);
    assert!(reading.status.any(Status::VERTICAL_HELD));
}

#[test]
fn what_refuses_a_re_zero_keeps_the_zero_in_use() {
    use ZeroOffsetRefusal::{NoPose, TooShort};
    let mut tracker = tracker(HOLD_2);
    let zero = PlanarPose::from_array([1e-6, 2e-6, 3e-6]);
    assert!(tracker.set_zero(zero));
    tracker.tick(&frame(0));
    let mut refused = |ticks, tick: fn(&mut PoseTracker)| {
        tracker.start_zero_offset(ZeroOffsetSettings {
            ticks,
            ..ZeroOffsetSettings::default()
        });
        tick(&mut tracker);
        assert_eq!(tracker.zero(), zero);
        match tracker.zero_offset_state() {
            ZeroOffsetState::Refused(refusal) => refusal,
            other => panic!("{other:?}"),
        }
    };
    let of_bad = refused(500, |tracker| _ = tracker.tick(&bad_frame(1)));
    assert!(matches!(of_bad, NoPose { status } if status.any(Status::HALL_A)));
    let of_none = refused(500, |tracker| _ = tracker.tick_without_frame());
    let status = Status::FRAMES_MISSED;
    assert_eq!(of_none, NoPose { status });
    assert_eq!(refused(249, |_| ()), TooShort { ticks: 249 });
}

#[test]
fn a_zero_that_is_no_number_is_ignored() {
    let mut tracker = tracker(OnInvalid::Zero);
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        assert!(!tracker.set_zero(PlanarPose::from_array([0.0, bad, 0.0])));
    }
    assert_eq!(tracker.zero(), PlanarPose::ZERO);
    assert!(tracker.tick(&frame(0)).status.is_good());
}
