//! Between the runtime and the world: converters on SPI, the CAN protocol of the stage,
//! and the bus for a program on Linux.
//!
//! The crate is `no_std`, allocates nothing and reads no clock: time arrives as data. Only
//! `socketcan` needs an operating system. No feature is on by default.
//!
//! | module | feature | what it holds |
//! |---|---|---|
//! | `adc` | `adc` | converters on SPI: codes to raw frames |
//! | `can` | `can` | frames, signals and identifiers; coding, protection, assembly of a tick |
//! | `can::update` | `update` | new parameters over the bus, with a key |
//! | `candump` | `can` | one line of a `candump -L` log, read and written |
//! | `socketcan` | `socketcan` | SocketCAN on Linux |
#![no_std]
#![forbid(unsafe_code)]

#[cfg(all(target_os = "linux", feature = "socketcan"))]
extern crate std;

#[cfg(feature = "adc")]
pub mod adc;
#[cfg(feature = "can")]
pub mod can;
#[cfg(feature = "can")]
pub mod candump;
#[cfg(all(target_os = "linux", feature = "socketcan"))]
pub mod socketcan;
