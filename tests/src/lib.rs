//! What the checks across crates and machines share.
//!
//! | module | what |
//! |---|---|
//! | [`job`] | frames in, words out: the files that host and target exchange |
//! | [`motion`] | frames and parameters for a job: a log, random codes, random words |
//! | [`compare`] | the host's words of a job beside the target's |
//! | [`listing`] | the instructions of an image: stack, cycles, calls |
//! | [`node`] | a node that takes new parameters over the bus |
//! | [`trace`] | executed instructions, counted from an emulator's log |

pub mod compare;
pub mod job;
pub mod listing;
pub mod motion;
pub mod node;
pub mod trace;
