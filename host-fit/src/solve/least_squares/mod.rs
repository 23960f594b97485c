//! Least squares with everything linear projected out.
//!
//! | file | what it holds |
//! |---|---|
//! | [`scatter`] | one pass over the rows: the sums that everything else needs |
//! | [`moments`] | the same sums for any ratios, where the vertical pose stands still within each movement |
//! | [`normal`] | cost, gradient and curvature in x = (G, r) |
//! | [`coordinates`] | x itself, or the 18 parameters in their box |
//! | [`descend`] | the damped Gauss-Newton steps |
//! | [`multistart`] | several starts on few rows, the finish on all |
//!
//! Our own, and not the `levenberg-marquardt` or `varpro` crate, because both want the Jacobian
//! of every row in memory: `cargo bench -p host-fit --bench least_squares` prints both.

pub mod coordinates;
pub mod descend;
pub mod moments;
pub mod multistart;
pub mod normal;
pub mod scatter;

#[cfg(test)]
mod tests;
