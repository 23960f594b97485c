//! The stage on a CAN bus: decoded as it comes, recorded, played from a log, made into a log, and
//! given new parameters.

mod address;
pub mod import;
pub mod live;
pub mod recorder;
pub mod replay;
pub mod update;

pub use address::{AddressError, BusAddress};
