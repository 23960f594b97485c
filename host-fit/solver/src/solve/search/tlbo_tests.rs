//! Whole generations against steps worked by hand, with scripted random numbers.

use super::*;
use crate::solve::search::cost::known::KnownFunction;
use crate::solve::search::mixing::Adaptation;
use crate::solve::search::random::script::{Script, scripted};

/// Three students in one dimension, cost = position: teacher 4, mean 8.
const START: [f64; 3] = [8.0, 4.0, 12.0];

/// The scripts of one generation, each with the uniform and normal numbers of one individual.
fn keyed(
    generation: usize,
    phases: [[Script; 3]; 2],
) -> impl Iterator<Item = ((usize, Phase, usize), Script)> {
    let phases = [Phase::Teacher, Phase::Learner].into_iter().zip(phases);
    phases.flat_map(move |(phase, scripts)| {
        let keyed = move |(k, script)| ((generation, phase, k), script);
        scripts.into_iter().enumerate().map(keyed)
    })
}

/// Where the students are, and p, after one generation for each pair of phases.
fn bred(mixing: Mixing, generations: Vec<[[Script; 3]; 2]>) -> (Vec<f64>, Option<f64>) {
    let function = KnownFunction::new(1, 0.0, 100.0, |x| x[0]);
    let count = generations.len();
    let scripts = (1..).zip(generations);
    let scripts = scripts.flat_map(|(number, phases)| keyed(number, phases));
    let start = START.map(|x| vec![x]);
    let mut population = Population::new(mixing, scripted(scripts.collect()), &function, 3, &start);
    for number in 1..=count {
        population.run_generation(number);
    }
    assert_eq!(population.evaluations, 3 + 6 * count);
    let positions = population.individuals.iter().map(|one| one.place[0]);
    (positions.collect(), population.p())
}

fn generation(
    mixing: Mixing,
    teacher: [Script; 3],
    learner: [Script; 3],
) -> (Vec<f64>, Option<f64>) {
    bred(mixing, vec![[teacher, learner]])
}

fn uniform(numbers: &[f64]) -> Script {
    Script::new(numbers, &[])
}

/// Teacher phase: T_F, r. Learner phase: partner, r.
#[test]
fn tlbo_takes_equations_16_to_18() {
    let teacher = [
        uniform(&[0.5, 0.5]),   // T_F 2: 8 + (4 - 16)/2 = 2, kept
        uniform(&[0.499, 0.5]), // T_F 1: 4 + (4 - 8)/2 = 2, kept
        uniform(&[0.2, 0.25]),  // T_F 1: 12 + (4 - 8)/4 = 11, kept
    ];
    let learner = [
        uniform(&[0.9, 0.25]), // partner 2 (11, worse): 2 + (2 - 11)/4 = -0.25, clipped to 0
        uniform(&[0.0, 0.5]),  // partner 0 (2, equal): 2 + 0 = 2, not better
        uniform(&[0.6, 0.5]),  // partner 1 (2, better): 11 + (2 - 11)/2 = 6.5, kept
    ];
    let (positions, p) = generation(Mixing::Pure(Step::Learn), teacher, learner);
    assert_eq!(positions, [0.0, 2.0, 6.5]);
    assert_eq!(p, None);
}

/// Teacher phase: N. Learner phase: partner, N.
#[test]
fn gbtlbo_takes_equations_19_and_20() {
    let teacher = [
        Script::new(&[], &[-0.25]), // (8 + 4)/2 - 4/4 = 5, kept
        Script::new(&[], &[9.0]),   // the teacher itself: 4 + 9 * 0 = 4, not better
        Script::new(&[], &[1.0]),   // (12 + 4)/2 + 8 = 16, not better
    ];
    let learner = [
        Script::new(&[0.9], &[-0.5]), // partner 2 (12): (5 + 12)/2 - 7/2 = 5, not better
        Script::new(&[0.0], &[-2.5]), // partner 0 (5): 4.5 - 2.5 = 2, kept
        Script::new(&[0.0], &[0.5]),  // partner 0 (5): 8.5 + 3.5 = 12, not better
    ];
    let (positions, p) = generation(Mixing::Pure(Step::Scatter), teacher, learner);
    assert_eq!(positions, [5.0, 2.0, 12.0]);
    assert_eq!(p, None);
}

