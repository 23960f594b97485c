//! Parameter sets that are refused.

use super::*;
use crate::frame::CodeWindow;
use crate::sample::{self, field_probes, sensitivities};
use crate::{BlobError, Calibration};
use ParameterError::{Inconsistent, NotFinite, NotPositive, PoleInRange, UnsoundWindow};

type Change = fn(&mut ParameterSet);
type ChangeTo = fn(&mut ParameterSet, f32);

/// Why a sound set is refused after a change.
fn refused(mut set: ParameterSet, change: impl FnOnce(&mut ParameterSet)) -> ParameterError {
    assert_eq!(set.check(), Ok(()));
    change(&mut set);
    set.check().expect_err("an unusable set")
}

/// The same for a set of Model (31). Its blob holds every number, so it is refused, too.
fn refused_31(change: impl FnOnce(&mut ParameterSet)) -> ParameterError {
    let mut buffer = [0; crate::blob::MAX_BYTES];
    let mut changed = sample::parameters();
    let why = refused(sample::parameters(), |set| {
        change(set);
        changed = set.clone();
    });
    let blob = changed.to_bytes(&mut buffer).expect("room enough");
    let of_blob = ParameterSet::from_bytes(blob);
    assert!(matches!(of_blob, Err(BlobError::Parameters(_))), "{why:?}");
    why
}

fn refused_field(change: impl FnOnce(&mut ParameterSet)) -> ParameterError {
    refused(sample::field_parameters(), change)
}

#[test]
fn a_number_that_is_not_finite_is_refused_by_the_name_of_its_group() {
    #[rustfmt::skip]
    let of_31: [(&str, ChangeTo); 12] = [
        ("the fit record", |s, x| s.fit.peak[2] = x),
        ("the probe geometry", |s, x| s.geometry.lever_arm_m[0] = x),
        ("PM", |s, x| s.plane.m33 = x),
        ("PM^-1", |s, x| s.plane_inverse.m11 = x),
        ("the scale of the Hall codes", |s, x| s.hall.m_per_code = x),
        ("the capacitive plane matrix", |s, x| s.capacitive.vertical_per_m.m22 = x),
        ("the scale of the capacitive codes", |s, x| s.capacitive.m_per_code = x),
        ("the vertical constants", |s, x| s.constants.vertical_per_code[2][2] = x),
        ("the sensitivities", |s, x| sensitivities(s)[2].per_ry_rad = x),
        ("the planar constants", |s, x| s.constants.planar_per_code[0][0] = x),
        ("the calibrated range", |s, x| s.constants.calibrated_planar[2] = x),
        ("the smallest sensitivity", |s, x| s.constants.sensitivity_min = x),
    ];
    let of_motion: [(&str, ChangeTo); 2] = [
        ("the motion correction", |s, x| {
            motion(s).acceleration_s2[2][5] = x
        }),
        ("the motion correction", |s, x| {
            motion(s).velocity_s[1][2] = x
        }),
    ];
    #[rustfmt::skip]
    let of_field: [(&str, ChangeTo); 3] = [
        ("the field terms", |s, x| field_probes(s)[1].carry[2] = x),
        ("the field terms", |s, x| field_probes(s)[2].shape.w_w_w = x),
        ("the lateral rows", |s, x| field_probes(s)[0].lateral[1] = x),
    ];
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        for (group, change) in of_31 {
            assert_eq!(refused_31(|set| change(set, bad)), NotFinite { group });
        }
        for (group, change) in of_field {
            assert_eq!(refused_field(|set| change(set, bad)), NotFinite { group });
        }
        for (group, change) in of_motion {
            let set = sample::with_motion(sample::calibration());
            assert_eq!(refused(set, |set| change(set, bad)), NotFinite { group });
        }
    }
}

#[test]
fn what_cannot_be_or_does_not_follow_is_refused_by_its_reason() {
    let sensors = "capacitive";
    #[rustfmt::skip]
    let of_31: [(Change, ParameterError); 12] = [
        (|s| s.constants.planar_per_code[2][0] *= 1.00001, Inconsistent { term: "the planar constants" }),
        (|s| s.capacitive.m_per_code *= 1.00001, Inconsistent { term: "the vertical constants" }),
        (|s| s.geometry.misalignment_rad[2] += 1e-4, Inconsistent { term: "PM" }),
        (|s| s.geometry.misalignment_rad[2] += 2.0 * TAU, Inconsistent { term: "PM" }),
        (|s| s.geometry.misalignment_rad[0] = 1e30, Inconsistent { term: "PM" }),
        (|s| s.geometry.lever_arm_m[1] += 1e-4, Inconsistent { term: "PM" }),
        (twice_as_long, Inconsistent { term: "PM" }),
        (|s| s.constants.sensitivity_min = 0.0, NotPositive { value: "the smallest sensitivity" }),
        (|s| s.hall.m_per_code = -6.25e-8, NotPositive { value: "the scale of the Hall codes" }),
        (|s| s.constants.calibrated_vertical[1] = -1e-3, NotPositive { value: "a calibrated range" }),
        (|s| s.constants.capacitive_window = CodeWindow { low: 5, high: 4 }, UnsoundWindow { sensors }),
        (|s| s.constants.calibrated_vertical[0] = 1.0, PoleInRange { probe: 0 }),
    ];
    for (number, (change, why)) in of_31.into_iter().enumerate() {
        assert_eq!(refused_31(change), why, "{number}");
    }
    #[rustfmt::skip]
    let of_field: [(Change, ParameterError); 4] = [
        (|s| field_probes(s)[2].lateral[1] += 1e-3, Inconsistent { term: "the lateral rows" }),
        (|s| field_probes(s).swap(0, 2), Inconsistent { term: "the lateral rows" }),
        (|s| s.geometry.lever_arm_m[1] += 1e-4, Inconsistent { term: "PM" }),
        (|s| field_probes(s)[0].sensitivity.per_z_m = 5000.0, PoleInRange { probe: 0 }),
    ];
    for (number, (change, why)) in of_field.into_iter().enumerate() {
        assert_eq!(refused_field(change), why, "{number}");
    }
    let is_steep = |error| matches!(error, ParameterError::SteepInRange { probe: 0 | 1 });
    assert!(is_steep(refused_field(
        |s| field_probes(s)[1].shape.u_w[0] *= 100.0
    )));
    assert!(is_steep(refused_field(
        |s| field_probes(s)[1].shape.w_w[0] = -1e-3
    )));
    assert!(is_steep(refused_field(|s| field_probes(s)[1]
        .shape
        .u_z_z[1] = f32::MAX)));
    assert!(is_steep(refused_field(
        |s| s.constants.calibrated_planar[1] = 0.05
    )));
}

