//! SocketCAN: the frames of a Linux CAN interface, with the kernel's receive times.
//!
//! ```no_run
//! use hal_adapters::can::{Layout, NodeNumber, SensorReceiver, Timing};
//! use hal_adapters::socketcan::SocketCan;
//! use std::time::Duration;
//!
//! let layout = Layout::Bits16;
//! let mut bus = SocketCan::open("can0", NodeNumber::default(), layout.messages())?;
//! let mut receiver = SensorReceiver::new(layout, Timing::default());
//! while let Some(stamped) = bus.receive(Duration::from_millis(100))? {
//!     let taken = receiver.take(&stamped.frame, stamped.time_us as u32);
//!     println!("{:?}", taken.tick);
//! }
//! # Ok::<(), hal_adapters::socketcan::SocketCanError>(())
//! ```
//!
//! The kernel delivers only the messages that were asked for, so foreign traffic costs nothing.
//! Frames that the kernel dropped because nobody read them in time are counted
//! ([`SocketCan::dropped`]); the counters of the protocol show that they are missing, too.
//! Sending waits for a full transmit queue (ENOBUFS), up to a deadline.
//!
//! An interface that goes down is reported once by [`SocketCanError::Down`]; when it is up
//! again, the same socket works on.

mod batch;
mod error;

pub use error::SocketCanError;

use crate::can::{BusFrame, Message, NodeNumber, StampedFrame};
use embedded_can::Id;
use error::sort;
use nix::errno::Errno;
use nix::poll::{PollFd, PollFlags, ppoll};
use nix::sys::time::TimeSpec;
use socketcan::{CanAddr, CanFilter, CanSocket, Socket, SocketOptions};
use std::collections::VecDeque;
use std::os::fd::{AsFd, AsRawFd};
use std::string::{String, ToString};
use std::time::{Duration, Instant};
use std::vec::Vec;

/// Receive buffer to ask for: some 10,000 frames. The kernel grants ordinary users less.
const RECEIVE_BUFFER_BYTES: i32 = 8 << 20;

/// Pause before a full transmit queue is tried again: less than two frames at 1 Mbit/s.
const QUEUE_RETRY: Duration = Duration::from_micros(200);

/// Bit of the kernel's identifiers: an extended one.
const EXTENDED: u32 = 0x8000_0000;
/// Mask of a filter that lets one identifier through.
const ONE_MASK: u32 = EXTENDED | 0x1fff_ffff;

/// Socket level, and options that `libc` does not name (the values of all but three rare
/// architectures).
const SOL_SOCKET: i32 = 1;
const SO_RCVBUF: i32 = 8;
const SO_RCVBUFFORCE: i32 = 33;
const SO_MEMINFO: i32 = 55;
/// Index of the drop counter in the answer to `SO_MEMINFO`.
const MEMINFO_DROPS: usize = 8;

/// One CAN interface, for receiving and sending.
#[derive(Debug)]
pub struct SocketCan {
    socket: CanSocket,
    interface: String,
    node: NodeNumber,
    read: VecDeque<StampedFrame>,
}

impl SocketCan {
    /// Opens an interface and asks the kernel for the frames of `messages` of this node only. The
    /// caller sees frames with the identifiers of the table; the bus carries the identifiers of the node.
    ///
    /// # Errors
    /// All variants except `QueueFull`. An interface that is down can be opened; the first read
    /// reports it.
    pub fn open(
        interface: &str,
        node: NodeNumber,
        messages: &[Message],
    ) -> Result<Self, SocketCanError> {
        let failed = |cause| sort(interface, "open it", cause);
        let addr = CanAddr::from_iface(interface).map_err(|_| SocketCanError::NoSuchInterface {
            interface: interface.to_string(),
        })?;
        let socket = CanSocket::open_addr(&addr).map_err(|cause| {
            match cause.raw_os_error().map(Errno::from_raw) {
                Some(Errno::ENODEV) => SocketCanError::NotCan {
                    interface: interface.to_string(),
                },
                _ => failed(cause),
            }
        })?;
        let filters: Vec<CanFilter> = messages
            .iter()
            .map(|message| match node.identifier(*message) {
                Id::Standard(id) => CanFilter::new(id.as_raw().into(), ONE_MASK),
                Id::Extended(id) => CanFilter::new(id.as_raw() | EXTENDED, ONE_MASK),
            })
            .collect();
        socket.set_filters(&filters).map_err(failed)?;
        socket.set_recv_timestamp(true).map_err(failed)?;
        // Only a privileged user gets more than the system's limit; less works, too.
        let buffer = RECEIVE_BUFFER_BYTES;
        let forced = socket.set_socket_option_int(SOL_SOCKET, SO_RCVBUFFORCE, buffer);
        if forced.is_err() {
            let asked = socket.set_socket_option_int(SOL_SOCKET, SO_RCVBUF, buffer);
            asked.map_err(failed)?;
        }
        Ok(Self {
            socket,
            interface: interface.to_string(),
            node,
            read: VecDeque::with_capacity(batch::BATCH),
        })
    }

