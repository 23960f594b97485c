//! Reads logged data of a stage, fits its calibration, judges it and writes the parameter
//! blob for the firmware. The command line is a thin shell over this library.
//!
//! Modules in the order of the data, the steps of the main job:
//!
//! | module | step |
//! |---|---|
//! | [`stage`] | `stage.toml`: designed geometry, scales, search ranges |
//! | [`log`] | CSV or CSV.gz logs, checked cell by cell |
//! | [`dataset`] | a log as rows in SI units, by movement |
//! | [`train`] | which rows the fit uses |
//! | [`problem`], [`parameters`] | what is minimised, over which unknowns |
//! | [`solver`], [`least_squares`] | how |
//! | [`objective`], [`search`], [`population`] | the fitness as a function, SHTLBO and its relatives, both as a solver |
//! | [`zero_deviation`] | each movement's offset in closed form |
//! | [`uncertainty`], [`identify`] | standard errors; whether the log determines the model |
//! | [`judge`], [`statistics`], [`precision`] | errors by the target's own decoder |
//! | [`fit`] | all of these in a row |
//! | [`compare`] | the solvers beside each other |
//! | [`report`] | JSON, tables, plots, an HTML page |
//! | [`blob_file`], [`pose_file`], [`output`] | files, written whole or not at all |
//! | [`error`] | all of it with the exit status that it leads to |
//! | [`interrupt`] | Ctrl-C |
//! | [`cli`], [`demo`], [`shipped`] | the commands, and the log that ships with them |
//! | [`live`], [`replay`], [`import`] | the stage on a CAN bus: decoded as it comes, played from a log, made into a log |
//! | [`synthetic`] | logs whose true parameters are known |
#![forbid(unsafe_code)]

pub mod blob_file;
pub mod cli;
pub mod compare;
pub mod dataset;
pub mod demo;
pub mod error;
pub mod export;
pub mod fit;
pub mod identify;
pub mod import;
pub mod interrupt;
pub mod judge;
pub mod least_squares;
pub mod live;
pub mod log;
pub mod objective;
pub mod output;
pub mod parameters;
pub mod population;
pub mod pose_file;
pub mod precision;
pub mod problem;
pub mod replay;
pub mod report;
pub mod search;
pub mod shipped;
pub mod solver;
pub mod stage;
pub mod statistics;
pub mod synthetic;
pub mod train;
pub mod uncertainty;
pub mod zero_deviation;
