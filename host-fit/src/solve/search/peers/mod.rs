//! Well-known searches to compare with: random draws, differential evolution, particle swarm,
//! genetic algorithm, CMA-ES.
//!
//! CMA-ES comes from the `cmaes` crate. The other four are written here, in their textbook
//! form, since a fair comparison needs what no crate at hand has together: candidates
//! evaluated a population at a time (so that they run in SIMD lanes and on all cores, as
//! TLBO's do), a random stream for each individual (the same path at any thread count), and
//! NaN that ranks worst.

pub mod cmaes;
pub mod de;
pub mod ga;
pub mod pso;
pub mod random;
