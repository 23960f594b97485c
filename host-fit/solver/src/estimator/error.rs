//! Why the field model can't be fitted to a log.

use super::service::Comparison;

/// Why there is no fit.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum FieldFitError {
    /// The field model would be worse than Model (31).
    #[error("worse than Model (31)")]
    NotCarried(Box<Comparison>),
    /// The normal equations can't be solved.
    #[error("the normal equations are singular")]
    Singular,
    /// A parameter came out far beyond its search range.
    #[error("{parameter} is far outside its search range")]
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
