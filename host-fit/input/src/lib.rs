//! What a fit starts from: the stage as designed, and its logs as rows in SI units.
//!
//! ```
//! use hallstage_input::log::{self, ReadOptions};
//! use hallstage_input::shipped::{RUN_GZ, STAGE_TOML};
//! use hallstage_input::stage::Stage;
//!
//! let stage = Stage::from_toml(STAGE_TOML, "stage.toml".as_ref())?;
//! // `log::read` reads files.
//! let reading = log::read_bytes(RUN_GZ, "run30.csv.gz".as_ref(), &stage, &ReadOptions::FIT)?;
//! assert_eq!(reading.dataset.rows.len(), 15_001);
//! assert_eq!(reading.dataset.movements.len(), 1);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
#![forbid(unsafe_code)]

pub mod axis;
pub mod channel;
pub mod channels;
pub mod dataset;
pub mod draft;
mod encoding;
pub mod finding;
pub mod log;
pub mod log_format;
pub mod other_format;
mod resets;
pub mod rotation;
mod sample;
pub mod shipped;
pub mod source;
pub mod stage;
pub mod statistics;
pub mod text;
pub mod watch;
