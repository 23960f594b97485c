//! Each source against the kinematics of a rigid stage, written once more, and against the decoder.

use super::*;
use hallstage_input::shipped::STAGE_TOML;
use hallstage_solver::estimator::paper::Parameters;
use nalgebra::{Matrix3, Matrix3x6, Vector6};

/// A beam: where it meets its mirror, and its direction.
type Beam = (Vector3<f64>, Vector3<f64>);

fn stage(keys: &str) -> Stage {
    let text = STAGE_TOML.replace("[servo]", &format!("{keys}\n\n[servo]"));
    Stage::from_toml(&text, "stage.toml".as_ref()).expect("sound")
}

fn designed(stage: &Stage) -> FieldParameters {
    FieldParameters::from_model_31(&Parameters::designed(stage), stage)
}

/// Readings of beams per X, Y, Rz, Z, Rx, Ry: a point r of the stage moves by t + w x r.
fn readings(beams: &[Beam; 3]) -> Matrix3x6<f64> {
    let axis = |k: usize| Vector3::ith(k, 1.0);
    let moves = [
        (0, None),
        (1, None),
        (0, Some(2)),
        (2, None),
        (0, Some(0)),
        (0, Some(1)),
    ];
    Matrix3x6::from_fn(|beam, column| {
        let (place, direction) = &beams[beam];
        match moves[column] {
            (along, None) => direction.dot(&axis(along)),
            (_, Some(about)) => direction.dot(&axis(about).cross(place)),
        }
    })
}

/// The error of the pose from `actual` beams that are taken for `declared`.
fn error(declared: &[Beam; 3], actual: &[Beam; 3]) -> Effect {
    let off = readings(actual) - readings(declared);
    let planar: Matrix3<f64> = readings(declared).fixed_columns::<3>(0).into();
    let off = planar.try_inverse().expect("regular") * off;
    [0, 1, 2].map(|axis| std::array::from_fn(|k| off[(axis, k)]))
}

fn assert_alike(found: &[Effect], wanted: &[Effect], size: f64, name: &str) {
    assert_eq!(found.len(), wanted.len(), "{name}");
    for (found, wanted) in found.iter().zip(wanted) {
        for (found, wanted) in found.as_flattened().iter().zip(wanted.as_flattened()) {
            assert!(
                (found - wanted).abs() < 2e-3 * size,
                "{name}: {found:e} {wanted:e}"
            );
        }
    }
}

#[test]
fn an_error_of_a_beam_acts_as_on_a_rigid_stage() {
    let arms =
        "x = { y_m = 0.02, z_m = 0.03 }\ny1 = { x_m = 0.06, z_m = -0.01 }\ny2 = { z_m = 0.01 }";
    let own = [
        (Vector3::new(0.0, 0.02, 0.03), Vector3::x()),
        (Vector3::new(0.06, 0.0, -0.01), Vector3::y()),
        (Vector3::new(-0.04, 0.0, 0.01), Vector3::y()),
    ];
    let on_axes = [
        (Vector3::zeros(), Vector3::x()),
        (Vector3::new(0.05, 0.0, 0.0), Vector3::y()),
        (Vector3::new(-0.05, 0.0, 0.0), Vector3::y()),
    ];
    let size = 1e-4;
    for (keys, declared) in [("", on_axes), (arms, own)] {
        let stage = stage(keys);
        let moved = |some: &[(usize, f64)], axis: usize, is_angle: bool| {
            let mut actual = declared;
            for (beam, share) in some {
                let off = Vector3::ith(axis, share * size);
                let (place, direction) = &mut actual[*beam];
                if is_angle {
                    *direction += off
                } else {
                    *place += off
                }
            }
            error(&declared, &actual)
        };
        let one = |beam: usize, axis: usize, is_angle: bool| moved(&[(beam, 1.0)], axis, is_angle);
        let places = vec![
            one(0, 1, false),
            one(0, 2, false),
            moved(&[(1, 1.0), (2, 1.0)], 0, false),
            one(1, 2, false),
            one(2, 2, false),
        ];
        let angles = [(0, 1), (0, 2), (1, 0), (1, 2), (2, 0), (2, 2)];
        let angles = angles.map(|(beam, axis)| one(beam, axis, true)).to_vec();
        let baseline = vec![moved(&[(1, 0.5), (2, -0.5)], 0, false)];
        let planar: Matrix3<f64> = readings(&declared).fixed_columns::<3>(0).into();
        let inverse = planar.try_inverse().expect("regular");
        let half = 0.5f64.sqrt();
        let scale = [[1.0, 0.0, 0.0], [0.0, 1.0, 1.0], [0.0, half, -half]].map(|shares| {
            let wrong = Matrix3::from_diagonal(&(-1e-6 * Vector3::from(shares)));
            let scale = inverse * wrong * readings(&declared);
            [0, 1, 2].map(|axis| std::array::from_fn(|k| scale[(axis, k)]))
        });
        let scale = scale.to_vec();
        let parameters = designed(&stage);
        for (input, value, size, wanted) in [
            (Input::BeamPlaces, size, size / 0.1, places),
            (Input::BeamAngles, size, size / 0.1, angles),
            (Input::Baseline, size, size / 0.1, baseline),
            (Input::BeamScale, 1.0, 1e-6, scale),
        ] {
            let found = effects(&stage, (&parameters, &Temperature::NONE), input, value);
            assert_alike(&found.expect("known"), &wanted, size, input.key());
        }
    }
}

