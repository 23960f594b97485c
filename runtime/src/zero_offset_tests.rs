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
fn a_stage_that_moves_is_refused_with_its_axis() {
    use ZeroOffsetRefusal::{Drifted, Moved};
    let refused = |ticks, x_at: &dyn Fn(u16) -> f32| match run_x(ticks, x_at) {
        ZeroOffsetState::Refused(refusal) => refusal,
        other => panic!("{other:?}"),
    };
    let jump = refused(250, &|k| if k < 50 { 0.0 } else { 11e-6 });
    assert!(matches!(jump, Moved { axis: 0, spread } if spread > 10e-6));
    // Below the largest spread.
    for sign in [1.0, -1.0] {
        let slow = refused(500, &|k| sign * f32::from(k) * 8e-9);
        assert!(matches!(slow, Drifted { axis: 0, drift } if sign * drift > 1.9e-6));
    }
    // Down to 5 um/s at the shortest run, a hundredth of its speed: 2 ms a tick.
    for um_per_s in [450.0, 48.0, 5.0] {
        let x_at = |k| f32::from(k) * 2e-3 * um_per_s * 1e-6;
        let moving = refused(ZeroOffsetSettings::TICKS_MIN, &x_at);
        let is_named = matches!(moving, Moved { axis: 0, .. } | Drifted { axis: 0, .. });
        assert!(is_named, "{um_per_s} um/s: {moving:?}");
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

/// At once, or in the last tick of all.
#[test]
fn a_reading_that_is_bad_or_outside_the_calibrated_range_refuses_with_its_status() {
    use ZeroOffsetRefusal::{Extrapolated, NoPose};
    let bad = Status::PLANAR_INVALID.with(Status::HALL_A);
    let (planar, vertical) = (Status::PLANAR_EXTRAPOLATED, Status::VERTICAL_EXTRAPOLATED);
    for (status, at, why) in [
        (bad, 0, NoPose { status: bad }),
        (planar, 249, Extrapolated { status: planar }),
        (vertical, 249, Extrapolated { status: vertical }),
    ] {
        let state = run(250, |k| Reading {
            status: if k == at { status } else { Status::GOOD },
            ..reading(0.0)
        });
        assert_eq!(state, ZeroOffsetState::Refused(why));
    }
}
