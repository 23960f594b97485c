#![doc = include_str!("protocol.md")]

pub mod command;
#[cfg(test)]
mod dbc;
pub mod e2e;
pub mod frame;
mod group;
#[cfg(test)]
mod load;
pub mod notice;
pub mod pose;
pub mod receiver;
pub mod sensor;
pub mod service;
pub mod signals;
pub mod status;
pub mod table;
pub mod update;

pub use frame::{BusFrame, Coded, StampedFrame};
pub use notice::{BusFault, BusHealth, Taken, Timing};
pub use pose::{PoseReceiver, PoseSender};
pub use receiver::SensorReceiver;
pub use sensor::Layout;
pub use service::Service;
pub use table::Message;

/// Version of this protocol, as [`Message::NodeStatus`] tells it.
pub const PROTOCOL_VERSION: u8 = 2;
