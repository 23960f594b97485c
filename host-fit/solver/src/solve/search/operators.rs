//! The operators of teaching-learning-based optimization, one function for each equation.
//!
//! All of them make a new student from an old one, coordinate by coordinate; clipping to the
//! bounds and the choice between old and new follow elsewhere ([`super::cost`],
//! [`super::tlbo`]). Symbols of the paper and the names here:
//!
//! | paper | here |
//! |---|---|
//! | St_ij^old, St_ij^new | `old`, `new` |
//! | T_i, Mean_i | `teacher`, `mean`: of the population at the start of the phase |
//! | T_F | `teaching_factor` |
//! | St_ik | `partner`, of the population at the start of the phase |
//! | r_1, rand_3 | r: one number in [0, 1) for each coordinate, in `new` when called |
//! | N(0, 1) | n: one number for each coordinate, in `new` when called |
//!
//! In equations 19 and 20 the paper writes N(mean, d): as its text says, d is the standard
//! deviation, so a number of that distribution is mean + d N(0, 1).

/// T_F of equation 17, round(1 + rand): 1 or 2, each half of the time.
#[inline(always)]
pub fn teaching_factor(rand: f64) -> f64 {
    if rand < 0.5 { 1.0 } else { 2.0 }
}

/// Equation 16, the teacher phase of TLBO: old + r (teacher - T_F mean).
#[inline(always)]
pub fn learn_from_teacher(
    old: &[f64],
    teacher: &[f64],
    mean: &[f64],
    teaching_factor: f64,
    new: &mut [f64],
) {
    let known = old.iter().zip(teacher).zip(mean);
    for (new, ((old, teacher), mean)) in new.iter_mut().zip(known) {
        let r = *new;
        *new = old + r * (teacher - teaching_factor * mean);
    }
}

/// Equation 18, the learner phase of TLBO: towards a better partner, away from one that is not
/// better. (For equal costs the paper says nothing.)
#[inline(always)]
pub fn learn_from_partner(old: &[f64], partner: &[f64], partner_is_better: bool, new: &mut [f64]) {
    let sign = if partner_is_better { 1.0 } else { -1.0 };
    for (new, (old, partner)) in new.iter_mut().zip(old.iter().zip(partner)) {
        let r = *new;
        *new = old + r * (sign * (partner - old));
    }
}

/// Equation 19 with the teacher as `other`, equation 20 with a partner (GBTLBO): a normal
/// number about the middle of the two, with their distance as its standard deviation.
#[inline(always)]
pub fn scatter_about_middle(old: &[f64], other: &[f64], new: &mut [f64]) {
    for (new, (old, other)) in new.iter_mut().zip(old.iter().zip(other)) {
        let n = *new;
        *new = (old + other) / 2.0 + n * (other - old).abs();
    }
}

/// Equation 21 with the teacher as `other`, equation 22 with a partner (the paper's mutation):
/// a normal number about the old student itself, with the distance as its standard deviation.
#[inline(always)]
pub fn mutate_about_self(old: &[f64], other: &[f64], new: &mut [f64]) {
    for (new, (old, other)) in new.iter_mut().zip(old.iter().zip(other)) {
        let n = *new;
        *new = old + n * (other - old).abs();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // Binary fractions, so that the steps worked by hand are exact.
    const OLD: [f64; 3] = [1.0, -2.0, 0.5];
    const TEACHER: [f64; 3] = [3.0, 2.0, 0.5];
    const MEAN: [f64; 3] = [0.5, -1.0, 4.0];
    const R: [f64; 3] = [0.5, 0.25, 0.75];
    const N: [f64; 3] = [-1.5, 0.5, 2.0];

    #[test]
    fn equation_16_with_both_teaching_factors() {
        let mut new = R;
        learn_from_teacher(&OLD, &TEACHER, &MEAN, 1.0, &mut new);
        // 1 + 1/2 (3 - 1/2); -2 + 1/4 (2 + 1); 1/2 + 3/4 (1/2 - 4).
        assert_eq!(new, [2.25, -1.25, -2.125]);
        new = R;
        learn_from_teacher(&OLD, &TEACHER, &MEAN, 2.0, &mut new);
        // 1 + 1/2 (3 - 1); -2 + 1/4 (2 + 2); 1/2 + 3/4 (1/2 - 8).
        assert_eq!(new, [2.0, -1.0, -5.125]);
    }

    #[test]
    fn equation_17_is_one_below_a_half_and_two_from_there() {
        let factors = [0.0, 0.499, 0.5, 0.999].map(teaching_factor);
        assert_eq!(factors, [1.0, 1.0, 2.0, 2.0]);
    }

    #[test]
    fn equation_18_goes_to_a_better_partner_and_away_from_a_worse_one() {
        let mut new = R;
        learn_from_partner(&OLD, &TEACHER, true, &mut new);
        assert_eq!(new, [2.0, -1.0, 0.5]);
        new = R;
        learn_from_partner(&OLD, &TEACHER, false, &mut new);
        assert_eq!(new, [0.0, -3.0, 0.5]);
    }

    #[test]
    fn equations_19_and_20_scatter_about_the_middle() {
        let mut new = N;
        scatter_about_middle(&OLD, &TEACHER, &mut new);
        // 2 - 3/2 * 2; 0 + 1/2 * 4; 1/2 + 2 * 0.
        assert_eq!(new, [-1.0, 2.0, 0.5]);
    }

    #[test]
    fn equations_21_and_22_mutate_about_the_student() {
        let mut new = N;
        mutate_about_self(&OLD, &TEACHER, &mut new);
        // 1 - 3/2 * 2; -2 + 1/2 * 4; 1/2 + 2 * 0.
        assert_eq!(new, [-2.0, 0.0, 0.5]);
        // The distance counts, not its sign.
        new = N;
        mutate_about_self(&OLD, &[-1.0, -6.0, 0.5], &mut new);
        assert_eq!(new, [-2.0, 0.0, 0.5]);
    }
}
