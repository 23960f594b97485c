//! Reads logged data of a stage, fits its calibration, judges it and writes the parameter
//! blob for the firmware. The command line is a thin shell over this library.
//!
//! Groups of modules in the way of the data; each knows only those above it. Those above `output` stand in
//! crates of their own, so that a change is built quickly: `hall-input`, `hall-solver`, `hall-calibration`.
//!
//! | group | what it does |
//! |---|---|
//! | [`interrupt`] | Ctrl-C |
//! | [`progress`] | how far a long step is, on a terminal |
//! | [`statistics`] | medians, quantiles, noise from differences |
//! | [`finding`] | what is wrong with a log: codes, severities, remedies |
//! | [`input`] | `stage.toml` and logs to rows in SI units, by movement |
//! | [`problem`] | what is minimised: rows drawn, parameters, zero deviations |
//! | [`simulate`] | logs of a stage made of physics, to rehearse a calibration |
//! | [`solve`] | how: least squares, SHTLBO and its relatives |
//! | [`plan`] | the run to make for the field model, and what to expect of it |
//! | [`judge`] | errors by the target's own decoder, standard errors, what the log leaves open |
//! | [`fit`] | all steps in a row |
//! | [`diagnose`] | what is wrong with a log, beyond what the fit itself finds |
//! | [`recalibrate`] | an old calibration brought up to date by a few seconds of log |
//! | [`output`] | blobs, pose files and images for flash tools, written whole or not at all |
//! | [`report`] | JSON, tables, plots, an HTML page |
//! | [`calibrate`] | what the commands decide: used, refused or forced |
//! | [`compare`] | the solvers beside each other |
//! | [`diff`] | what changed between two blobs |
//! | [`bus`] | the stage on a CAN bus: decoded as it comes, played from a log, made into a log |
//! | [`cli`] | the commands |
#![forbid(unsafe_code)]

pub use hall_calibration::{diagnose, fit, judge, plan, recalibrate};
pub use hall_input::{finding, input, interrupt, progress, statistics};
pub use hall_solver::{problem, simulate, solve};

pub mod bus;
pub mod calibrate;
pub mod cli;
pub mod compare;
pub mod diff;
pub mod output;
pub mod report;
