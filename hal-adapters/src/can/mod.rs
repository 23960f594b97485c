#![doc = include_str!("protocol.md")]

/// An enum with the list of its variants in the order of their numbers.
macro_rules! numbered {
    ($(#[$outer:meta])* $name:ident {
        $($(#[$doc:meta])* $variant:ident $(= $number:literal)?,)*
    }) => {
        $(#[$outer])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        #[cfg_attr(feature = "defmt", derive(defmt::Format))]
        #[repr(u8)]
        pub enum $name {
            $($(#[$doc])* $variant $(= $number)?,)*
        }

        impl $name {
            /// Every variant, at the place of its number.
            pub const ALL: [Self; [$(stringify!($variant)),*].len()] = [$(Self::$variant),*];
        }

        const _: () = {
            let mut place = 0;
            while place < $name::ALL.len() {
                assert!($name::ALL[place] as usize == place);
                place += 1;
            }
        };
    };
}

pub mod command;
pub mod e2e;
pub mod frame;
mod group;
pub mod node_number;
pub mod notice;
pub mod pose;
#[cfg(test)]
mod protocol_tests;
pub mod receiver;
pub mod sensor;
pub mod service;
pub mod status;
pub mod table;
pub mod update;

pub use frame::{BusFrame, Coded, StampedFrame};
pub use node_number::NodeNumber;
pub use notice::{BusFault, BusHealth, Taken, Timing};
pub use pose::{PoseReceiver, PoseSender};
pub use receiver::SensorReceiver;
pub use sensor::Layout;
pub use service::Service;
pub use table::Message;

/// Version of this protocol, sent in [`Message::NodeStatus`].
pub const PROTOCOL_VERSION: u8 = 7;
