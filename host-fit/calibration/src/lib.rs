//! Fits, judges, plans and diagnoses the calibration of a Hall-sensor array.
#![forbid(unsafe_code)]

pub mod diagnose;
pub mod fit;
pub mod judge;
pub mod plan;
pub mod recalibrate;
pub mod words;
