//! Tests of what is refused of a parameter set.

use super::*;
use crate::Calibration;
use crate::frame::CodeWindow;
use crate::sample;

fn refused(change: impl FnOnce(&mut ParameterSet)) -> ParameterError {
    let mut set = sample::parameters();
    change(&mut set);
    set.check().expect_err("an unusable set")
}

type Change = fn(&mut ParameterSet);
type ChangeTo = fn(&mut ParameterSet, f32);

#[test]
fn a_number_that_is_not_finite_is_refused_by_the_name_of_its_group() {
    let changes: [(&str, ChangeTo); 12] = [
        ("the fit record", |s, x| s.fit.peak[2] = x),
        ("the probe geometry", |s, x| s.geometry.lever_arm_m[0] = x),
        ("PM", |s, x| s.plane[2][2] = x),
        ("PM^-1", |s, x| s.plane_inverse[0][0] = x),
        ("the scale of the Hall codes", |s, x| s.hall.m_per_code = x),
        ("the capacitive plane matrix", |s, x| {
            s.capacitive.vertical_per_m[1][1] = x;
        }),
        ("the scale of the capacitive codes", |s, x| {
            s.capacitive.m_per_code = x;
        }),
        ("the vertical constants", |s, x| {
            s.constants.vertical_per_code[2][2] = x;
        }),
        ("the sensitivities", |s, x| {
            sample::sensitivities(s)[2].per_ry_rad = x;
        }),
        ("the planar constants", |s, x| {
            s.constants.planar_per_code[0][0] = x;
        }),
        ("the calibrated range", |s, x| {
            s.constants.calibrated_planar[2] = x;
        }),
        ("the smallest sensitivity", |s, x| {
            s.constants.sensitivity_min = x;
        }),
    ];
    for (group, change) in changes {
        for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            let want = ParameterError::NotFinite { group };
            assert_eq!(refused(|set| change(set, bad)), want);
        }
    }
}

#[test]
fn terms_that_do_not_follow_from_each_other_are_refused() {
    assert!(matches!(
        refused(|set| set.plane_inverse[0][1] *= 1.001),
        ParameterError::NotTheInverse { largest } if largest > INVERSE_TOLERANCE
    ));
    assert!(matches!(
        refused(|set| set.plane_inverse = [[f32::MAX, f32::MAX, -f32::MAX]; 3]),
        ParameterError::NotTheInverse { .. }
    ));
    let changes: [(&str, Change); 6] = [
        ("the planar constants", |set| {
            set.constants.planar_per_code[2][0] *= 1.00001;
        }),
        ("the vertical constants", |set| {
            set.capacitive.m_per_code *= 1.00001;
        }),
        ("PM", |set| set.geometry.misalignment_rad[2] += 1e-4),
        ("PM", |set| set.geometry.lever_arm_m[1] += 1e-4),
        ("PM", |set| set.geometry.misalignment_rad[0] = 1e30),
        // A sensing axis twice as long as a unit vector.
        ("PM", |set| {
            set.plane[0] = set.plane[0].map(|x| 2.0 * x);
            set.geometry.lever_arm_m[0] *= 2.0;
            for rows in [&mut set.plane_inverse, &mut set.constants.planar_per_code] {
                rows.iter_mut().for_each(|row| row[0] *= 0.5);
            }
        }),
    ];
    for (number, (term, change)) in changes.into_iter().enumerate() {
        let want = ParameterError::Inconsistent { term };
        assert_eq!(refused(change), want, "{number}");
    }
}

#[test]
fn scales_limits_and_windows_must_make_sense() {
    let changes: [(&str, Change); 3] = [
        ("the smallest sensitivity", |set| {
            set.constants.sensitivity_min = 0.0;
        }),
        ("the scale of the Hall codes", |set| {
            set.hall.m_per_code = -6.25e-8;
        }),
        ("a calibrated range", |set| {
            set.constants.calibrated_vertical[1] = -1e-3;
        }),
    ];
    for (value, change) in changes {
        assert_eq!(refused(change), ParameterError::NotPositive { value });
    }
    let sensors = "capacitive";
    assert_eq!(
        refused(|set| set.constants.capacitive_window = CodeWindow { low: 5, high: 4 }),
        ParameterError::UnsoundWindow { sensors }
    );
}

