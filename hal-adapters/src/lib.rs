//! Between the runtime and the world: converters on SPI, the CAN protocol of the stage, and
//! what a computer needs to take part in it.
//!
//! The crate is `no_std`, allocates nothing and reads no clock: time arrives as data. Only
//! [`socketcan`] needs an operating system.
//!
//! | module | what it holds |
//! |---|---|
//! | [`adc`] | converters on SPI: codes to raw frames |
//! | [`can`] | frames, signals and identifiers; coding, protection, assembly of a tick |
//! | [`candump`] | one line of a `candump -L` log, read and written |
//! | `socketcan` | SocketCAN on Linux (feature `socketcan`) |
#![no_std]
#![forbid(unsafe_code)]

#[cfg(all(target_os = "linux", feature = "socketcan"))]
extern crate std;

pub mod adc;
pub mod can;
pub mod candump;
#[cfg(all(target_os = "linux", feature = "socketcan"))]
pub mod socketcan;
