//! What a fit starts from: the stage as designed, and its logs as rows in SI units.

mod binary;
pub mod dataset;
pub mod draft;
mod encoding;
pub mod log;
pub mod shipped;
pub mod source;
pub mod stage;
pub(crate) mod text;
mod unpack;
pub mod whole;
