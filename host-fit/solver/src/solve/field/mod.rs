//! The field model: maximum a posteriori of its 81 parameters, and their uncertainty.
//!
//! | file | what it holds |
//! |---|---|
//! | [`terms`] | the parameters: names, units, prior |
//! | [`parameters`] | their values, and the decoder's constants |
//! | [`probe`] | what a probe reads, with derivatives |
//! | [`blocks`] | rows and their means over a few |
//! | [`pose`] | Models (12) to (31) by the errors of the pose |
//! | [`linear`] | their linear form: an arbitrary gain in place of lever arms, angles and eta |
//! | [`least_squares`] | their fit |
//! | [`sandwich`] | their standard errors, and the lag of the reference |
//! | [`warmth`] | which temperatures determine k and h, and how well |
//! | [`whiten`] | the normal equations under drift |
//! | [`noise`] | noise from residuals |
//! | [`fit`] | the steps in a row |
//! | [`posterior`] | covariance of parameters and of a pose |
//! | [`carry`] | whether the log can carry the model |
//! | [`clocks`] | two clocks, from the motion that both saw |
//! | [`forecast`] | the posterior of a log that is not recorded yet |
//! | [`update`] | a few seconds of log on top of an old posterior |

pub mod blocks;
pub mod carry;
pub mod clocks;
pub mod error;
pub mod fit;
pub mod forecast;
pub mod least_squares;
pub mod linear;
pub mod noise;
pub mod parameters;
pub mod pose;
pub mod posterior;
pub mod probe;
#[cfg(test)]
mod sample_for_tests;
pub mod sandwich;
pub mod terms;
#[cfg(test)]
mod tests;
pub mod update;
pub mod warmth;
pub mod whiten;
