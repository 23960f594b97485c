//! The logs and the stage that ship with the program; `data/README.md` says how they were made.

use super::stage::Stage;

/// 57,000 rows of the paper's protocol, gzip-compressed CSV.
pub const LOG_GZ: &[u8] = include_bytes!("../../data/paper.csv.gz");
/// 15,001 rows of the same stage: one run of 30 s, all six axes moving at once.
pub const RUN_GZ: &[u8] = include_bytes!("../../data/run30.csv.gz");
/// 8,000 rows of the same stage in service, with its true pose as reference.
pub const SERVICE_GZ: &[u8] = include_bytes!("../../data/service.csv.gz");
/// The stage as designed.
pub const STAGE_TOML: &str = include_str!("../../data/stage.toml");

/// The stage as designed.
///
/// # Panics
/// Never: it is sound.
pub fn stage() -> Stage {
    Stage::from_toml(STAGE_TOML, "stage.toml".as_ref()).expect("sound")
}

/// The logs, and the stage, by the names of their files.
pub const FILES: [(&str, &[u8]); 4] = [
    ("paper.csv.gz", LOG_GZ),
    ("run30.csv.gz", RUN_GZ),
    ("service.csv.gz", SERVICE_GZ),
    ("stage.toml", STAGE_TOML.as_bytes()),
];
