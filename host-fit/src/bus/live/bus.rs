//! The interface: SocketCAN on Linux, a plain refusal elsewhere.

use crate::bus::BusAddress;
use hal_adapters::can::{BusFrame, Message, StampedFrame};
use std::time::{Duration, SystemTime};

/// Why the bus cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum BusError {
    /// What SocketCAN says.
    #[cfg(target_os = "linux")]
    #[error("{0}")]
    SocketCan(#[from] hal_adapters::socketcan::SocketCanError),
    /// This system has no SocketCAN.
    #[cfg(not(target_os = "linux"))]
    #[error(
        "a CAN bus needs SocketCAN, which only Linux has; on this system use a log of the bus with `import`"
    )]
    NoSocketCan,
}

impl BusError {
    /// Whether the interface is only down, and may come up again.
    pub(crate) const fn is_down(&self) -> bool {
        #[cfg(target_os = "linux")]
        if let Self::SocketCan(hal_adapters::socketcan::SocketCanError::Down { .. }) = self {
            return true;
        }
        false
    }

    /// Whether only this frame was not sent, because the transmit queue stayed full.
    pub(crate) const fn is_queue_full(&self) -> bool {
        #[cfg(target_os = "linux")]
        if let Self::SocketCan(hal_adapters::socketcan::SocketCanError::QueueFull { .. }) = self {
            return true;
        }
        false
    }
}

/// Now, on the clock of the kernel's receive times, us.
pub(crate) fn now_us() -> u64 {
    let since = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH);
    since.map_or(0, |d| u64::try_from(d.as_micros()).unwrap_or(u64::MAX))
}

/// One CAN interface.
#[derive(Debug)]
pub(crate) struct Bus {
    #[cfg(target_os = "linux")]
    socket: hal_adapters::socketcan::SocketCan,
}

#[cfg(target_os = "linux")]
impl Bus {
    /// Opens an interface for the node's frames of `messages`.
    pub(crate) fn open(address: &BusAddress, messages: &[Message]) -> Result<Self, BusError> {
        let BusAddress { interface, node } = address;
        let socket = hal_adapters::socketcan::SocketCan::open(interface, *node, messages)?;
        Ok(Self { socket })
    }

    /// The next frame, waiting for it up to `wait`.
    pub(crate) fn receive(&mut self, wait: Duration) -> Result<Option<StampedFrame>, BusError> {
        Ok(self.socket.receive(wait)?)
    }

    /// Whether a frame has been read from the kernel already, and waits here.
    pub(crate) fn has_frame(&self) -> bool {
        self.socket.has_frame()
    }

    /// Sends frames in this order, waiting up to `deadline` for a place in the queue.
    pub(crate) fn send(&self, frames: &[BusFrame], deadline: Duration) -> Result<(), BusError> {
        Ok(self.socket.send_all(frames, deadline)?)
    }

    /// Frames that the kernel dropped because they were not read in time.
    pub(crate) fn dropped(&self) -> u32 {
        self.socket.dropped()
    }
}

#[cfg(not(target_os = "linux"))]
impl Bus {
    pub(crate) fn open(_address: &BusAddress, _messages: &[Message]) -> Result<Self, BusError> {
        Err(BusError::NoSocketCan)
    }

    pub(crate) fn receive(&mut self, _wait: Duration) -> Result<Option<StampedFrame>, BusError> {
        Err(BusError::NoSocketCan)
    }

    pub(crate) fn has_frame(&self) -> bool {
        false
    }

    pub(crate) fn send(&self, _frames: &[BusFrame], _deadline: Duration) -> Result<(), BusError> {
        Err(BusError::NoSocketCan)
    }

    pub(crate) fn dropped(&self) -> u32 {
        0
    }
}
