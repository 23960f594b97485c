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
    /// How many standard uncertainties each pose has: see [`Self::at`].
    pub const fn count(&self) -> usize {
        if self.budget.is_some() { 6 } else { 3 }
    }

    /// Standard uncertainties of X, Y, Rz of a reading, m, m, rad: by the parameters and by the noise of the probes together,
    /// at the pose that was decoded, and then, with a budget, by all sources. 0 where no pose was decoded.
    pub fn at(&self, reading: &Reading) -> Vec<f64> {
        let known = || {
            let planar = reading.planar()?.to_array().map(f64::from);
            let vertical = reading.vertical()?.to_array().map(f64::from);
            let at = self.posterior.at_pose(planar, vertical)?;
            let own = [0, 1, 2].map(|k| at.systematic[(k, k)] + at.noise[(k, k)]);
            let other = self
                .budget
                .iter()
                .flat_map(|budget| budget.variance_at(planar, vertical));
            let whole = own
                .into_iter()
                .cycle()
                .zip(other)
                .map(|(own, other)| own + other);
            Some(own.into_iter().chain(whole).map(f64::sqrt).collect())
        };
        known().unwrap_or_else(|| vec![0.0; self.count()])
    }
}
