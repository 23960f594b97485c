//! What the stage controller does, apart from the chip that it does it on.
//!
//! ```text
//! timer --Schedule--> trigger --207 us--> Acquisition --RawFrame--> Node --frames--> Outbox --> CAN
//!                                          CAN commands --> Node          Telemetry <-- Node
//! ```
//!
//! | module | what it holds |
//! |---|---|
//! | [`schedule`] | ticks at multiples of 2 ms, and those that were missed |
//! | [`acquisition`] | a converter that is started, read, and started again after faults |
//! | [`store`] | two slots of flash, of which one takes a blob while the other one stays |
//! | [`records`] | which parameters run, and new ones that come over the bus |
//! | [`node`] | one tick: decode, report, obey |
//! | [`light`] | what the LED shows |
//! | [`outbox`] | frames that wait for a mailbox |
//! | [`telemetry`] | what a debugger reads |
//! | [`start_up`] | what is known of the run that a reset ended |
//! | [`retained`] | what survives a reset: the last fault, what ran, the zero deviation |
//! | [`fpu`] | the rounding mode that the decoder relies on |
//!
//! The program around it is `main.rs`; pins, clocks and bit timing are in `board.rs`.
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
