use super::*;
use crate::input::shipped::STAGE_TOML;
use crate::input::stage::Stage;
use crate::problem::model::Model;
use crate::problem::parameters::Parameters;
use crate::problem::synthetic::Protocol;
use crate::solve::least_squares::coordinates::point_of;
use crate::solve::least_squares::scatter::scatter;
use runtime::ModelKind;

#[test]
fn moments_give_the_scatter_of_the_rows_wherever_the_tilt_stands_still() {
    let stage = Stage::from_toml(STAGE_TOML, "stage.toml".as_ref()).expect("sound");
    let mut truth = Parameters::designed(&stage);
    let slopes = [
        -150.0, -130.0, -170.0, -52.0, -55.0, -47.0, 26.0, -26.0, 24.0,
    ];
    truth.values[9..18].copy_from_slice(&slopes);
    let dataset = Protocol::exact(truth, 60).dataset(&stage);
    let all: Vec<usize> = (0..dataset.rows.len()).collect();
    let mut problem = Problem::new(&dataset, &all, &stage, Model::of(ModelKind::M31));
    for (k, row) in problem.rows.iter_mut().enumerate() {
        // Noise of the sensors, and weights.
        let noise = |part: usize| 1e-8 * (((k * 7919 + part * 104_729) % 13) as f64 - 6.0);
        row.slopes[0] += noise(0);
        row.slopes[1] += 4.0 * noise(1);
        row.slopes[2] += 4.0 * noise(2);
        row.weight = 1.0 / (1.0 + (k % 3) as f64);
    }
    let ratios = point_of(&truth).expect("regular").ratios;
    let moments = Moments::new(&problem).expect("still");
    assert!(moments.hold(&ratios));
    // The paper's vertical settings, each for three movements.
    assert_eq!((moments.poses.len(), moments.means.len()), (19, 57));
    let mut offsets = vec![Offset::Free; problem.groups.len()];
    offsets[5] = Offset::Fixed([3.0, -1.0, 2.0]);
    let want = scatter(&problem, &ratios, &offsets).expect("no pole");
    let have = moments.scatter(&ratios, &offsets).expect("no pole");
    for i in 0..want.nrows() {
        for j in 0..want.ncols() {
            let scale = (want[(i, i)] * want[(j, j)]).sqrt();
            let off = (have[(i, j)] - want[(i, j)]).abs();
            // What is of first order in d is a hundred times as large.
            assert!(off <= 1e-7 * scale, "{i} {j} {off} {scale}");
        }
    }
    problem.rows[77].slopes[1] += 1e-5;
    assert!(Moments::new(&problem).is_none());
}
