//! Fits, judges, plans and diagnoses the calibration of a Hall-sensor array.
#![forbid(unsafe_code)]

use hall_input::{finding, input, interrupt, progress, statistics};
use hall_solver::{problem, simulate, solve};

pub mod diagnose;
pub mod fit;
pub mod judge;
pub mod plan;
pub mod recalibrate;
#[cfg(test)]
#[path = "../../solver/src/problem/synthetic_for_tests.rs"]
mod synthetic;
