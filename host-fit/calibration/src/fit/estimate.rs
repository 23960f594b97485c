//! What a fit, a search or a repair finds: parameters, and how well the log determines them.

use hallstage_solver::estimator::dynamics::MotionFit;
use hallstage_solver::estimator::parameters::FieldParameters;
use hallstage_solver::estimator::posterior::Posterior;
use hallstage_solver::estimator::sandwich::ReferenceLag;
use hallstage_solver::solve::Stopped;
use runtime::Temperature;
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
