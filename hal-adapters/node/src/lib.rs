//! The stage controller, apart from its chip.
//!
//! ```text
//! timer --Schedule--> trigger --207 us--> Acquisition --RawFrame--> Node --frames--> Outbox --> CAN
//!                                          CAN commands --> Node          Telemetry <-- Node
//! ```
//!
//! | module | content |
//! |---|---|
//! | [`schedule`] | ticks at multiples of 2 ms, and missed ticks |
//! | [`acquisition`] | reads the converter, and restarts it after faults |
//! | [`store`] | two slots of flash: one takes a blob while the other stays |
//! | [`records`] | the parameters that run, and new ones from the bus |
//! | [`node`] | one tick: decode, report, obey |
//! | [`light`] | the LED |
//! | [`outbox`] | frames that wait for a mailbox |
//! | [`telemetry`] | the pose for a debugger |
//! | [`start_up`] | how a start uses the record of the run before it |
//! | [`retained`] | the record that survives a reset: last fault, running parameters, zero deviation |
//! | [`fpu`] | the rounding mode of the decoder |
//!
//! A program for a chip is around it: `runtime/firmware` for the STM32F405.
#![no_std]
#![deny(unsafe_code)]

pub mod acquisition;
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
