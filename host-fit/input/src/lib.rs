//! Reads stage files and logs of a Hall-sensor array as rows in SI units.
#![forbid(unsafe_code)]

pub mod finding;
pub mod input;
pub mod interrupt;
pub mod progress;
pub mod statistics;
