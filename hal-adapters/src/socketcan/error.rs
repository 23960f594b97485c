//! What can go wrong with an interface.

use nix::errno::Errno;
use std::io;
use std::string::{String, ToString};
use std::time::Duration;

/// Why a bus could not be used.
#[derive(Debug, thiserror::Error)]
pub enum SocketCanError {
    /// There is no interface of this name.
    #[error(
        "there is no interface `{interface}`; `ip -brief link show type can` (or vcan) lists them"
    )]
    NoSuchInterface {
        /// Its name.
        interface: String,
    },
    /// The interface is not a CAN interface.
    #[error("`{interface}` is not a CAN interface")]
    NotCan {
        /// Its name.
        interface: String,
    },
    /// This kernel has no SocketCAN.
    #[error("this kernel has no SocketCAN; load the modules can and can-raw")]
    NoKernelSupport,
    /// The user may not open the interface.
    #[error(
        "no permission to use `{interface}`; run as a user who may open raw sockets (CAP_NET_RAW)"
    )]
    NoPermission {
        /// Its name.
        interface: String,
    },
    /// The interface is down.
    #[error("`{interface}` is down; `ip link set {interface} up` starts it")]
    Down {
        /// Its name.
        interface: String,
    },
    /// The interface was removed.
    #[error("`{interface}` was removed")]
    Gone {
        /// Its name.
        interface: String,
    },
    /// The transmit queue stayed full: nobody acknowledges, or the bus is too slow.
    #[error("the transmit queue of `{interface}` stayed full for {} ms: is another node on the bus?", waited.as_millis())]
    QueueFull {
        /// Name of the interface.
        interface: String,
        /// How long the sender waited.
        waited: Duration,
    },
    /// Any other error of the kernel.
    #[error("`{interface}`: cannot {action}: {cause}")]
    Io {
        /// Name of the interface.
        interface: String,
        /// What was tried.
        action: &'static str,
        /// What the kernel says.
        #[source]
        cause: io::Error,
    },
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
