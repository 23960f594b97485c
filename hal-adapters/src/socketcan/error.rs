//! What can go wrong with an interface.

use nix::errno::Errno;
use std::io;
use std::string::{String, ToString};
use std::time::Duration;

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
        /// How long the sender waited.
        waited: Duration,
    },
    /// Any other error of the kernel.
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

/// The error that the kernel's error number stands for.
pub(super) fn sort(interface: &str, action: &'static str, cause: io::Error) -> SocketCanError {
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
