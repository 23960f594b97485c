//! The estimation problem of a Hall-sensor array and its solvers.
#![forbid(unsafe_code)]

pub mod problem;
pub mod solve;
pub mod statistics;
