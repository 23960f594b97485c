//! SocketCAN: the frames of a Linux CAN interface, with the kernel's receive times.
//!
//! The kernel hands over only the messages that were asked for, so foreign traffic costs
//! nothing. Frames that the kernel had to drop because nobody read them in time are counted
//! ([`SocketCan::dropped`]); that they are missing shows in the counters of the protocol too.
//! A full transmit queue (ENOBUFS) is waited for, up to a deadline.
//!
//! An interface that goes down is reported once by [`SocketCanError::Down`]; when it comes up
//! again the same socket goes on.

use crate::can::{BusFrame, Message, StampedFrame};
use crate::source::FrameSource;
use embedded_can::Frame;
use nix::errno::Errno;
use nix::poll::{PollFd, PollFlags, ppoll};
use nix::sys::time::TimeSpec;
use socketcan::{CanFilter, CanFrame, CanSocket, Socket, SocketOptions};
use std::io;
use std::os::fd::AsFd;
use std::string::{String, ToString};
use std::time::{Duration, Instant, SystemTime};
use std::vec::Vec;

/// Receive buffer that is asked for: some 10,000 frames. The kernel grants less to ordinary
/// users.
const RECEIVE_BUFFER_BYTES: i32 = 8 << 20;

/// How long to wait before a full transmit queue is tried again: less than two frames take at
/// 1 Mbit/s.
const QUEUE_RETRY: Duration = Duration::from_micros(200);

/// Mask of a filter that lets one standard identifier through.
const STANDARD_MASK: u32 = 0x8000_07ff;

/// Socket level, and options that `libc` does not name (the values of all but three rare
/// architectures).
const SOL_SOCKET: i32 = 1;
const SO_RCVBUF: i32 = 8;
const SO_RCVBUFFORCE: i32 = 33;
const SO_MEMINFO: i32 = 55;
/// Place of the drop counter in the answer to `SO_MEMINFO`.
const MEMINFO_DROPS: usize = 8;

/// Why a bus could not be used.
#[derive(Debug)]
pub enum SocketCanError {
    /// There is no interface of this name.
    NoSuchInterface {
        /// Its name.
        interface: String,
    },
    /// The interface is not a CAN interface.
    NotCan {
        /// Its name.
        interface: String,
    },
    /// This kernel has no SocketCAN.
    NoKernelSupport,
    /// The user may not open the interface.
    NoPermission {
        /// Its name.
        interface: String,
    },
    /// The interface is down.
    Down {
        /// Its name.
        interface: String,
    },
    /// The interface was removed.
    Gone {
        /// Its name.
        interface: String,
    },
    /// The transmit queue stayed full: nobody acknowledges, or the bus is too slow.
    QueueFull {
        /// Name of the interface.
        interface: String,
        /// How long it was waited for.
        waited: Duration,
    },
    /// Anything else, with the kernel's own error.
    Io {
        /// Name of the interface.
        interface: String,
        /// What was tried.
        action: &'static str,
        /// What the kernel says.
        cause: io::Error,
    },
}

impl core::fmt::Display for SocketCanError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::NoSuchInterface { interface } => write!(
                f,
                "there is no interface `{interface}`; `ip -brief link show type can` (or vcan) lists them"
            ),
            Self::NotCan { interface } => write!(f, "`{interface}` is not a CAN interface"),
            Self::NoKernelSupport => {
                f.write_str("this kernel has no SocketCAN; load the modules can and can-raw")
            }
            Self::NoPermission { interface } => write!(
                f,
                "no permission to use `{interface}`; run as a user who may open raw sockets (CAP_NET_RAW)"
            ),
            Self::Down { interface } => write!(
                f,
                "`{interface}` is down; `ip link set {interface} up` starts it"
            ),
            Self::Gone { interface } => write!(f, "`{interface}` was removed"),
            Self::QueueFull { interface, waited } => write!(
                f,
                "the transmit queue of `{interface}` stayed full for {} ms: is another node on the bus?",
                waited.as_millis()
            ),
            Self::Io {
                interface,
                action,
                cause,
            } => write!(f, "`{interface}`: cannot {action}: {cause}"),
        }
    }
}

impl core::error::Error for SocketCanError {
    fn source(&self) -> Option<&(dyn core::error::Error + 'static)> {
        match self {
            Self::Io { cause, .. } => Some(cause),
            _ => None,
        }
    }
}

/// One CAN interface, for receiving and sending.
#[derive(Debug)]
pub struct SocketCan {
    socket: CanSocket,
    interface: String,
    wait: Duration,
}

