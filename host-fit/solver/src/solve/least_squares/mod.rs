//! Models of the paper by least squares of the pose.
//!
//! | file | what it holds |
//! |---|---|
//! | [`rows`] | pose errors of rows with their derivatives by the parameters |
//! | [`gains`] | the linear form: an arbitrary gain in place of lever arms, angles and eta |
//! | [`solve`](mod@solve) | the fit: a start from a regression, then [`gauss_newton`](super::gauss_newton) |

pub mod gains;
pub mod rows;
pub mod solve;

#[cfg(test)]
mod tests;
