//! The estimator of a Hall-sensor array's parameters, and the searches of the paper.
#![forbid(unsafe_code)]

pub mod estimator;
pub mod solve;
pub mod statistics;
