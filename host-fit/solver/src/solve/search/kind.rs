//! The searches by name.

use super::cost::CostFunction;
use super::mixing::{Adaptation, Step};
use super::run::{Outcome, Start, StopCriteria, run};
use super::tlbo::Tlbo;

/// A search method.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
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
    /// The hybrid with p by the success ratio (equation 25).
    SuccessRatio,
}

/// The searches with their names and where they come from, the paper's and its ablations first.
const TABLE: [(SearchKind, &str, &str); 6] = [
    (SearchKind::Shtlbo, "shtlbo", "eqs 23, 24, 27-29"),
    (SearchKind::Tlbo, "tlbo", "eqs 16-18"),
    (SearchKind::Gbtlbo, "gbtlbo", "eqs 19, 20"),
    (SearchKind::Mutation, "mutation", "eqs 21, 22"),
    (SearchKind::Hybrid, "hybrid", "eqs 23, 24"),
    (SearchKind::SuccessRatio, "success-ratio", "eqs 23-25"),
];

impl SearchKind {
    /// All of them.
    pub const ALL: [Self; TABLE.len()] = {
        let mut all = [Self::Shtlbo; TABLE.len()];
        let mut index = 0;
        while index < TABLE.len() {
            all[index] = TABLE[index].0;
            index += 1;
        }
        all
    };

    /// The name on the command line and in reports.
    pub const fn name(self) -> &'static str {
        TABLE[self as usize].1
    }

    /// The equations of the paper that the method consists of, or where it comes from.
    pub const fn source(self) -> &'static str {
        TABLE[self as usize].2
    }

    /// Searches for the minimum of `function`. SHTLBO updates p every generation. Without any stop
    /// criterion it runs until the interrupt flag is set.
    pub fn minimize(
        self,
        function: &dyn CostFunction,
        start: &Start<'_>,
        criteria: &StopCriteria<'_>,
    ) -> Outcome {
        let tlbo = |tlbo| run(tlbo, function, start, criteria);
        match self {
            Self::Shtlbo => tlbo(Tlbo::hybrid(Adaptation::DeclineRatio, 1)),
            Self::Tlbo => tlbo(Tlbo::pure(Step::Learn)),
            Self::Gbtlbo => tlbo(Tlbo::pure(Step::Scatter)),
            Self::Mutation => tlbo(Tlbo::pure(Step::Mutate)),
            Self::Hybrid => tlbo(Tlbo::hybrid(Adaptation::Fixed, 1)),
            Self::SuccessRatio => tlbo(Tlbo::hybrid(Adaptation::SuccessRatio, 1)),
        }
    }
}

#[cfg(test)]
#[path = "kind_tests.rs"]
mod tests;
