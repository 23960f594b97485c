//! Tests of what lasts from tick to tick: hold, sequence, counters, re-zero.

use super::*;
use crate::frame::MISSING_CODE;
use crate::sample;

fn frame(sequence: u32) -> RawFrame {
    RawFrame {
        hall: [1200, 900, 700],
        capacitive: [300, -200, 100],
        sequence,
        time_us: 0,
    }
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
fn invalid_fields_read_zero_without_hold() {
    let decoder = sample::parameters().decoder();
    let mut tracker = PoseTracker::new(decoder, OnInvalid::Zero);
    assert!(tracker.tick(&frame(0)).status.is_good());
    let reading = tracker.tick(&bad_gap(1));
    assert_eq!(reading.pose, NO_POSE);
    assert!(
        !reading
            .status
            .any(Status::PLANAR_HELD.with(Status::VERTICAL_HELD))
    );
}

#[test]
fn the_last_valid_pose_is_held_for_so_many_ticks_and_no_longer() {
    let decoder = sample::parameters().decoder();
    let mut tracker = PoseTracker::new(decoder, HOLD_2);
    let good = tracker.tick(&frame(0));
    for sequence in 1..=2 {
        let held = tracker.tick(&bad_gap(sequence));
        assert_eq!(held.pose, good.pose);
        assert!(held.status.any(Status::PLANAR_HELD) && held.status.any(Status::VERTICAL_HELD));
        assert!(held.status.any(Status::PLANAR_INVALID) && held.planar().is_none());
        assert_eq!(held.planar_or_held(), Some(good.pose.planar));
    }
    let over = tracker.tick(&bad_gap(3));
    assert_eq!((over.pose, over.planar_or_held()), (NO_POSE, None));
    assert!(
        !over
            .status
            .any(Status::PLANAR_HELD.with(Status::VERTICAL_HELD))
    );
    // A valid pose renews the hold.
    assert!(tracker.tick(&frame(4)).status.is_good());
    assert_eq!(tracker.tick(&bad_gap(5)).pose, good.pose);
    assert_eq!(tracker.health().held, 3);
}

#[test]
fn only_what_is_invalid_is_held() {
    let decoder = sample::parameters().decoder();
    let mut tracker = PoseTracker::new(decoder, HOLD_2);
    let good = tracker.tick(&frame(0));
    let moved = RawFrame {
        capacitive: [310, -200, 100],
        ..bad_hall(1)
    };
    let reading = tracker.tick(&moved);
    assert_eq!(reading.pose.planar, good.pose.planar);
    assert_ne!(reading.pose.vertical, good.pose.vertical);
    assert!(reading.status.any(Status::PLANAR_HELD) && !reading.status.any(Status::VERTICAL_HELD));
    assert!(reading.vertical().is_some());
}

#[test]
fn nothing_is_held_before_a_first_valid_pose() {
    let decoder = sample::parameters().decoder();
    let mut tracker = PoseTracker::new(decoder, HOLD_2);
    let reading = tracker.tick(&bad_gap(0));
    assert_eq!(reading.pose, NO_POSE);
    assert!(
        !reading
            .status
            .any(Status::PLANAR_HELD.with(Status::VERTICAL_HELD))
    );
}

#[test]
fn a_gap_in_the_sequence_is_marked_and_counted() {
    let decoder = sample::parameters().decoder();
    let mut tracker = PoseTracker::new(decoder, HOLD_2);
    tracker.tick(&frame(u32::MAX - 1));
    let reading = tracker.tick(&frame(2));
    assert_eq!(reading.status, Status::FRAMES_MISSED);
    assert!(reading.planar().is_some());
    assert_eq!(tracker.health().frames_missed, 3);
    assert!(tracker.tick(&frame(3)).status.is_good());
}

#[test]
fn a_repeated_or_older_frame_is_not_decoded() {
    let decoder = sample::parameters().decoder();
    let mut tracker = PoseTracker::new(decoder, HOLD_2);
    let good = tracker.tick(&frame(7));
    for (sequence, held) in [(7, true), (5, true), (7, false)] {
        let reading = tracker.tick(&frame(sequence));
        assert!(reading.status.any(Status::FRAME_REPEATED));
        assert!(reading.planar().is_none() && reading.vertical().is_none());
        assert_eq!(reading.pose == good.pose, held, "frame {sequence}");
    }
    assert_eq!(tracker.health().frames_repeated, 3);
    assert!(tracker.tick(&frame(8)).status.is_good());
}

#[test]
fn a_period_without_a_frame_holds_and_keeps_the_count_in_step() {
    let decoder = sample::parameters().decoder();
    let mut tracker = PoseTracker::new(decoder, HOLD_2);
    let good = tracker.tick(&frame(0));
    let reading = tracker.tick_without_frame();
    assert_eq!(reading.pose, good.pose);
    assert!(reading.status.any(Status::FRAMES_MISSED) && reading.status.any(Status::PLANAR_HELD));
    // The missed period was told: the next frame is in step.
    assert!(tracker.tick(&frame(2)).status.is_good());
    let health = tracker.health();
    assert_eq!((health.ticks, health.frames_missed, health.held), (3, 1, 1));
    assert_eq!((health.planar_invalid, health.vertical_invalid), (1, 1));
}

#[test]
fn forgetting_drops_pose_and_sequence_and_keeps_zero_and_counters() {
    let decoder = sample::parameters().decoder();
    let mut tracker = PoseTracker::new(decoder, HOLD_2);
    let zero = PlanarPose {
        x_m: 1e-6,
        y_m: 2e-6,
        rz_rad: 3e-6,
    };
    assert!(tracker.set_zero(zero));
    tracker.tick(&frame(100));
    tracker.forget();
    let reading = tracker.tick(&bad_gap(3));
    assert_eq!(reading.pose, NO_POSE);
    assert!(
        !reading
            .status
            .any(Status::FRAMES_MISSED.with(Status::FRAME_REPEATED))
    );
    assert_eq!((tracker.zero(), tracker.health().ticks), (zero, 2));
}

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
fn every_reading_tells_whether_a_zero_deviation_is_subtracted() {
    let decoder = sample::parameters().decoder();
    let mut tracker = PoseTracker::new(decoder, HOLD_2);
    let zero = PlanarPose {
        rz_rad: 1e-9,
        ..PlanarPose::ZERO
    };
    for (pose, told) in [
        (PlanarPose::ZERO, false),
        (zero, true),
        (PlanarPose::ZERO, false),
    ] {
        assert!(tracker.set_zero(pose));
        tracker.forget();
        let readings = [
            tracker.tick(&frame(0)),
            tracker.tick(&frame(0)),
            tracker.tick(&bad_hall(1)),
            tracker.tick(&bad_gap(2)),
            tracker.tick_without_frame(),
        ];
        assert!(readings[0].status.is_good());
        for reading in readings {
            assert_eq!(reading.status.any(Status::ZERO_SET), told);
        }
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
