//! What the checks across crates and machines share.
//!
//! | module | what |
//! |---|---|
//! | [`flash_model`] | two sectors of flash, and what a cut of the power leaves in them |
//! | [`job`] | frames in, words out: the files that host and target exchange |
//! | [`motion`] | frames and parameters for a job: a log, random codes, random words |
//! | [`compare`] | the host's words of a job beside the target's |
//! | [`listing`] | the instructions of an image: stack, cycles, calls |
//! | [`fault`] | frames dropped, repeated, delayed and damaged on the way, by a seed |
//! | [`random`] | random numbers that depend on a seed alone |
//! | [`node`] | a node that takes new parameters over the bus |
//! | [`trace`] | executed instructions, counted from an emulator's log |

use firmware::store::{FlashFault, SLOT_BYTES};

pub mod compare;
pub mod fault;
#[path = "../../runtime/firmware/tests/flash_model/mod.rs"]
pub mod flash_model;
pub mod job;
pub mod listing;
pub mod motion;
pub mod node;
pub mod random;
pub mod trace;
