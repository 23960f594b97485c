//! Figures of a fit of the field model: noise and uncertainty of the pose; correlations.

use super::errors::pose;
use super::figure::{Figure, Group, figure, group};
use hallstage_solver::estimator::field::FieldFigures;
use hallstage_solver::estimator::posterior::{PoseUncertainty, Posterior};

/// Two parameters that stand in for each other, and their correlation, from -1 to 1.
pub(super) fn correlation((a, b, correlation): &(String, String, f64)) -> Group {
    let both: Figure = [a.as_str(), b.as_str()].into_iter().collect();
    group! { "parameters" => both, "correlation" => *correlation }
}

/// White noise of the probes A, B, C; the random walk of the reference, which grows with the root of time; and the
/// uncertainty of a pose by the parameters (the same at every visit) and by the noise of the probes (new in every servo
/// period).
pub fn figures(fit: &FieldFigures, posterior: &Posterior) -> Group {
    let noise = fit.noise.white_m.map(|m| figure(m * 1e6, "um"));
    group! {
        "hall_noise" => Figure::List(noise.into()),
        "reference_drift_after_1_s" => pose(fit.noise.drift),
        "pose_uncertainty" => predictions(fit, posterior),
    }
}

/// At rest, as a mean over the range of the log, and at its worst corner.
fn predictions(fit: &FieldFigures, posterior: &Posterior) -> Vec<Group> {
    let group = |place: &str, systematic: [f64; 3], noise: [f64; 3]| {
        let [systematic, noise] =
            [systematic, noise].map(|variances| pose(variances.map(f64::sqrt)));
        group! { "place" => place, "systematic" => systematic, "noise" => noise }
    };
    let diagonal = |at: &PoseUncertainty| {
        let diagonal = |m: &nalgebra::Matrix3<f64>| [0, 1, 2].map(|k| m[(k, k)]);
        (diagonal(&at.systematic), diagonal(&at.noise))
    };
    let rest = posterior.at_pose([0.0; 3], [0.0; 3]);
    let corners = (0..64).filter_map(|corner: u32| {
        let side = |axis: usize| if corner >> axis & 1 == 0 { 1.0 } else { -1.0 };
        let planar = [0, 1, 2].map(|k| side(k) * fit.planar_range[k]);
        let vertical = [0, 1, 2].map(|k| side(3 + k) * fit.vertical_range[k]);
        Some(diagonal(&posterior.at_pose(planar, vertical)?))
    });
    // Axis by axis: X and Y may have different worst corners.
    let worst = corners.reduce(|(a, b), (c, d)| {
        let larger = |a: [f64; 3], b: [f64; 3]| [0, 1, 2].map(|k| a[k].max(b[k]));
        (larger(a, c), larger(b, d))
    });
    let service = &fit.comparison.service;
    let mean = Some((service.systematic, service.noise));
    let places = [
        ("at rest", rest.map(|at| diagonal(&at))),
        ("mean over the range of the log", mean),
        ("worst corner of the range", worst),
    ];
    let known = places
        .into_iter()
        .filter_map(|(place, variances)| Some((place, variances?)));
    known
        .map(|(place, (systematic, noise))| group(place, systematic, noise))
        .collect()
}
