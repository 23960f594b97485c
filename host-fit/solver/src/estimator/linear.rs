//! The linear form of Model (31): pose = G s / (1 + r v), with the gain G = PM^-1 diag(1/eta) an
//! arbitrary matrix and r the slopes over eta.

use crate::estimator::paper::Parameters;
use hallstage_input::stage::Stage;
use nalgebra::Matrix3;
use runtime::geometry::SensingAxes;
use runtime::matrix::{inverse, to_rows};

/// The point (G, r) of a fit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LinearPoint {
    /// Gain: pose (m, m, rad) per m of corrected signal, G = PM^-1 diag(1/eta).
    pub gain: Matrix3<f64>,
    /// Slopes over eta of each probe: (a, b, c) / eta in 1/m, 1/rad, 1/rad for Model (31).
    pub ratios: [[f64; 3]; 3],
}

/// The point (G, r) of a set of parameters, or `None` where PM is singular or an eta is zero.
pub fn linear_point(p: &Parameters) -> Option<LinearPoint> {
    let inverse = inverse(&p.geometry().plane())?;
    let eta = p.eta();
    if eta.iter().any(|eta| !eta.is_normal()) {
        return None;
    }
    let slopes = p.slopes();
    Some(LinearPoint {
        gain: Matrix3::from_fn(|i, j| inverse[(i, j)] / eta[j]),
        ratios: [0, 1, 2].map(|probe| slopes[probe].map(|slope| slope / eta[probe])),
    })
}

/// The parameters of a point: the rows of G^-1 = diag(eta) PM give eta, misalignment and lever
/// arm of each probe. `None` where G is singular. Each theta comes out within a quarter turn of the
/// designed one.
pub fn parameters_at(point: &LinearPoint, stage: &Stage) -> Option<Parameters> {
    let m = to_rows(&inverse(&point.gain)?);
    let mut geometry = stage.geometry();
    let mut eta = [1.0; 3];
    let designed = SensingAxes::at(geometry.misalignment_rad);
    for probe in 0..3 {
        let [x, y, arm] = m[probe];
        let part = |[to_x, to_y]: [f64; 2]| x * to_x + y * to_y;
        // Along the designed direction of the sensing axis, which has the sign of eta.
        let (along, across) = (part(designed.0[probe]), part(designed.across()[probe]));
        eta[probe] = x.hypot(y).copysign(along);
        geometry.lever_arm_m[probe] = arm / eta[probe];
        geometry.misalignment_rad[probe] += (across / eta[probe]).atan2(along / eta[probe]);
    }
    let slopes = [0, 1, 2].map(|probe| point.ratios[probe].map(|ratio| ratio * eta[probe]));
    let parameters = Parameters::new(&geometry, eta, slopes);
    let finite = parameters.values.iter().all(|value| value.is_finite());
    finite.then_some(parameters)
}
