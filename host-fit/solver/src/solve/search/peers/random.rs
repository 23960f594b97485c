//! Random search: uniform draws from the box, of which the best are kept. The baseline that every
//! other search must beat.

use crate::solve::search::population::{Breeding, Parents};
use crate::solve::search::random::RandomSource;

/// A search by random draws.
#[derive(Clone, Copy, Debug)]
pub struct RandomDraws;

impl Breeding for RandomDraws {
    type Note = ();

    fn make(&self, parents: Parents<'_>, random: &mut impl RandomSource, new: &mut [f64]) {
        random.fill_within(parents.bounds, new);
    }
}
