//! The standard uncertainty of each pose of a pose file.

use hallstage_calibration::budget::Budget;
use hallstage_solver::estimator::posterior::Posterior;
use runtime::Reading;

/// What is known of the errors of a decoder.
#[derive(Clone, Debug)]
pub struct KnownErrors {
    /// The parameters and the noise of the probes.
    pub posterior: Posterior,
    /// All other sources; `None` beside a blob of an earlier program.
    pub budget: Option<Budget>,
}

impl KnownErrors {
    /// How many standard uncertainties each pose has in a file, zeros where no pose was decoded: see [`Self::at`].
    pub const fn count(&self) -> usize {
        if self.budget.is_some() { 6 } else { 3 }
    }

    /// Standard uncertainties of X, Y, Rz of a reading, m, m, rad: by the parameters and by the noise of the probes together,
    /// at the pose that was decoded, and by all sources of the budget, NaN without one. `None` where no pose was decoded.
    pub fn at(&self, reading: &Reading) -> Option<[[f64; 3]; 2]> {
        let planar = reading.planar()?.to_array().map(f64::from);
        let vertical = reading.vertical()?.to_array().map(f64::from);
        let at = self.posterior.at_pose(planar, vertical)?;
        let own = [0, 1, 2].map(|k| at.systematic[(k, k)] + at.noise[(k, k)]);
        let budget = self.budget.as_ref();
        let other = budget.map_or([f64::NAN; 3], |budget| budget.variance_at(planar, vertical));
        let whole = [0, 1, 2].map(|k| own[k] + other[k]);
        Some([own, whole].map(|variances| variances.map(f64::sqrt)))
    }
}
