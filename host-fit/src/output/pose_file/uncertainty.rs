//! The standard uncertainty of each pose of a pose file.

use super::PoseRow;
use crate::solve::field::posterior::Posterior;
use rayon::prelude::*;

/// Standard uncertainties of X, Y, Rz of each row, m, m, rad: by the parameters and by the noise of
/// the probes together, at the pose that was decoded. 0 where none was.
pub fn uncertainties(rows: &[PoseRow], posterior: &Posterior) -> Vec<[f64; 3]> {
    let one = |row: &PoseRow| {
        let planar = row.reading.planar()?.to_array().map(f64::from);
        let vertical = row.reading.vertical()?.to_array().map(f64::from);
        let at = posterior.at_pose(planar, vertical)?;
        Some([0, 1, 2].map(|k| (at.systematic[(k, k)] + at.noise[(k, k)]).sqrt()))
    };
    let one = |row: &PoseRow| one(row).unwrap_or([0.0; 3]);
    rows.par_iter().map(one).collect()
}
