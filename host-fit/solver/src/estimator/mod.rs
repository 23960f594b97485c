//! The estimator: every model of a Hall-sensor array fitted to the rows of a log, with its uncertainty.
//!
//! | file | what it holds |
//! |---|---|
//! | [`model`] | the models: the terms that each fits |
//! | [`terms`] | the 81 parameters of the field model: names, units, prior |
//! | [`parameters`] | their values, and the decoder's constants |
//! | `paper_terms` | the 18 terms of the paper: names, units, which model has them |
//! | [`paper`] | the 18 parameters of Models (12) to (31), and their search ranges |
//! | [`draw`] | the rows that a fit draws |
//! | [`rows`] | the rows of a log |
//! | `derivatives` | acceleration from rows |
//! | [`dynamics`] | what motion adds to the readings: lags of the probes, acceleration |
//! | [`blocks`] | residuals and derivatives of rows, as means over a few |
//! | [`probe`] | what a probe reads, with derivatives |
//! | [`gauss_newton`] | damped Gauss-Newton with a prior, for all models |
//! | [`problem`] | stage, model and rows of a fit by the pose |
//! | [`pose`] | Models (12) to (31) by the errors of the pose |
//! | [`linear`] | their linear form: an arbitrary gain in place of lever arms, angles and eta |
//! | [`least_squares`] | their fit |
//! | [`sandwich`] | their standard errors, and the lags of reference and probes |
//! | [`zero_deviation`] | the zero deviation of each movement |
//! | [`robust`] | rows that the model does not explain count less |
//! | [`whiten`] | the normal equations of the field model under drift |
//! | [`noise`] | noise from residuals |
//! | [`field`] | the fit of the field model, step by step |
//! | [`temperature`] | the temperatures that determine k and h, and how well |
//! | [`posterior`] | covariance of parameters and of a pose |
//! | [`service`] | errors in service, and the choice of the model |
//! | [`update`] | a few seconds of log on top of an old posterior |
//! | [`forecast`] | the posterior of a log that is not recorded yet |
//! | [`clocks`] | two clocks, from the motion that both saw |

pub mod blocks;
pub mod clocks;
pub mod derivatives;
pub mod draw;
pub mod dynamics;
pub mod error;
pub mod field;
pub mod forecast;
pub mod gauss_newton;
pub mod least_squares;
pub mod linear;
pub mod model;
pub mod noise;
pub mod paper;
pub mod paper_terms;
pub mod parameters;
pub mod pose;
pub mod posterior;
pub mod probe;
pub mod problem;
pub mod robust;
pub mod rows;
#[cfg(test)]
mod sample_for_tests;
pub mod sandwich;
pub mod service;
#[cfg(test)]
pub mod synthetic_for_tests;
pub mod temperature;
pub mod terms;
#[cfg(test)]
mod tests;
pub mod update;
pub mod whiten;
pub mod zero_deviation;