/// The fit takes errors of the gaps into the slopes; a reference with a height of its own passes them on.
#[test]
fn an_error_of_the_gaps_acts_through_the_heights_of_the_beams() {
    let parts = |keys: &str, input, value| {
        let stage = stage(keys);
        let parameters = designed(&stage);
        effects(&stage, (&parameters, &Temperature::NONE), input, value).expect("known")
    };
    for (input, count) in [(Input::GapScale, 1), (Input::GapPlaces, 6)] {
        let none = vec![[[0.0; 6]; 3]; count];
        assert_alike(&parts("", input, 1e-3), &none, 1e-6, input.key());
    }
    // X = bx - hx Ry: Ry is 1 % too large.
    let [of_scale] = parts("x = { z_m = 0.02 }", Input::GapScale, 0.01)[..] else {
        panic!("one effect");
    };
    assert!((of_scale[0][5] + 0.02 * 0.01).abs() < 1e-7, "{of_scale:?}");
    // The sensor 1 stands at x = 0.12 m, the sensor 2 at -0.12 m: Ry = (g2 - g1) / 0.24.
    let of_places = parts("x = { z_m = 0.02 }", Input::GapPlaces, 1.2e-3);
    assert!(
        (of_places[0][0][5] + 0.02 * 0.005).abs() < 1e-6,
        "{of_places:?}"
    );
}

#[test]
fn an_error_of_the_gains_acts_as_in_the_decoder() {
    let stage = stage("");
    let mut parameters = designed(&stage);
    for probe in &mut parameters.probes {
        probe[CARRY..CARRY + 3].copy_from_slice(&[0.1, 0.02, -0.03]);
    }
    let constants = parameters.constants(1.0).expect("regular");
    let probes = hallstage_solver::estimator::probe::probes(&parameters);
    let (planar, vertical) = ([210e-6, -330e-6, 150e-6], [120e-6, 300e-6, -260e-6]);
    let at = Vector6::from_iterator(planar.into_iter().chain(vertical));
    let decoded = |parts: [f64; 3]| {
        let signals = [0, 1, 2].map(|k| probes[k].signal_m(planar, vertical) * (1.0 + parts[k]));
        constants
            .decode(signals, &VerticalPose::from_array(vertical))
            .to_array()
    };
    let check = |effect: &Effect, parts: [f64; 3]| {
        let (off, exact) = (decoded(parts), decoded([0.0; 3]));
        for (axis, row) in effect.iter().enumerate() {
            let predicted: f64 = row.iter().zip(at.iter()).map(|(by, x)| by * x).sum();
            let found = off[axis] - exact[axis];
            assert!(
                (predicted - found).abs() < 0.02 * found.abs() + 1e-11,
                "{axis} {found:e} {predicted:e}"
            );
        }
    };
    let drifts = effects(
        &stage,
        (&parameters, &Temperature::NONE),
        Input::Drift,
        1e-3,
    )
    .expect("known");
    for (probe, drift) in drifts.iter().enumerate() {
        check(
            drift,
            [0, 1, 2].map(|k| if k == probe { 1e-3 } else { 0.0 }),
        );
    }
    let temperature = Temperature {
        per_mk: [[-1.2e-6, 0.0], [-1.1e-6, 1e-7], [-1.3e-6, 0.0]],
        reach_mk: [30_000; 2],
        ..Temperature::NONE
    };
    let known = (&parameters, &temperature);
    let of_sensors = effects(&stage, known, Input::Temperature, 0.1).expect("logged");
    check(&of_sensors[0], [-1.2e-4, -1.1e-4, -1.3e-4]);
    check(&of_sensors[1], [0.0, 1e-5, 0.0]);
    let none = (&parameters, &Temperature::NONE);
    assert_eq!(effects(&stage, none, Input::Temperature, 0.1), None);
}

/// X by 3e-3 of X and 4e-3 of Y, which have half their range as rms.
#[test]
fn contributions_add_over_independent_motion_and_by_size_at_the_ends() {
    let mut effect = [[0.0; 6]; 3];
    effect[0][..2].copy_from_slice(&[3e-3, -4e-3]);
    let source = Source::new("a source", (1.0, "m"), vec![effect; 2], [1e-3; 6]);
    let two = f64::sqrt(2.0);
    assert!((source.rms[0] - two * 2.5e-6).abs() < 1e-12, "{source:?}");
    assert!((source.ends[0] - two * 7e-6).abs() < 1e-12, "{source:?}");
    assert_eq!((source.rms[1], source.ends[2]), (0.0, 0.0));
}
