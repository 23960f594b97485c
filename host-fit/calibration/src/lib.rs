//! Fits, judges, plans and diagnoses the calibration of a Hall-sensor array.
#![forbid(unsafe_code)]

pub mod budget;
pub mod diagnose;
pub mod fit;
pub mod judge;
pub mod plan;
pub mod recalibrate;
#[cfg(test)]
mod service_for_tests;
pub mod words;
