//! A population, and a generation of it: what all searches share.
//!
//! A generation has one phase or two. In a phase every individual gets one candidate, made from
//! the population as it was at the start of the phase; all are evaluated together, on any number
//! of threads; then the search says which of them stay.

use super::cost::{CostFunction, clip, ranks_before};
use super::random::{Phase, RandomSource};
use hallstage_input::stage::Range;
use rayon::prelude::*;

/// A point of the box and its cost.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Individual {
    /// One number for each unknown.
    pub place: Vec<f64>,
    /// Its cost.
    pub cost: f64,
}

/// The index of the individual that ranks first, the first of equals; 0 when there is none.
pub fn best_index(population: &[Individual]) -> usize {
    let better = |best: usize, k: usize| {
        let better = ranks_before(population[k].cost, population[best].cost);
        if better { k } else { best }
    };
    (0..population.len()).fold(0, better)
}

/// Replaces each individual by its candidate where that ranks before it.
pub fn improve(population: &mut [Individual], candidates: &mut [Individual]) {
    for (old, new) in population.iter_mut().zip(candidates) {
        if ranks_before(new.cost, old.cost) {
            std::mem::swap(old, new);
        }
    }
}

/// What a candidate is made from.
#[derive(Clone, Copy, Debug)]
pub struct Parents<'p> {
    /// The population at the start of the phase.
    pub population: &'p [Individual],
    /// The box.
    pub bounds: &'p [Range],
    /// The phase.
    pub phase: Phase,
    /// Whose candidate it is: the index of an individual.
    pub k: usize,
}

/// How one search makes candidates and which of them it keeps.
pub trait Breeding: Sync {
    /// What is noted of a candidate when it is made.
    type Note: Default + Send + Sync;

    /// The smallest population that the search can work with.
    const SIZE_MIN: usize = 2;

    /// The phases of a generation.
    const PHASES: &'static [Phase] = &[Phase::Teacher];

    /// Looks at the population before a phase.
    fn begin(&mut self, _population: &[Individual], _bounds: &[Range]) {}

    /// Writes a candidate into `new`, whose content does not matter; it is clipped afterwards.
    fn make(
        &self,
        parents: Parents<'_>,
        random: &mut impl RandomSource,
        new: &mut [f64],
    ) -> Self::Note;

    /// Takes over the evaluated candidates: as a rule each one that is better than its individual.
    fn select(
        &mut self,
        population: &mut [Individual],
        candidates: &mut [Individual],
        _notes: &[Self::Note],
        _bounds: &[Range],
    ) {
        improve(population, candidates);
    }

    /// Learns from a whole generation; they are numbered from 1.
    fn end(&mut self, _generation: usize) {}

    /// p, if the search has one.
    fn p(&self) -> Option<f64> {
        None
    }
}

/// A population that is bred.
pub struct Search<'f, B: Breeding, S> {
    function: &'f dyn CostFunction,
    /// The stream of a generation, a phase and an individual.
    streams: S,
    /// The method.
    pub breeding: B,
    /// The individuals.
    pub population: Vec<Individual>,
    candidates: Vec<Individual>,
    notes: Vec<B::Note>,
    /// Evaluations so far.
    pub evaluations: usize,
    /// How many of them gave NaN.
    pub nan_costs: usize,
}

impl<'f, B: Breeding, R: RandomSource, S: Fn(usize, Phase, usize) -> R + Sync> Search<'f, B, S> {
    /// The first population (generation 0), evaluated: `given`, clipped to the bounds, without
    /// those of a wrong length, then uniform draws from the box; `size` in all, or as many as the
    /// method needs.
    pub fn new(
        breeding: B,
        streams: S,
        function: &'f dyn CostFunction,
        size: usize,
        given: &[Vec<f64>],
    ) -> Self {
        let bounds = function.bounds();
        let size = size.max(B::SIZE_MIN);
        let individual = Individual {
            place: vec![0.0; bounds.len()],
            cost: f64::NAN,
        };
        let mut search = Self {
            function,
            streams,
            breeding,
            population: Vec::new(),
            candidates: vec![individual; size],
            notes: (0..size).map(|_| B::Note::default()).collect(),
            evaluations: 0,
            nan_costs: 0,
        };
        search.evaluate(|search, k, place| {
            match given.get(k).filter(|given| given.len() == place.len()) {
                Some(given) => place.copy_from_slice(given),
                None => (search.streams)(0, Phase::Start, k).fill_within(bounds, place),
            }
            B::Note::default()
        });
        search.population.clone_from(&search.candidates);
        search
    }

    /// Makes, clips and evaluates a candidate of each individual, on the threads of the current
    /// rayon pool where that pays; the outcome is the same on any number of threads.
    fn evaluate(&mut self, make: impl Fn(&Self, usize, &mut [f64]) -> B::Note + Sync) {
        let mut candidates = std::mem::take(&mut self.candidates);
        let mut notes = std::mem::take(&mut self.notes);
        let (function, search) = (self.function, &*self);
        let piece = function.piece();
        let evaluate = |first: usize, candidates: &mut [Individual], notes: &mut [B::Note]| {
            for (k, (candidate, note)) in (first..).zip(candidates.iter_mut().zip(notes)) {
                *note = make(search, k, &mut candidate.place);
                clip(&mut candidate.place, function.bounds());
            }
            function.costs(candidates);
        };
        if candidates.len() <= piece {
            evaluate(0, &mut candidates, &mut notes);
        } else {
            let pieces = candidates.par_chunks_mut(piece);
            let pieces = pieces.zip(notes.par_chunks_mut(piece)).enumerate();
            pieces.for_each(|(k, (candidates, notes))| evaluate(k * piece, candidates, notes));
        }
        self.evaluations += candidates.len();
        self.nan_costs += candidates.iter().filter(|c| c.cost.is_nan()).count();
        (self.candidates, self.notes) = (candidates, notes);
    }

    /// Runs one generation, numbered from 1.
    pub fn generation(&mut self, number: usize) {
        let bounds = self.function.bounds();
        for &phase in B::PHASES {
            self.breeding.begin(&self.population, bounds);
            self.evaluate(|search, k, new| {
                let parents = Parents {
                    population: &search.population,
                    bounds,
                    phase,
                    k,
                };
                let mut random = (search.streams)(number, phase, k);
                search.breeding.make(parents, &mut random, new)
            });
            let (old, new) = (&mut self.population, &mut self.candidates);
            self.breeding.select(old, new, &self.notes, bounds);
        }
        self.breeding.end(number);
    }

    /// The best individual so far.
    pub fn best(&self) -> &Individual {
        &self.population[best_index(&self.population)]
    }
}
