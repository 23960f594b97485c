//! What a fit starts from: the stage as designed, and its logs as rows in SI units.

pub mod dataset;
pub mod log;
pub mod shipped;
pub mod source;
pub mod stage;