#[test]
fn no_pose_without_a_status_has_a_large_rotation() {
    for change in [
        (|set, rad| set.constants.calibrated_vertical[1] = rad) as fn(&mut ParameterSet, f32),
        |set, rad| set.constants.calibrated_vertical[2] = rad,
        |set, rad| set.constants.calibrated_planar[2] = rad,
    ] {
        // Without a change of the sensitivity by the tilt there is no pole.
        let reaching = |rad| {
            let mut set = sample::parameters();
            for s in sample::sensitivities(&mut set) {
                (s.per_rx_rad, s.per_ry_rad) = (0.0, 0.0);
            }
            change(&mut set, rad);
            set.check()
        };
        assert_eq!(reaching(1.0), Ok(()));
        let reach = 1.001;
        assert_eq!(reaching(reach), Err(ParameterError::LargeRange { reach }));
    }
}

#[test]
fn gaps_that_stand_nearer_to_each_other_than_they_measure_are_refused() {
    let at = |distance_m| Calibration {
        capacitive_probes_m: [[0.0, 0.0], [distance_m, 0.0], [0.0, distance_m]],
        ..sample::calibration()
    };
    // Codes of 0.5 mm.
    assert!(at(1e-3).prepare(&sample::origin()).is_ok());
    for distance_m in [1e-9, 1e-6, 1e-4] {
        assert_eq!(
            at(distance_m).prepare(&sample::origin()),
            Err(ParameterError::CapacitiveProbesInLine)
        );
    }
}

#[test]
fn a_pole_within_the_calibrated_range_is_refused() {
    assert_eq!(
        refused(|set| sample::sensitivities(set)[2].per_z_m = 5000.0),
        ParameterError::PoleInRange { probe: 2 }
    );
    assert_eq!(
        refused(|set| set.constants.calibrated_vertical[0] = 1.0),
        ParameterError::PoleInRange { probe: 0 }
    );
}
#[test]
fn a_field_model_is_refused_for_what_is_wrong_with_it() {
    let refused = |change: fn(&mut ParameterSet)| {
        let mut set = sample::field_parameters();
        assert_eq!(set.check(), Ok(()));
        change(&mut set);
        set.check().expect_err("an unusable set")
    };
    let changes: [(&str, Change); 3] = [
        ("the field terms", |set| {
            sample::field_probes(set)[1].carry[2] = f32::NAN;
        }),
        ("the field terms", |set| {
            sample::field_probes(set)[2].shape.w_w_w = f32::INFINITY;
        }),
        ("the lateral rows", |set| {
            sample::field_probes(set)[0].lateral[1] = f32::NAN;
        }),
    ];
    for (group, change) in changes {
        assert_eq!(refused(change), ParameterError::NotFinite { group });
    }
    assert_eq!(
        refused(|set| sample::field_probes(set)[0].sensitivity.per_z_m = 5000.0),
        ParameterError::PoleInRange { probe: 0 }
    );
    for change in [
        (|set| sample::field_probes(set)[1].shape.u_w[0] *= 100.0) as fn(&mut ParameterSet),
        |set| sample::field_probes(set)[1].shape.w_w[0] = -1e-3,
        |set| sample::field_probes(set)[1].shape.u_z_z[1] = f32::MAX,
        |set| set.constants.calibrated_planar[1] = 0.05,
    ] {
        assert!(matches!(
            refused(change),
            ParameterError::SteepInRange { probe: 0 | 1 }
        ));
    }
    let changes: [(&str, Change); 3] = [
        ("the lateral rows", |set| {
            sample::field_probes(set)[2].lateral[1] += 1e-3;
        }),
        ("the lateral rows", |set| {
            sample::field_probes(set).swap(0, 2)
        }),
        ("PM", |set| set.geometry.lever_arm_m[1] += 1e-4),
    ];
    for (term, change) in changes {
        assert_eq!(refused(change), ParameterError::Inconsistent { term });
    }
    assert!(matches!(
        refused(|set| set.plane = [[f32::NAN; 3]; 3]),
        ParameterError::NotTheInverse { .. }
    ));
}

#[test]
fn a_theta_beyond_a_half_turn_is_that_of_a_probe_mounted_the_other_way_round() {
    use core::f64::consts::{PI, TAU};
    for turn in [PI - 0.001, PI + 0.001, -PI - 0.05, 1.5 * PI] {
        let mut calibration = sample::calibration();
        calibration.geometry.misalignment_rad[1] += turn;
        calibration.geometry.lever_arm_m[1] = 0.2;
        let set = calibration.prepare(&sample::origin());
        assert!(set.is_ok(), "{turn}: {set:?}");
    }
    assert_eq!(
        refused(|set| set.geometry.misalignment_rad[2] += 2.0 * TAU as f32),
        ParameterError::Inconsistent { term: "PM" }
    );
}
