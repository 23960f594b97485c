//! Why the field model can't be fitted to a log.

use super::service::Comparison;
use crate::estimator::motion::shown;

/// Why there is no fit.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum FieldFitError {
    /// The field model would be worse than Model (31).
    #[error("{0}")]
    NotCarried(Box<Comparison>),
    /// The normal equations can't be solved.
    #[error(
        "the log does not determine the field model: several parameters show only together. Record all six axes \
         moving at once, each at a frequency of its own"
    )]
    Singular,
    /// A parameter came out far beyond its search range.
    #[error(
        "{parameter} would be {:.4} {}, far outside its search range from {:.4} to {:.4}: check the columns, \
         the order and the signs of the sensors in the log and in stage.toml",
        shown(*value, unit).0, shown(*value, unit).1, shown(*low, unit).0, shown(*high, unit).0
    )]
    FarOff {
        /// Its name.
        parameter: String,
        /// Its value, SI.
        value: f64,
        /// Its unit.
        unit: &'static str,
        /// Lower end of the search range.
        low: f64,
        /// Upper end.
        high: f64,
    },
}
