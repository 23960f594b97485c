//! Reads logged data of a stage, fits its calibration, judges it and writes the parameter
//! blob for the firmware. The command line is a thin shell over this library.
//!
//! Below it stand four crates, each of which knows only the crates before it, so that a change is built quickly:
//! [`input`] (files to rows), [`simulate`] (a stage made of physics), [`solver`] (the estimate), [`calibration`]
//! (fit, judgement, diagnosis). The groups of modules here follow the way of the data, too; each knows only those above it.
//!
//! | group | what it does |
//! |---|---|
//! | [`output`] | blobs, pose files and images for flash tools, written whole or not at all |
//! | [`report`] | JSON, tables, plots, an HTML page |
//! | [`calibrate`] | what the commands decide: used, refused or forced |
//! | [`arguments`] | numbers, choices and the stage file, as commands take them |
//! | [`diff`] | what changed between two blobs |
//! | [`scope`] | sensors as traces in a terminal |
//! | [`trend`] | how the calibrations of a stage change |
//! | [`bus`] | the stage on a CAN bus: decoded as it comes, recorded, updated |
//! | [`join`] | records of the sensors and of the reference with their clocks, made into a log |
//! | [`cli`] | the commands |
#![forbid(unsafe_code)]

pub use {
    hallstage_calibration as calibration, hallstage_input as input, hallstage_simulate as simulate,
    hallstage_solver as solver,
};

pub mod arguments;
pub mod bus;
pub mod calibrate;
pub mod cli;
pub mod diff;
pub mod join;
pub mod output;
pub mod report;
pub mod scope;
pub mod trend;
