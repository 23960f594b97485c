//! The standard uncertainty of each pose of a pose file.

use hallstage_solver::estimator::posterior::Posterior;
use runtime::Reading;

/// Standard uncertainties of X, Y, Rz of a reading, m, m, rad: by the parameters and by the noise of
/// the probes together, at the pose that was decoded. 0 where none was.
pub fn uncertainty(reading: &Reading, posterior: &Posterior) -> [f64; 3] {
    let known = || {
        let planar = reading.planar()?.to_array().map(f64::from);
        let vertical = reading.vertical()?.to_array().map(f64::from);
        let at = posterior.at_pose(planar, vertical)?;
        Some([0, 1, 2].map(|k| (at.systematic[(k, k)] + at.noise[(k, k)]).sqrt()))
    };
    known().unwrap_or([0.0; 3])
}
