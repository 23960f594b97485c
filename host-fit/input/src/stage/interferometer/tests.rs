use crate::stage::Stage;
use crate::stage::interferometer::Interferometer;
use crate::stage::tests::SOUND;
use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
use proptest::prelude::*;

/// The interferometers of a stage file with these further lines.
fn with(lines: &str) -> Interferometer {
    let text = SOUND.replace(
        "y_baseline_m = 0.10",
        &format!("y_baseline_m = 0.10\n{lines}"),
    );
    let stage = Stage::from_toml(&text, "stage.toml".as_ref());
    stage.expect("sound").interferometer
}

/// Where a beam that starts at `from` meets a plane mirror that moves with the stage, along the beam, m. The mirror is
/// three points.
fn met_m(
    mirror: [Point3<f64>; 3],
    stage: &Isometry3<f64>,
    from: Point3<f64>,
    along: Vector3<f64>,
) -> f64 {
    let [a, b, c] = mirror.map(|point| stage * point);
    let normal = (b - a).cross(&(c - a));
    normal.dot(&(a - from)) / normal.dot(&along)
}

/// The readings of three beams by solid geometry: each mirror is square to its beam at zero.
fn solid_m(beams: &[(Point3<f64>, Vector3<f64>); 3], stage: &Isometry3<f64>) -> [f64; 3] {
    beams.map(|(place, along)| {
        let side = along.cross(&Vector3::z()).normalize();
        let mirror = [
            place + 0.03 * side,
            place - 0.02 * side + 0.01 * along.cross(&side),
            place - 0.04 * along.cross(&side),
        ];
        // The source is half a metre before the mirror.
        met_m(mirror, stage, place - 0.5 * along, along) - 0.5
    })
}

/// About X first, then Y, then Z.
fn moved(pose: [f64; 6]) -> Isometry3<f64> {
    let [x, y, rz, z, rx, ry] = pose;
    let turned = UnitQuaternion::from_euler_angles(rx, ry, rz);
    Isometry3::from_parts(Translation3::new(x, y, z), turned)
}

const PLACES: &str = "x = { y_m = 0.012, z_m = -0.02, towards_y_rad = 1.5e-3, towards_z_rad = -2e-3 }\n\
    y1 = { x_m = 0.06, z_m = 0.01, towards_x_rad = -1e-3, towards_z_rad = 3e-3 }\n\
    y2 = { z_m = 0.013, towards_x_rad = 2e-3 }";

fn solid_beams() -> [(Point3<f64>, Vector3<f64>); 3] {
    let tan = f64::tan;
    [
        (
            Point3::new(0.0, 0.012, -0.02),
            Vector3::new(1.0, tan(1.5e-3), tan(-2e-3)),
        ),
        (
            Point3::new(0.06, 0.0, 0.01),
            Vector3::new(tan(-1e-3), 1.0, tan(3e-3)),
        ),
        (
            Point3::new(-0.04, 0.0, 0.013),
            Vector3::new(tan(2e-3), 1.0, 0.0),
        ),
    ]
    .map(|(place, along)| (place, along.normalize()))
}

proptest! {
    #[test]
    fn beams_are_those_of_plane_mirrors_on_a_rigid_stage(pose in prop::array::uniform6(-2e-3..2e-3f64)) {
        let [x, y, rz, z, rx, ry] = pose;
        let want = solid_m(&solid_beams(), &moved(pose));
        let interferometer = with(PLACES);
        let have = interferometer.beams_m([x, y, rz], [z, rx, ry]);
        for (have, want) in have.iter().zip(want) { prop_assert!((have - want).abs() < 1e-14, "{have} {want}"); }
        let back = interferometer.pose(want, [z, rx, ry]);
        for (have, want) in back.iter().zip([x, y, rz]) { prop_assert!((have - want).abs() < 1e-13, "{have} {want}"); }
    }

    #[test]
    fn poses_and_beams_undo_each_other_without_places(pose in prop::array::uniform3(-2e-3..2e-3f64)) {
        let interferometer = with("scale = [1.1, 0.9, 0.5]");
        let back = interferometer.pose(interferometer.beams_m(pose, [1e-3; 3]), [0.0; 3]);
        for (have, want) in back.iter().zip(pose) { prop_assert!((have - want).abs() < 1e-17); }
    }
}

#[test]
fn heights_and_offsets_have_the_signs_of_the_guide() {
    let interferometer =
        with("x = { y_m = 0.02, z_m = 0.01 }\ny1 = { z_m = 0.03 }\ny2 = { z_m = 0.03 }");
    let near = |have: [f64; 3], want: [f64; 3]| {
        for (have, want) in have.iter().zip(want) {
            assert!((have - want).abs() < 1e-11, "{have} {want}");
        }
    };
    // X = bx - hx Ry + y0 Rz, Y = by + hy Rx: with the readings at zero.
    near(
        interferometer.pose([0.0; 3], [0.0, 0.0, 1e-5]),
        [-1e-7, 0.0, 0.0],
    );
    near(
        interferometer.pose([0.0; 3], [0.0, 1e-5, 0.0]),
        [0.0, 3e-7, 0.0],
    );
    near(
        interferometer.pose([0.0, 1e-6, -1e-6], [0.0; 3]),
        [4e-7, 0.0, 2e-5],
    );
}

#[test]
fn slopes_at_zero_are_those_of_the_beams() {
    for lines in ["", PLACES] {
        let interferometer = with(lines);
        let slopes = interferometer.beams_per_pose();
        for (axis, slope) in slopes.column_iter().enumerate() {
            let [up, down] = [1e-6, -1e-6].map(|step| {
                let mut pose = [0.0; 3];
                pose[axis] = step;
                Vector3::from(interferometer.beams_m(pose, [0.0; 3]))
            });
            assert!(((up - down) / 2e-6 - slope).amax() < 1e-9, "{lines} {axis}");
        }
        let both = interferometer.pose_per_beam() * slopes;
        assert!((both - nalgebra::Matrix3::identity()).amax() < 1e-12);
    }
}

#[test]
fn air_changes_the_scale_by_its_index() {
    let air = "air = { index = 1.0, temperature_c = 20.0, pressure_pa = 101325.0, humidity = 0.0 }";
    let [x, y, _] = with(&format!("scale = [1.0, 0.5, 0.5]\n{air}")).pose([1e-3; 3], [0.0; 3]);
    assert!((x - 1e-3 / 1.000_271_799).abs() < 1e-11, "{x}");
    assert!((y - 0.5e-3 / 1.000_271_799).abs() < 1e-11, "{y}");
}

#[test]
fn a_pose_of_absurd_readings_is_finite() {
    let interferometer = with(PLACES);
    for readings_m in [[8e-3, 8e-3, -8e-3], [-8e-3; 3], [1.0, -1.0, 1.0], [0.0; 3]] {
        let pose = interferometer.pose(readings_m, [8e-3, 0.1, -0.1]);
        assert!(pose.iter().all(|x| x.is_finite()), "{pose:?}");
    }
}
