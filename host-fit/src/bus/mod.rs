//! The stage on a CAN bus: decodes and records it, makes a log of a record, and updates a controller.

mod address;
pub mod bus_log;
pub mod live;
pub mod recorder;
pub mod update;

pub use address::{AddressError, BusAddress};
