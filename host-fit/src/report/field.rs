//! What a fit of the field model says of itself: noise, uncertainty of the pose, correlations.

use hallstage_solver::solve::field::fit::FieldFit;
use hallstage_solver::solve::field::posterior::PoseUncertainty;
use serde_json::{Value, json};

/// Pairs and directions that are reported.
const PAIRS: usize = 10;
const DIRECTIONS: usize = 3;
/// Parameters named of a direction.
const PARTS: usize = 4;

/// X and Y in um, Rz in urad, of SI.
pub fn by_axis(axes: [f64; 3]) -> Value {
    let [x, y, rz] = axes.map(|x| x * 1e6);
    json!({ "x_um": x, "y_um": y, "rz_urad": rz })
}

/// Two parameters that stand in for each other, and their correlation, from -1 to 1.
pub(super) fn correlation((a, b, correlation): &(String, String, f64)) -> Value {
    json!({ "parameters": [a, b], "correlation": correlation })
}

/// What a fit of the field model says of itself: white noise of the probes A, B, C; the random walk of the
/// reference, which grows with the root of time; what is predicted for a pose by the parameters, the same
/// at every visit, and by the noise of the probes, new in every servo period; the strongest correlations;
/// and the combinations of parameters that the log determines worst, with their variance over that of
/// independent parameters and the largest shares in terms of standard errors.
pub fn figures(fit: &FieldFit) -> Value {
    let posterior = &fit.posterior;
    let pairs = posterior.strongest_correlations(PAIRS);
    let directions = posterior.weakest_directions(DIRECTIONS, PARTS).into_iter();
    let directions =
        directions.map(|weak| json!({ "inflation": weak.inflation, "shares": weak.parts }));
    json!({
        "hall_noise_um": fit.noise.white_mm.map(|mm| mm * 1e3),
        "reference_drift_after_1_s": by_axis(fit.noise.drift_mm.map(|mm| mm * 1e-3)),
        "pose_uncertainty": predictions(fit),
        "strongest_correlations": pairs.iter().map(correlation).collect::<Vec<_>>(),
        "weakest_directions": directions.collect::<Vec<_>>(),
    })
}

/// At rest, as a mean over the range of the log, and at the worst corner of it.
fn predictions(fit: &FieldFit) -> Vec<Value> {
    let of = |place: &str, systematic: [f64; 3], noise: [f64; 3]| {
        let [systematic, noise] =
            [systematic, noise].map(|variances| by_axis(variances.map(f64::sqrt)));
        json!({ "place": place, "systematic": systematic, "noise": noise })
    };
    let diagonal = |at: &PoseUncertainty| {
        let of = |m: &nalgebra::Matrix3<f64>| [0, 1, 2].map(|k| m[(k, k)]);
        (of(&at.systematic), of(&at.noise))
    };
    let rest = fit
        .posterior
        .at_pose([0.0; 3], [0.0; 3])
        .map(|at| diagonal(&at));
    let corners = (0..64).filter_map(|corner: u32| {
        let side = |axis: usize| if corner >> axis & 1 == 0 { 1.0 } else { -1.0 };
        let planar = [0, 1, 2].map(|k| side(k) * fit.planar_range[k]);
        let vertical = [0, 1, 2].map(|k| side(3 + k) * fit.vertical_range[k]);
        Some(diagonal(&fit.posterior.at_pose(planar, vertical)?))
    });
    // Axis by axis: the worst corner of X need not be that of Y.
    let worst = corners.reduce(|(a, b), (c, d)| {
        let larger = |a: [f64; 3], b: [f64; 3]| [0, 1, 2].map(|k| a[k].max(b[k]));
        (larger(a, c), larger(b, d))
    });
    let service = &fit.verdict.service;
    let mut all = Vec::new();
    all.extend(rest.map(|(systematic, noise)| of("at rest", systematic, noise)));
    all.push(of(
        "mean over the range of the log",
        service.systematic,
        service.noise,
    ));
    all.extend(worst.map(|(systematic, noise)| of("worst corner of the range", systematic, noise)));
    all
}
