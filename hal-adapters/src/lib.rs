//! What stands between the runtime and the world: sources of frames, sinks of poses, the CAN
//! protocol of the stage, and wrappers that inject faults and record.
//!
//! The crate is `no_std`, allocates nothing and reads no clock: time arrives as data.
//!
//! | module | what it holds |
//! |---|---|
//! | [`source`] | the trait [`FrameSource`], and a source over a slice |
//! | [`adc`] | converters on SPI: codes to raw frames |
//! | [`can`] | frames, signals and identifiers; coding, protection, assembly of a tick |
//! | [`candump`] | one line of a `candump -L` log, read and written |
//! | [`fault`] | a source that drops, repeats, delays and damages, by a seed |
//! | [`record`] | a source that shows every frame to a recorder |
//! | [`socketcan`] | SocketCAN on Linux (feature `socketcan`) |
#![no_std]
#![forbid(unsafe_code)]

#[cfg(feature = "std")]
extern crate std;

pub mod adc;
pub mod can;
pub mod candump;
pub mod fault;
pub mod record;
#[cfg(all(target_os = "linux", feature = "socketcan"))]
pub mod socketcan;
pub mod source;

pub use source::FrameSource;
