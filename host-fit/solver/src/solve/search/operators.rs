//! The operators of teaching-learning-based optimization, one function for each equation.
//!
//! Each makes a new individual from an old one, coordinate by coordinate. [`super::tlbo`] clips the
//! new one to the bounds and keeps the better one. Symbols of the paper and the names here:
//!
//! | paper | here |
//! |---|---|
//! | St_ij^old, St_ij^new (a student is an individual) | `old`, `new` |
//! | T_i, Mean_i | `teacher`, `mean`: of the population at the start of the phase |
//! | T_F | `teaching_factor` |
//! | St_ik | `partner`, of the population at the start of the phase |
//! | r_1, rand_3 | r: one number in [0, 1) for each coordinate, in `new` when called |
//! | N(0, 1) | n: one number for each coordinate, in `new` when called |
//!
//! In equations 19 and 20 the paper writes N(mean, d). Its text says that d is the standard deviation,
//! so a random number is mean + d N(0, 1).

/// T_F of equation 17, round(1 + rand): 1 or 2, each half of the time.
pub fn teaching_factor(rand: f64) -> f64 {
    if rand < 0.5 { 1.0 } else { 2.0 }
}

/// Equation 16, the teacher phase of TLBO: old + r (teacher - T_F mean).
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

/// Equation 18, the learner phase of TLBO: towards a better partner, away from any other. (The paper
/// does not define the case of equal costs.)
pub fn learn_from_partner(old: &[f64], partner: &[f64], partner_is_better: bool, new: &mut [f64]) {
    let sign = if partner_is_better { 1.0 } else { -1.0 };
    for (new, (old, partner)) in new.iter_mut().zip(old.iter().zip(partner)) {
        let r = *new;
        *new = old + r * (sign * (partner - old));
    }
}

/// Equation 19 with the teacher as `other`, equation 20 with a partner (GBTLBO): a normal
/// number about the middle of the two, with their distance as its standard deviation.
pub fn scatter_about_middle(old: &[f64], other: &[f64], new: &mut [f64]) {
    for (new, (old, other)) in new.iter_mut().zip(old.iter().zip(other)) {
        let n = *new;
        *new = (old + other) / 2.0 + n * (other - old).abs();
    }
}

/// Equation 21 with the teacher as `other`, equation 22 with a partner (the paper's mutation):
/// a normal number about the old individual, with the distance as its standard deviation.
pub fn mutate_about_self(old: &[f64], other: &[f64], new: &mut [f64]) {
    for (new, (old, other)) in new.iter_mut().zip(old.iter().zip(other)) {
        let n = *new;
        *new = old + n * (other - old).abs();
    }
}
