//! The estimation problem of a Hall-sensor array, its solvers, and simulated stages.
#![forbid(unsafe_code)]

use hall_input::{input, interrupt, progress, statistics};

pub mod problem;
pub mod simulate;
pub mod solve;
