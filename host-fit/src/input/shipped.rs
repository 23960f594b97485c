//! The log and the stage that ship with the program; `data/README.md` says how they were made.

/// 57,000 rows of the paper's protocol, gzip-compressed CSV.
pub const LOG_GZ: &[u8] = include_bytes!("../../data/paper.csv.gz");
/// The stage as designed.
pub const STAGE_TOML: &str = include_str!("../../data/stage.toml");
