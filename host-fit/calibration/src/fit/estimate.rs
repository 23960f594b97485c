//! What a fit, a search or a repair finds: parameters, and how well the log determines them.

use hallstage_solver::estimator::dynamics::MotionFit;
use hallstage_solver::estimator::parameters::FieldParameters;
use hallstage_solver::estimator::posterior::Posterior;
use hallstage_solver::estimator::sandwich::ReferenceLag;
use hallstage_solver::solve::Stopped;
use runtime::matrix::to_rows;
use runtime::{MotionCorrection, Temperature};
use std::time::Duration;

/// Parameters with their posterior. All other figures of a [`Fit`](super::Fit) follow from these.
#[derive(Clone, Debug)]
pub struct Estimate {
    /// The parameters; E and p are zero in Models (12) to (31).
    pub parameters: FieldParameters,
    /// k, h and T0.
    pub temperature: Temperature<f64>,
    /// How well the log determines the parameters.
    pub posterior: Posterior,
    /// By how much the reference lags behind the probes; `None` where nothing in the log shows it.
    pub lag: Option<ReferenceLag>,
    /// Lags of the probes, and what acceleration adds to their readings.
    pub motion: MotionFit,
    /// The solver's own zero deviation of each movement, m, by the rows that were fitted; `None` where it
    /// has none of its own.
    pub delta_m: Option<Vec<[f64; 3]>>,
    /// Evaluations of the cost.
    pub evaluations: u64,
    /// Time that the solver took.
    pub elapsed: Duration,
    /// Why the solver stopped.
    pub stopped: Stopped,
}

impl Estimate {
    /// The correction by commanded speed and acceleration; `None` unless the log determines what acceleration adds.
    pub fn motion_correction(&self) -> Option<MotionCorrection> {
        let found = self.motion.correction(&self.parameters);
        let [acceleration, velocity] = found.filter(|_| self.motion.shows_acceleration)?;
        let rows = |m| to_rows(m).map(|row| row.map(|x| x as f32));
        Some(MotionCorrection {
            acceleration_s2: rows(&acceleration),
            velocity_s: rows(&velocity),
        })
    }
}
