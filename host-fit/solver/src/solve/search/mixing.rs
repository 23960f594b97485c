//! p, the share of individuals that learn rather than mutate, and how it adapts
//! (equations 25 and 27-29).
//!
//! Choices where the paper is silent:
//! - The learning period is one generation; both phases count together.
//! - p is kept within [`P_MIN`] to [`P_MAX`], so that neither kind of step dies out. It does not
//!   change when the formula gives 0/0.
//! - Equation 29 has no value where the old cost is NaN, infinite or zero. The decline is 1 there.

use super::cost::ranks_before;

/// Smallest p.
pub const P_MIN: f64 = 0.05;
/// Largest p.
pub const P_MAX: f64 = 0.95;
/// p at the start (section 4.2 of the paper).
pub const P_START: f64 = 0.5;

/// How an individual gets its step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mixing {
    /// Every individual takes the same step.
    Pure(Step),
    /// Equation 26: an individual takes "Eq. (1)", learning, when rand < p, and "Eq. (2)", the
    /// mutation, otherwise.
    Hybrid(Adaptation),
}

/// How p is adapted to the success of the two kinds of step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Adaptation {
    /// p does not change (equations 23, 24).
    Fixed,
    /// p follows how many individuals each kind improved (equation 25).
    SuccessRatio,
    /// p follows by how much each kind lowered the cost (equations 27-29): SHTLBO.
    DeclineRatio,
}

/// A kind of step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step {
    /// Equations 16-18: the step of TLBO.
    Learn,
    /// Equations 19, 20: the step of GBTLBO.
    Scatter,
    /// Equations 21, 22: the paper's mutation.
    Mutate,
}

/// The success of the two kinds of step, learning and mutation, in one generation.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Tally {
    /// ns1, ns2: individuals improved.
    pub improved: [u32; 2],
    /// nf1, nf2: individuals not improved.
    pub failed: [u32; 2],
    /// vs1, vs2: sum of the relative declines of the cost (equation 28).
    pub decline: [f64; 2],
}

/// Equation 29: the decline of the cost over the old cost.
pub fn relative_decline(old: f64, new: f64) -> f64 {
    let decline = (old - new) / old.abs();
    if decline.is_finite() { decline } else { 1.0 }
}

impl Tally {
    /// Counts one individual: its step, its old cost and its candidate's cost.
    pub fn count(&mut self, step: Step, old: f64, new: f64) {
        let kind = usize::from(step != Step::Learn);
        if ranks_before(new, old) {
            self.improved[kind] += 1;
            self.decline[kind] += relative_decline(old, new);
        } else {
            self.failed[kind] += 1;
        }
    }

    /// Equations 25 and 27: w1 n2 / (w2 n1 + w1 n2), where w is the success of a kind of step and n
    /// the number of its tries. `None` on 0/0.
    fn share(success: [f64; 2], tried: [f64; 2]) -> Option<f64> {
        let first = success[0] * tried[1];
        let second = success[1] * tried[0];
        let sum = second + first;
        (sum > 0.0).then(|| first / sum)
    }

    /// The next p after `p`.
    pub fn next_p(&self, adaptation: Adaptation, p: f64) -> f64 {
        let improved = self.improved.map(f64::from);
        let tried = [0, 1].map(|k| improved[k] + f64::from(self.failed[k]));
        let next = match adaptation {
            Adaptation::Fixed => return p,
            Adaptation::SuccessRatio => Self::share(improved, tried),
            Adaptation::DeclineRatio => Self::share(self.decline, tried),
        };
        next.map_or(p, |next| next.clamp(P_MIN, P_MAX))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tally(improved: [u32; 2], failed: [u32; 2], decline: [f64; 2]) -> Tally {
        Tally {
            improved,
            failed,
            decline,
        }
    }

    #[test]
    fn equations_28_and_29_sum_the_declines_of_the_improved_only() {
        let mut t = Tally::default();
        t.count(Step::Learn, 8.0, 6.0);
        t.count(Step::Learn, 8.0, 8.0);
        t.count(Step::Learn, 4.0, 3.0);
        t.count(Step::Mutate, 2.0, 1.0);
        t.count(Step::Mutate, 2.0, f64::NAN);
        assert_eq!(t, tally([2, 1], [1, 1], [0.5, 0.5]));
        // 0.5*2 / (0.5*3 + 0.5*2) = 1/2.5.
        assert!((t.next_p(Adaptation::DeclineRatio, 0.5) - 0.4).abs() < 1e-15);
    }

    #[test]
    fn p_stays_where_the_formula_has_no_value_and_keeps_both_kinds_alive() {
        for adaptation in [Adaptation::SuccessRatio, Adaptation::DeclineRatio] {
            for (improved, failed, decline, p) in [
                ([0, 0], [0, 0], [0.0, 0.0], 0.3),
                ([0, 0], [70, 30], [0.0, 0.0], 0.3),
                // Only learning was tried: 25 and 27 are again 0/0.
                ([70, 0], [30, 0], [3.0, 0.0], 0.3),
                ([10, 0], [40, 50], [1.0, 0.0], P_MAX),
                ([0, 10], [50, 40], [0.0, 1.0], P_MIN),
            ] {
                let tally = tally(improved, failed, decline);
                assert_eq!(tally.next_p(adaptation, 0.3), p, "{tally:?}");
            }
        }
    }

    #[test]
    fn a_decline_without_a_value_counts_one() {
        assert_eq!(relative_decline(f64::NAN, 3.0), 1.0);
        assert_eq!(relative_decline(f64::INFINITY, 3.0), 1.0);
        assert_eq!(relative_decline(0.0, -1.0), 1.0);
        assert_eq!(relative_decline(4.0, 1.0), 0.75);
        assert_eq!(relative_decline(-2.0, -3.0), 0.5);
    }
}
