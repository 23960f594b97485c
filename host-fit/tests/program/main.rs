//! The program from the command line, in one test program: linking one for each file would take longer
//! than all the tests.
#![allow(missing_docs, reason = "not a library")]

mod bad_input;
mod common;
mod diagnose;
mod field_model;
mod generated_logs;
mod interrupted;
mod killed;
mod log_forms;
mod main_job;
mod outputs;
mod plan;
mod recalibrate;
mod robust;
mod searches;
mod temperature;
mod terminal;
mod trend;
