//! Reads logged data of a stage, fits its calibration, judges it and writes the parameter
//! blob for the firmware. The command line is a thin shell over this library.
//!
//! Modules in the order of the data:
//!
//! | module | step |
//! |---|---|
//! | [`stage`] | `stage.toml`: designed geometry, scales, search ranges |
//! | [`log`] | CSV or CSV.gz logs, checked cell by cell |
//! | [`dataset`] | a log as rows in SI units, by movement |
//! | [`pose_file`] | a log decoded by the runtime, as text |
//! | [`output`] | files written whole or not at all |
//! | [`error`] | all of it with the exit status that it leads to |

pub mod dataset;
pub mod error;
pub mod fit;
pub mod identify;
pub mod judge;
pub mod least_squares;
pub mod log;
pub mod output;
pub mod parameters;
pub mod pose_file;
pub mod precision;
pub mod problem;
pub mod report;
pub mod shipped;
pub mod solver;
pub mod stage;
pub mod statistics;
pub mod synthetic;
pub mod train;
pub mod uncertainty;
pub mod zero_deviation;
