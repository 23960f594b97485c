//! The candidates of each search, against its equations in one dimension.

use super::*;
use crate::solve::search::cost::known::KnownFunction;
use crate::solve::search::mixing::Adaptation;

/// Three students in one dimension, cost = position: teacher 4, mean 8.
const START: [f64; 3] = [8.0, 4.0, 12.0];

/// The step of an individual, with its numbers drawn in the documented order.
fn expected(random: &mut Stream, mixing: Mixing, phase: Phase, k: usize) -> f64 {
    let step = match mixing {
        Mixing::Pure(step) => step,
        Mixing::Hybrid(_) if random.uniform() < 0.5 => Step::Learn,
        Mixing::Hybrid(_) => Step::Mutate,
    };
    let mut others = START.to_vec();
    let old = others.remove(k);
    let other = match phase {
        Phase::Learner => others[usize::from(random.uniform() >= 0.5)],
        _ => 4.0,
    };
    match (step, phase) {
        // Towards a lower partner, away from a higher one.
        (Step::Learn, Phase::Learner) => old - random.uniform() * (other - old).abs(),
        (Step::Learn, _) => {
            let factor = if random.uniform() < 0.5 { 1.0 } else { 2.0 };
            old + random.uniform() * (other - factor * 8.0)
        }
        (Step::Scatter, _) => (old + other) / 2.0 + random.normal() * (other - old).abs(),
        (Step::Mutate, _) => old + random.normal() * (other - old).abs(),
    }
}

#[test]
fn each_search_takes_its_equations() {
    let function = KnownFunction::new(1, 0.0, 100.0, |x| x[0]);
    for mixing in [
        Mixing::Pure(Step::Learn),
        Mixing::Pure(Step::Scatter),
        Mixing::Pure(Step::Mutate),
        Mixing::Hybrid(Adaptation::DeclineRatio),
    ] {
        for seed in 0..20 {
            let start = START.map(|x| vec![x]);
            let mut population = Population::new(mixing, seed, &function, 3, &start);
            for phase in [Phase::Teacher, Phase::Learner] {
                population.make_candidates(1, phase);
                for (k, candidate) in population.candidates.iter().enumerate() {
                    let want = expected(&mut stream(seed, 1, phase, k), mixing, phase, k);
                    let found = candidate.place[0];
                    assert!((found - want).abs() < 1e-12, "{mixing:?} {phase:?} {k}");
                }
            }
        }
    }
}

/// "Once p updates, ns1, ns2, nf1 and nf2 would be reset" (section 4.2).
#[test]
fn p_does_not_change_in_a_generation_that_improves_nothing() {
    let function = KnownFunction::new(1, 0.0, 100.0, |x| x[0]);
    let shtlbo = Mixing::Hybrid(Adaptation::DeclineRatio);
    let start = START.map(|x| vec![x]);
    let mut population = Population::new(shtlbo, 1, &function, 3, &start);
    (1..100).for_each(|number| population.run_generation(number));
    // All students are at the end of the box.
    assert_eq!(population.best().cost, 0.0);
    let p = population.p();
    assert!(p.is_some_and(|p| p != P_START));
    (100..103).for_each(|number| population.run_generation(number));
    assert_eq!(population.p(), p);
}