impl SocketCan {
    /// Opens an interface and asks the kernel for the frames of `messages` only.
    ///
    /// # Errors
    /// Every variant but `QueueFull`. An interface that is down opens; the first read tells.
    pub fn open(interface: &str, messages: &[Message]) -> Result<Self, SocketCanError> {
        let failed = |cause| sort(interface, "open it", cause);
        let addr = socketcan::CanAddr::from_iface(interface).map_err(|_| {
            SocketCanError::NoSuchInterface {
                interface: interface.to_string(),
            }
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
            .map(|message| CanFilter::new(u32::from(message.spec().id), STANDARD_MASK))
            .collect();
        socket.set_filters(&filters).map_err(failed)?;
        socket.set_recv_timestamp(true).map_err(failed)?;
        socket.set_nonblocking(true).map_err(failed)?;
        // Only a privileged user gets more than the system's limit; a smaller buffer works too.
        let buffer = RECEIVE_BUFFER_BYTES;
        let forced = socket.set_socket_option_int(SOL_SOCKET, SO_RCVBUFFORCE, buffer);
        if forced.is_err() {
            let asked = socket.set_socket_option_int(SOL_SOCKET, SO_RCVBUF, buffer);
            asked.map_err(failed)?;
        }
        Ok(Self {
            socket,
            interface: interface.to_string(),
            wait: Duration::ZERO,
        })
    }

    /// Sets how long [`FrameSource::next_frame`] waits for a frame; at first it does not.
    #[must_use]
    pub const fn waiting(mut self, wait: Duration) -> Self {
        self.wait = wait;
        self
    }

    /// The next frame, waiting for it up to `wait`; `None` if none came.
    ///
    /// # Errors
    /// `Down`, `Gone`, or `Io`.
    pub fn receive(&self, wait: Duration) -> Result<Option<StampedFrame>, SocketCanError> {
        if let Some(frame) = self.read()? {
            return Ok(Some(frame));
        }
        if wait.is_zero() || !self.wait_for(PollFlags::POLLIN, wait)? {
            return Ok(None);
        }
        self.read()
    }

    /// The next frame that is there already.
    fn read(&self) -> Result<Option<StampedFrame>, SocketCanError> {
        loop {
            match self.socket.read_frame_with_timestamp() {
                // Errors of the controller are no frames of the bus.
                Ok((CanFrame::Error(_), _)) => {}
                Ok((frame, time)) => {
                    return Ok(Some(StampedFrame {
                        time_us: micros(time),
                        frame: BusFrame::copy_of(&frame),
                    }));
                }
                Err(cause) if cause.kind() == io::ErrorKind::WouldBlock => return Ok(None),
                Err(cause) if cause.kind() == io::ErrorKind::Interrupted => {}
                Err(cause) => return Err(sort(&self.interface, "receive", cause)),
            }
        }
    }

    /// Whether the socket is ready for `flags` within `wait`. A signal ends the wait early.
    fn wait_for(&self, flags: PollFlags, wait: Duration) -> Result<bool, SocketCanError> {
        let fd = self.socket.as_fd();
        let mut fds = [PollFd::new(fd, flags)];
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
    pub fn send<F: Frame>(&self, frame: &F, deadline: Duration) -> Result<(), SocketCanError> {
        let frame = to_socket_frame(frame).ok_or_else(|| {
            let cause = io::Error::from(io::ErrorKind::InvalidInput);
            sort(&self.interface, "send", cause)
        })?;
        let mut since = None;
        loop {
            let Err(cause) = self.socket.write_frame(&frame) else {
                return Ok(());
            };
            let full = cause.kind() == io::ErrorKind::WouldBlock
                || cause.raw_os_error() == Some(Errno::ENOBUFS as i32);
            if full {
                let waited = since.get_or_insert_with(Instant::now).elapsed();
                if waited >= deadline {
                    return Err(SocketCanError::QueueFull {
                        interface: self.interface.clone(),
                        waited,
                    });
                }
                std::thread::sleep(QUEUE_RETRY.min(deadline - waited));
            } else if cause.kind() != io::ErrorKind::Interrupted {
                return Err(sort(&self.interface, "send", cause));
            }
        }
    }

    /// Frames that the kernel dropped because they were not read in time, since the socket
    /// was opened; 0 on a kernel that does not tell.
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

    /// Name of the interface.
    pub fn interface(&self) -> &str {
        &self.interface
    }
}

impl FrameSource for SocketCan {
    type Frame = StampedFrame;
    type Error = SocketCanError;

    /// The next frame; `None` when none came within the time that was set.
    fn next_frame(&mut self) -> Result<Option<StampedFrame>, SocketCanError> {
        self.receive(self.wait)
    }
}

fn to_socket_frame<F: Frame>(frame: &F) -> Option<CanFrame> {
    if frame.is_remote_frame() {
        CanFrame::new_remote(frame.id(), frame.dlc())
    } else {
        CanFrame::new(frame.id(), frame.data())
    }
}

/// A time as us since 1970, which is what candump logs hold.
pub fn micros(time: SystemTime) -> u64 {
    let since = time.duration_since(SystemTime::UNIX_EPOCH);
    since.map_or(0, |d| u64::try_from(d.as_micros()).unwrap_or(u64::MAX))
}

/// The error of the protocol for an error of the kernel.
fn sort(interface: &str, action: &'static str, cause: io::Error) -> SocketCanError {
    let interface = interface.to_string();
    match cause.raw_os_error().map(Errno::from_raw) {
        Some(Errno::ENETDOWN) => SocketCanError::Down { interface },
        Some(Errno::ENODEV | Errno::ENXIO) => SocketCanError::Gone { interface },
        Some(Errno::EPERM | Errno::EACCES) => SocketCanError::NoPermission { interface },
        Some(Errno::EAFNOSUPPORT | Errno::EPROTONOSUPPORT) => SocketCanError::NoKernelSupport,
        _ => SocketCanError::Io {
            interface,
            action,
            cause,
        },
    }
}
