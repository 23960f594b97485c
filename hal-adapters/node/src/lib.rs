//! The stage controller, apart from its chip.
//!
//! ```text
//! timer --Schedule--> trigger --207 us--> Acquisition --RawFrame--> Node --frames--> Outbox --> CAN
//!                                          CAN commands --> Node          Telemetry <-- Node
//! ```
//!
//! | module | content |
//! |---|---|
//! | [`controller`] | the start, and the two halves of a tick: all that follows together |
//! | [`board`] | clock, watchdog, light, random numbers: a trait for chip and board |
//! | [`schedule`] | ticks at multiples of a period, and missed ticks |
//! | [`acquisition`] | reads the converter, and restarts it after faults |
//! | [`store`] | two slots of flash: one takes a blob while the other stays |
//! | [`records`] | the parameters that run, and new ones from the bus |
//! | [`node`] | one tick: decode, report, obey |
//! | [`light`] | the LED |
//! | [`bus`], [`outbox`] | a trait for CAN controllers; frames that wait for a mailbox |
//! | [`telemetry`] | the pose for a debugger |
//! | [`start_up`] | how a start uses the record of the run before it |
//! | [`retained`] | the record that survives a reset: last fault, running parameters, zero deviation |
//! | [`constants`] | the decoder in RAM, checked a word a tick |
//! | [`fpu`] | the rounding mode of the decoder |
//!
//! # Another chip
//!
//! A program sets up clocks, pins and peripherals, and hands [`controller::Controller::start`] four things: a converter
//! ([`hal_adapters::adc::FrameSampler`]), a CAN controller ([`bus::Can`]), flash that may be programmed twice
//! ([`embedded_storage::nor_flash::MultiwriteNorFlash`]), and a [`board::Board`]. Then it calls
//! [`controller::Controller::turn`] on time. `runtime/firmware` does so for
//! the STM32F405, and `examples/rp2350` beside this crate for the RP2350.
#![no_std]
#![deny(unsafe_code)]

pub mod acquisition;
pub mod board;
pub mod bus;
#[allow(unsafe_code)] // reads a word of memory; see its text
pub mod constants;
pub mod controller;
#[allow(unsafe_code)] // a register of the FPU; see its text
pub mod fpu;
pub mod light;
pub mod node;
pub mod outbox;
pub mod records;
pub mod retained;
pub mod schedule;
pub mod start_up;
pub mod store;
#[allow(unsafe_code)] // a symbol name that a debugger finds; see its text
pub mod telemetry;
