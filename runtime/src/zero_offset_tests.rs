use super::*;
use crate::pose::{Pose, VerticalPose};

fn reading(x_m: f32) -> Reading {
    let planar = PlanarPose {
        x_m,
        y_m: 2e-6,
        rz_rad: -3e-6,
    };
    Reading {
        pose: Pose {
            planar,
            ..Pose::default()
        },
        status: Status::GOOD,
    }
}

fn run(ticks: u16, reading_at: impl Fn(u16) -> Reading) -> ZeroOffsetState {
    let settings = ZeroOffsetSettings {
        ticks,
        ..ZeroOffsetSettings::default()
    };
    let mut run = ZeroOffsetRun::start(settings).expect("long enough");
    let mut state = ZeroOffsetState::Idle;
    for k in 0..ticks {
        state = run.take(&reading_at(k));
        if !matches!(state, ZeroOffsetState::Running { .. }) {
            break;
        }
    }
    state
}

fn run_x(ticks: u16, x_at: impl Fn(u16) -> f32) -> ZeroOffsetState {
    run(ticks, |k| reading(x_at(k)))
}

#[test]
fn the_mean_of_noise_at_rest_becomes_the_zero() {
    // +-1 um around 5 um, as many up as down.
    let state = run_x(250, |k| if k % 2 == 0 { 6e-6 } else { 4e-6 });
    let ZeroOffsetState::Done { zero } = state else {
        panic!("{state:?}")
    };
    assert!((zero.x_m - 5e-6).abs() < 1e-12);
    assert!((zero.y_m - 2e-6).abs() < 1e-12 && (zero.rz_rad + 3e-6).abs() < 1e-12);
}

#[test]
fn the_longest_run_sums_to_a_tenth_of_a_nanometre() {
    // Noise of +-4 um around 20 um: a full-period generator modulo 2^16.
    let noise = |k: u16| f32::from(k.wrapping_mul(25173).wrapping_add(13849)) / 65536.0 - 0.5;
    let x_at = |k| 20e-6 + 8e-6 * noise(k);
    let ZeroOffsetState::Done { zero } = run_x(u16::MAX, x_at) else {
        panic!("refused")
    };
    let sum: f64 = (0..u16::MAX - 1).map(|k| f64::from(x_at(k))).sum();
    let mean = sum / f64::from(u16::MAX - 1);
    assert!((f64::from(zero.x_m) - mean).abs() < 1e-10);
}

#[test]
fn a_jump_refuses_at_once_and_names_the_axis() {
    let state = run_x(250, |k| if k < 50 { 0.0 } else { 11e-6 });
    assert!(
        matches!(state, ZeroOffsetState::Refused(ZeroOffsetRefusal::Moved { axis: 0, spread }) if spread > 10e-6)
    );
}

#[test]
fn a_slow_drift_below_the_spread_limit_is_still_refused() {
    let state = run_x(500, |k| f32::from(k) * 8e-9);
    assert!(
        matches!(state, ZeroOffsetState::Refused(ZeroOffsetRefusal::Drifted { axis: 0, drift }) if drift > 1.9e-6)
    );
    let state = run_x(500, |k| f32::from(k) * -8e-9);
    assert!(
        matches!(state, ZeroOffsetState::Refused(ZeroOffsetRefusal::Drifted { axis: 0, drift }) if drift < -1.9e-6)
    );
}

#[test]
fn no_stage_that_moves_at_a_hundredth_of_its_speed_is_zeroed() {
    // Down to 5 um/s at the shortest run: 2 ms a tick.
    for um_per_s in [450.0, 48.0, 5.0] {
        let state = run_x(ZeroOffsetSettings::TICKS_MIN, |k| {
            f32::from(k) * 2e-3 * um_per_s * 1e-6
        });
        assert!(
            matches!(
                state,
                ZeroOffsetState::Refused(
                    ZeroOffsetRefusal::Moved { axis: 0, .. }
                        | ZeroOffsetRefusal::Drifted { axis: 0, .. }
                )
            ),
            "{um_per_s} um/s: {state:?}"
        );
    }
}

#[test]
fn each_axis_is_refused_beyond_its_bound_and_accepted_up_to_it() {
    let settings = ZeroOffsetSettings::default();
    let bounds = settings.zero_max.into_iter().chain(settings.vertical_max);
    for (axis, bound) in (0u8..).zip(bounds) {
        for (part, accepted) in [(0.99, true), (-0.99, true), (1.01, false), (-1.01, false)] {
            let mut values = [0.0; 6];
            values[usize::from(axis)] = bound * part;
            let [x, y, rz, z, rx, ry] = values;
            let state = run(250, |_| Reading {
                pose: Pose {
                    planar: PlanarPose::from_array([x, y, rz]),
                    vertical: VerticalPose::from_array([z, rx, ry]),
                },
                status: Status::GOOD,
            });
            let expected = match state {
                ZeroOffsetState::Done { .. } => accepted,
                ZeroOffsetState::Refused(ZeroOffsetRefusal::OutOfBounds { axis: a, value }) => {
                    !accepted && a == axis && (value / (bound * part) - 1.0).abs() < 1e-5
                }
                _ => false,
            };
            assert!(expected, "axis {axis} at {part} of its bound: {state:?}");
        }
    }
}

#[test]
fn a_pose_outside_the_calibrated_range_refuses_with_its_status() {
    for bit in [Status::PLANAR_EXTRAPOLATED, Status::VERTICAL_EXTRAPOLATED] {
        let state = run(250, |k| Reading {
            status: if k == 249 { bit } else { Status::GOOD },
            ..reading(0.0)
        });
        let status = bit;
        assert_eq!(
            state,
            ZeroOffsetState::Refused(ZeroOffsetRefusal::Extrapolated { status })
        );
    }
}

#[test]
fn a_bad_reading_ends_the_run_with_its_status() {
    let mut run = ZeroOffsetRun::start(ZeroOffsetSettings::default()).expect("long enough");
    let bad = Reading {
        status: Status::PLANAR_INVALID.with(Status::HALL_A),
        ..reading(0.0)
    };
    assert_eq!(
        run.take(&bad),
        ZeroOffsetState::Refused(ZeroOffsetRefusal::NoPose { status: bad.status })
    );
    let settings = ZeroOffsetSettings {
        ticks: 249,
        ..ZeroOffsetSettings::default()
    };
    assert_eq!(
        ZeroOffsetRun::start(settings),
        Err(ZeroOffsetRefusal::TooShort { ticks: 249 })
    );
}
