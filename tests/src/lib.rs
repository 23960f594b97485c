//! What the checks across crates and machines share.
//!
//! | module | what |
//! |---|---|
//! | [`flash_model`] | two sectors of flash, and cuts of the power |
//! | [`job`] | frames in, words out: the files that host and target exchange |
//! | [`motion`] | frames for a job: a log, random codes, random words |
//! | [`compare`] | the host's words of a job beside the target's |
//! | [`fault`] | frames dropped, repeated, delayed and damaged on the way, by a seed |
//! | [`random`] | random numbers that depend on a seed alone |
//! | [`node`] | a node that takes new parameters over the bus |

use stage_node::store::Slots;
use std::error::Error;
use std::process::ExitCode;

pub mod compare;
pub mod fault;
#[path = "../../hal-adapters/node/tests/flash_model/mod.rs"]
pub mod flash_model;
pub mod job;
pub mod motion;
pub mod node;
pub mod random;

/// How the program `name` ends: well, with a failed check, or with an error that is printed.
pub fn exit(name: &str, outcome: Result<bool, Box<dyn Error>>) -> ExitCode {
    match outcome {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::FAILURE,
        Err(error) => {
            eprintln!("{name}: {error}");
            ExitCode::from(3)
        }
    }
}
