//! The searches by name.

use super::cost::CostFunction;
use super::mixing::{Adaptation, Mixing, Step};
use super::run::{SearchOptions, SearchResult, run};

/// A search method.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SearchKind {
    /// SHTLBO (equations 23, 24, 27-29).
    Shtlbo,
    /// TLBO (equations 16-18).
    Tlbo,
    /// Gaussian bare-bones TLBO (equations 19, 20).
    Gbtlbo,
    /// The paper's mutation alone (equations 21, 22).
    Mutation,
    /// The hybrid with a fixed p (equations 23, 24).
    Hybrid,
    /// The hybrid with p by the success ratio (equations 23-25).
    SuccessRatio,
}

impl SearchKind {
    /// All of them, the paper's first.
    pub const ALL: [Self; 6] = [
        Self::Shtlbo,
        Self::Tlbo,
        Self::Gbtlbo,
        Self::Mutation,
        Self::Hybrid,
        Self::SuccessRatio,
    ];

    /// The name on the command line and in reports.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Shtlbo => "shtlbo",
            Self::Tlbo => "tlbo",
            Self::Gbtlbo => "gbtlbo",
            Self::Mutation => "mutation",
            Self::Hybrid => "hybrid",
            Self::SuccessRatio => "success-ratio",
        }
    }

    /// Searches for the minimum of `function`, on the threads of the current rayon pool. The result
    /// is the same on any number of threads.
    pub fn minimize(
        self,
        function: &dyn CostFunction,
        options: &SearchOptions<'_>,
    ) -> SearchResult {
        let mixing = match self {
            Self::Shtlbo => Mixing::Hybrid(Adaptation::DeclineRatio),
            Self::Tlbo => Mixing::Pure(Step::Learn),
            Self::Gbtlbo => Mixing::Pure(Step::Scatter),
            Self::Mutation => Mixing::Pure(Step::Mutate),
            Self::Hybrid => Mixing::Hybrid(Adaptation::Fixed),
            Self::SuccessRatio => Mixing::Hybrid(Adaptation::SuccessRatio),
        };
        run(mixing, function, options)
    }
}

#[cfg(test)]
#[path = "kind_tests.rs"]
mod tests;
