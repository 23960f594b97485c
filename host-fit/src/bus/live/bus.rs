//! The interface: SocketCAN on Linux, a plain refusal elsewhere.

#[cfg(target_os = "linux")]
pub use hal_adapters::socketcan::{SocketCan as Bus, SocketCanError as BusError};
#[cfg(not(target_os = "linux"))]
pub use none::{Bus, BusError};
use std::time::SystemTime;

/// Now, on the clock of the kernel's receive times, us.
pub(crate) fn now_us() -> u64 {
    let since = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH);
    since.map_or(0, |d| u64::try_from(d.as_micros()).unwrap_or(u64::MAX))
}

/// In place of SocketCAN: a bus that cannot be opened.
#[cfg(not(target_os = "linux"))]
mod none {
    use hal_adapters::can::{BusFrame, Message, NodeNumber, StampedFrame};
    use std::time::Duration;

    /// The errors of SocketCAN that callers handle, and the absence of SocketCAN.
    #[derive(Debug, thiserror::Error)]
    #[error(
        "a CAN bus needs SocketCAN, which only Linux has; on this system use a log of the bus with `join`"
    )]
    pub enum BusError {
        /// There is no SocketCAN.
        NoSocketCan,
        /// The interface is down.
        Down {},
        /// The transmit queue stays full.
        QueueFull {},
    }

    #[derive(Debug)]
    pub struct Bus;

    impl Bus {
        pub fn open(_: &str, _: NodeNumber, _: &[Message]) -> Result<Self, BusError> {
            Err(BusError::NoSocketCan)
        }

        pub fn receive(&mut self, _: Duration) -> Result<Option<StampedFrame>, BusError> {
            Err(BusError::NoSocketCan)
        }

        pub const fn has_frame(&self) -> bool {
            false
        }

        pub fn send_all(&self, _: &[BusFrame], _: Duration) -> Result<(), BusError> {
            Err(BusError::NoSocketCan)
        }

        pub const fn dropped(&self) -> u32 {
            0
        }
    }
}