#[test]
fn mutation_alone_takes_equations_21_and_22() {
    let teacher = [
        Script::new(&[], &[-0.75]), // 8 - 3/4 * 4 = 5, kept
        Script::new(&[], &[-9.0]),  // the teacher itself: 4
        Script::new(&[], &[0.5]),   // 12 + 4 = 16, not better
    ];
    let learner = [
        Script::new(&[0.9], &[-0.5]), // partner 2 (12): 5 - 7/2 = 1.5, kept
        Script::new(&[0.0], &[2.0]),  // partner 0 (5): 4 + 2 = 6, not better
        Script::new(&[0.6], &[-0.5]), // partner 1 (4): 12 - 8/2 = 8, kept
    ];
    let (positions, _) = generation(Mixing::Pure(Step::Mutate), teacher, learner);
    assert_eq!(positions, [1.5, 4.0, 8.0]);
}

/// Teacher phase: rand, then T_F and r or N. Learner phase: rand, partner, then r or N.
fn hybrid_scripts() -> ([Script; 3], [Script; 3]) {
    let teacher = [
        uniform(&[0.25, 0.7, 0.5]), // learns, T_F 2: 8 + (4 - 16)/2 = 2, decline 3/4
        Script::new(&[0.75], &[-0.5]), // mutates: 4 - 0 = 4, fails
        Script::new(&[0.5], &[-1.0]), // 0.5 is not < p, mutates: 12 - 8 = 4, decline 2/3
    ];
    let learner = [
        uniform(&[0.1, 0.0, 0.25]), // learns from 1 (4, worse): 2 - 2/4 = 1.5, decline 1/4
        Script::new(&[0.9, 0.9], &[1.0]), // mutates with 2 (4): 4 + 0 = 4, fails
        uniform(&[0.3, 0.0, 0.5]),  // learns from 0 (2, better): 4 - 2/2 = 3, decline 1/4
    ];
    (teacher, learner)
}

#[test]
fn hybrids_take_equations_23_and_24_and_differ_only_in_p() {
    // Learning: 3 of 3 improved, declines 3/4 + 1/4 + 1/4. Mutation: 1 of 3, decline 2/3.
    let cases = [
        (Adaptation::Fixed, 0.5),
        (
            Adaptation::SuccessRatio,
            (3.0 * 3.0) / (1.0 * 3.0 + 3.0 * 3.0),
        ),
        (
            Adaptation::DeclineRatio,
            (1.25 * 3.0) / (2.0 / 3.0 * 3.0 + 1.25 * 3.0),
        ),
    ];
    for (adaptation, expected) in cases {
        let (teacher, learner) = hybrid_scripts();
        let (positions, p) = generation(Mixing::Hybrid(adaptation), teacher, learner);
        assert_eq!(positions, [1.5, 4.0, 3.0]);
        let p = p.expect("hybrids have a p");
        assert!(
            (p - expected).abs() < 1e-15,
            "{adaptation:?}: {p}, expected {expected}"
        );
    }
}

/// "Once p updates, ns1, ns2, nf1 and nf2 would be reset" (section 4.2).
#[test]
fn an_update_of_p_forgets_what_came_before_it() {
    let (teacher, learner) = hybrid_scripts();
    let still = || Script::new(&[0.9, 0.0], &[1.0]);
    // After the first generation 1.5, 4, 3 and p = 0.65.
    let second = [
        [
            Script::new(&[0.9], &[1.0]),  // the teacher itself: fails
            Script::new(&[0.9], &[-1.0]), // mutates: 4 - 2.5 = 1.5, kept
            uniform(&[0.1, 0.2, 0.0]),    // learns nothing: 3, fails
        ],
        [
            still(),                   // mutates with 1 (1.5): fails
            still(),                   // mutates with 0 (1.5): fails
            uniform(&[0.1, 0.0, 0.0]), // learns nothing: 3, fails
        ],
    ];
    let shtlbo = Mixing::Hybrid(Adaptation::DeclineRatio);
    let (_, p) = bred(shtlbo, vec![[teacher, learner], second]);
    // Of the second generation alone only mutation improved anything.
    assert_eq!(p, Some(0.05));
}