/// The motion correction of [`sample::with_motion`], to be changed.
fn motion(set: &mut ParameterSet) -> &mut crate::MotionCorrection {
    set.motion_correction.as_mut().expect("a correction")
}

#[test]
fn a_motion_correction_in_another_unit_is_refused() {
    let changes: [ChangeTo; 2] = [
        |set, unit| motion(set).acceleration_s2[0][3] *= 1e6 * unit,
        |set, unit| motion(set).velocity_s[1][1] *= 1e3 * unit,
    ];
    for change in changes {
        for sign in [-1.0, 1.0] {
            let set = sample::with_motion(sample::warm_calibration());
            let why = refused(set, |set| change(set, sign));
            assert_eq!(why, ParameterError::LargeMotionCorrection);
        }
    }
}

/// A sensing axis twice as long as a unit vector.
fn twice_as_long(set: &mut ParameterSet) {
    let mut row = set.plane.row_mut(0);
    row *= 2.0;
    set.geometry.lever_arm_m[0] *= 2.0;
    let mut column = set.plane_inverse.column_mut(0);
    column *= 0.5;
    (set.constants.planar_per_code.iter_mut()).for_each(|row| row[0] *= 0.5);
}

#[test]
fn what_does_not_invert_pm_is_refused() {
    let is_off = |error| matches!(error, ParameterError::NotTheInverse { largest } if largest > INVERSE_TOLERANCE || largest.is_nan());
    assert!(is_off(refused_31(|s| s.plane_inverse.m12 *= 1.001)));
    let overflow = from_rows(&[[f32::MAX, f32::MAX, -f32::MAX]; 3]);
    assert!(is_off(refused_31(|s| s.plane_inverse = overflow)));
    assert!(is_off(refused_31(|s| {
        s.plane.set_row(1, &s.plane.row(0).into_owned());
        s.geometry.lever_arm_m[1] = s.geometry.lever_arm_m[0];
        s.geometry.misalignment_rad[1] = s.geometry.misalignment_rad[0];
    })));
    assert!(is_off(refused_field(
        |s| s.plane = Matrix3::repeat(f32::NAN)
    )));
}

#[test]
fn a_sensitivity_that_comes_near_zero_within_the_range_is_refused_and_its_probe_named() {
    let mut set = sample::parameters();
    set.constants.calibrated_vertical = [250e-6, 0.0, 0.0];
    for probe in 0..3u8 {
        let at = usize::from(probe);
        let mut set = set.clone();
        sensitivities(&mut set)[at].eta = 0.85;
        sensitivities(&mut set)[at].per_z_m = 2900.0;
        let why = refused(set, |set| sensitivities(set)[at].per_z_m = 3100.0);
        assert_eq!(why, PoleInRange { probe });
    }
}

#[test]
fn no_pose_without_a_status_has_a_large_rotation() {
    let changes: [ChangeTo; 3] = [
        |set, rad| set.constants.calibrated_vertical[1] = rad,
        |set, rad| set.constants.calibrated_vertical[2] = rad,
        |set, rad| set.constants.calibrated_planar[2] = rad,
    ];
    for change in changes {
        // Without a change of the sensitivity by the tilt there is no pole.
        let mut set = sample::parameters();
        for s in sensitivities(&mut set) {
            (s.per_rx_rad, s.per_ry_rad) = (0.0, 0.0);
        }
        change(&mut set, 1.0);
        let reach = 1.001;
        let why = refused(set, |set| change(set, reach));
        assert_eq!(why, ParameterError::LargeRange { reach });
    }
}

#[test]
fn gaps_that_stand_nearer_to_each_other_than_they_measure_are_refused() {
    // Codes of 0.5 mm.
    for (distance_m, is_sound) in [(1e-3, true), (1e-4, false), (1e-6, false), (1e-9, false)] {
        let calibration = Calibration {
            capacitive_probes_m: [[0.0, 0.0], [distance_m, 0.0], [0.0, distance_m]],
            ..sample::calibration()
        };
        let why = calibration.prepare(&sample::origin()).err();
        let in_line = ParameterError::CapacitiveProbesInLine;
        assert_eq!(why, (!is_sound).then_some(in_line), "{distance_m}");
    }
}

#[test]
fn a_theta_beyond_a_half_turn_is_that_of_a_probe_mounted_the_other_way_round() {
    use core::f64::consts::PI;
    for turn in [PI - 0.001, PI + 0.001, -PI - 0.05, 1.5 * PI] {
        let mut calibration = sample::calibration();
        calibration.geometry.misalignment_rad[1] += turn;
        calibration.geometry.lever_arm_m[1] = 0.2;
        let set = calibration.prepare(&sample::origin());
        assert!(set.is_ok(), "{turn}: {set:?}");
    }
}
