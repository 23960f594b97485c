//! A simulated stage: magnets and their fields, a rigid body, sensors with noise and drift.
//!
//! A lab rehearses a calibration with it before the stage exists, and tests compare a fit with the
//! truth. The simulation uses none of the models that are fitted.
//!
//! | module | content |
//! |---|---|
//! | [`magnet`] | the field of a magnetised cuboid |
//! | [`pose`] | position and orientation of a rigid stage |
//! | [`probe`] | a Hall probe over its magnet: from pose to signal |
//! | [`assembly`] | a stage with drawn tolerances |
//! | [`dynamics`] | probes that are late, stray fields of coils, arms that bend |
//! | [`protocol`], [`plan_file`] | its motion |
//! | [`sensors`] | noise, drift, resets, converters, beams |
//! | [`thermal`] | the effect of temperature on its parts, a working day |
//! | [`recording`] | all steps in a row: the log in memory |
//! | [`log_text`] | the log and the truth as CSV |
//! | [`random`] | random numbers that are the same on every machine |
//!
//! A seed is a stage: all protocols and plans with one seed run on the same stage, each with its own
//! noise. The same seed gives the same bytes on every machine.
//!
//! Vibration and the errors of the servo are not simulated.
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
pub mod dynamics;
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
