//! A stage made of physics, so that a lab can rehearse a calibration before it has the stage,
//! and tests know the truth. It assumes no model of this project: a model that fits its logs
//! has earned it.
//!
//! | module | what it does |
//! |---|---|
//! | [`magnet`] | the field of a magnetised cuboid |
//! | [`pose`] | where a rigid stage is |
//! | [`probe`] | a Hall probe over its magnet: from pose to signal |
//! | [`assembly`] | a stage with drawn tolerances |
//! | [`protocol`], [`plan_file`] | how it moves |
//! | [`sensors`] | noise, drift, resets, converters, beams |
//! | [`thermal`] | how its parts follow temperature, and a working day |
//! | [`recording`] | all steps in a row: the log, in memory |
//! | [`log_text`] | the log and the truth as CSV |
//! | [`random`] | numbers that are the same on every machine |
//!
//! A seed names a stage: all protocols and plans of one seed run on the same one, each with its
//! own noise. The same seed gives the same bytes on every machine.
//!
//! Not simulated: vibration, lag between the sensors, and how the servo follows
//! its trajectory.
//!
//! ```
//! # use hallstage_input::shipped::STAGE_TOML;
//! # use hallstage_input::stage::Stage;
//! # let stage = Stage::from_toml(STAGE_TOML, "stage.toml".as_ref())?;
//! use hallstage_simulate::assembly::Assembly;
//! use hallstage_simulate::protocol::Protocol;
//! use hallstage_simulate::recording::record;
//! use hallstage_simulate::sensors::SensorErrors;
//!
//! let run = Protocol::Service.run(stage.servo_period_s, 1);
//! let recording = record(&stage, &Assembly::draw(&stage, 1), run, &SensorErrors::USUAL, 1)?;
//! assert_eq!(recording.rows(), 32_000);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
#![forbid(unsafe_code)]

pub mod assembly;
pub mod log_text;
pub mod magnet;
pub mod plan_file;
pub mod pose;
pub mod probe;
pub mod protocol;
pub mod random;
pub mod recording;
pub mod sensors;
pub mod thermal;
