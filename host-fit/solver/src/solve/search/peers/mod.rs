//! Well-known searches to compare with: random draws, differential evolution, particle swarm,
//! genetic algorithm, CMA-ES.
//!
//! All are written here, in their textbook form: no crate that we found evaluates a population on all
//! cores, as TLBO's is, gives each individual a random stream of its own (the same path at any
//! thread count) and ranks NaN worst, and without that the comparison would not be fair.

pub mod cmaes;
pub mod de;
pub mod ga;
pub mod pso;
pub mod random;