    /// The next frame, waiting for it up to `wait`; `None` if none came.
    ///
    /// # Errors
    /// `Down`, `Gone`, or `Io`.
    pub fn receive(&mut self, wait: Duration) -> Result<Option<StampedFrame>, SocketCanError> {
        if self.read.is_empty() {
            self.fill()?;
        }
        if self.read.is_empty() && !wait.is_zero() && self.wait_for_frame(wait)? {
            self.fill()?;
        }
        while let Some(StampedFrame { time_us, frame }) = self.read.pop_front() {
            if let Some(frame) = self.node.from_bus(&frame) {
                return Ok(Some(StampedFrame { time_us, frame }));
            }
        }
        Ok(None)
    }

    /// Whether the next [`SocketCan::receive`] returns a frame without a call to the kernel.
    pub fn has_frame(&self) -> bool {
        !self.read.is_empty()
    }

    /// Reads what the kernel has, up to a batch.
    fn fill(&mut self) -> Result<(), SocketCanError> {
        loop {
            match batch::receive(self.socket.as_raw_fd(), &mut self.read) {
                // Only error frames of the controller: read on.
                Ok(count) if count > 0 && self.read.is_empty() => {}
                Ok(_) | Err(Errno::EAGAIN) => return Ok(()),
                Err(Errno::EINTR) => {}
                Err(errno) => return Err(sort(&self.interface, "receive", errno.into())),
            }
        }
    }

    /// Waits up to `wait` until there is something to read. A signal ends the wait early.
    fn wait_for_frame(&self, wait: Duration) -> Result<bool, SocketCanError> {
        let mut fds = [PollFd::new(self.socket.as_fd(), PollFlags::POLLIN)];
        match ppoll(&mut fds, Some(TimeSpec::from_duration(wait)), None) {
            Ok(ready) => Ok(ready > 0),
            Err(Errno::EINTR) => Ok(false),
            Err(errno) => Err(sort(&self.interface, "wait", errno.into())),
        }
    }

    /// Sends one frame; waits up to `deadline` while the transmit queue is full.
    ///
    /// # Errors
    /// `QueueFull`, `Down`, `Gone` or `Io`.
    pub fn send(&self, frame: &BusFrame, deadline: Duration) -> Result<(), SocketCanError> {
        self.send_all(core::slice::from_ref(frame), deadline)
    }

    /// Sends frames in this order; waits up to `deadline` whenever the transmit queue is full.
    ///
    /// # Errors
    /// As [`SocketCan::send`]; the frames before the failed one were sent.
    pub fn send_all(&self, frames: &[BusFrame], deadline: Duration) -> Result<(), SocketCanError> {
        let addressed: Vec<_> = frames.iter().map(|frame| self.node.to_bus(frame)).collect();
        let mut frames = &addressed[..];
        let mut since = None;
        while !frames.is_empty() {
            match batch::send(self.socket.as_raw_fd(), frames) {
                Ok(sent) => {
                    frames = frames.get(sent..).unwrap_or_default();
                    since = None;
                }
                Err(Errno::ENOBUFS | Errno::EAGAIN) => {
                    let waited = since.get_or_insert_with(Instant::now).elapsed();
                    if waited >= deadline {
                        return Err(SocketCanError::QueueFull {
                            interface: self.interface.clone(),
                            waited,
                        });
                    }
                    std::thread::sleep(QUEUE_RETRY.min(deadline - waited));
                }
                Err(Errno::EINTR) => {}
                Err(errno) => return Err(sort(&self.interface, "send", errno.into())),
            }
        }
        Ok(())
    }

    /// Frames that the kernel dropped since the socket was opened because they were not read
    /// in time; 0 if the kernel does not say.
    pub fn dropped(&self) -> u32 {
        let mut answer = [0; 4 * (MEMINFO_DROPS + 1)];
        let length = self
            .socket
            .get_socket_option_bytes(SOL_SOCKET, SO_MEMINFO, &mut answer);
        match (length, answer.last_chunk::<4>()) {
            (Ok(length), Some(drops)) if length == answer.len() => u32::from_ne_bytes(*drops),
            _ => 0,
        }
    }
}
