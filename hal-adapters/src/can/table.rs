//! The table of messages and identifiers. `protocol.md` lists the signals of each message; the `.dbc` file
//! follows from it.

use embedded_can::{Id, StandardId};

/// One row of the table.
#[derive(Clone, Copy, Debug)]
pub struct Spec {
    /// Which message.
    pub message: Message,
    /// Standard identifier.
    pub id: u16,
    /// Key of its data ID list; see [`super::e2e`].
    pub key: u8,
}

macro_rules! messages {
    ($($(#[$doc:meta])* $name:ident: $id:literal, $key:literal;)*) => {
        /// The messages, by priority on the bus: the lowest identifier wins.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        #[cfg_attr(feature = "defmt", derive(defmt::Format))]
        pub enum Message {
            $($(#[$doc])* $name,)*
        }

        impl Message {
            /// Its name in the `.dbc` file.
            pub const fn name(self) -> &'static str {
                match self {
                    $(Self::$name => stringify!($name),)*
                }
            }
        }

        /// The table, in the order of [`Message`] and of rising identifier.
        ///
        /// Any two identifiers differ in at least four bits, so three flipped bits never turn one
        /// message into another. Every message has eight bytes.
        pub const TABLE: [Spec; [$($id),*].len()] = [
            $(Spec { message: Message::$name, id: $id, key: $key },)*
        ];
    };
}

messages! {
    /// Hall codes of 16 bits.
    Hall: 0x100, 0x0d;
    /// Capacitive codes of 16 bits.
    Capacitive: 0x10f, 0x1a;
    /// Hall codes A and B of 24 bits.
    HallAb24: 0x133, 0x27;
    /// Hall code C and capacitive code 1 of 24 bits.
    HallCCapacitive1At24: 0x13c, 0x34;
    /// Capacitive codes 2 and 3 of 24 bits.
    Capacitive23At24: 0x155, 0x41;
    /// Number and time of a tick by the sensor node's clock.
    SensorTime: 0x15a, 0x4e;
    /// X with its status.
    PoseX: 0x166, 0x5b;
    /// Y with its status.
    PoseY: 0x169, 0x68;
    /// Rz with its status.
    PoseRz: 0x196, 0x75;
    /// Z with its status.
    PoseZ: 0x199, 0x82;
    /// Rx with its status.
    PoseRx: 0x1a5, 0x8f;
    /// Ry with its status.
    PoseRy: 0x1aa, 0x9c;
    /// State of the decoding node.
    NodeStatus: 0x1c3, 0xa9;
    /// A request to the decoding node.
    Command: 0x1cc, 0xb6;
    /// Its answer.
    Answer: 0x1f0, 0xc3;
    /// Counters of the decoding node, one a frame.
    Health: 0x1ff, 0xd0;
    /// Number and time of the tick of the pose that was just sent.
    PoseTime: 0x20c, 0xea;
    /// A word of new parameters.
    UpdateData: 0x230, 0xf7;
    /// Temperatures of the magnets' mount and of the stage body.
    Temperature: 0x23f, 0x04;
}

/// Ticks between two frames of [`Message::SensorTime`], [`Message::PoseTime`],
/// [`Message::NodeStatus`] and [`Message::Health`].
pub const SLOW_TICKS: u8 = 16;

/// Bytes of every message.
pub const FRAME_BYTES: usize = 8;

impl Message {
    /// Its row of the table.
    #[inline(always)]
    pub const fn spec(self) -> &'static Spec {
        const ROWS: &[Spec; TABLE.len()] = &TABLE;
        // Always true. Without this comparison the compiler keeps a bounds check and its panic.
        let place = self as usize;
        if place < ROWS.len() {
            &ROWS[place]
        } else {
            &ROWS[0]
        }
    }

    /// Key of its data ID list; see [`super::e2e`].
    #[inline(always)]
    pub const fn key(self) -> u8 {
        self.spec().key
    }

    /// Its identifier.
    #[inline(always)]
    pub const fn id(self) -> StandardId {
        match StandardId::new(self.spec().id) {
            Some(id) => id,
            None => StandardId::MAX,
        }
    }

    /// The message with this identifier, if it is one of ours.
    pub fn from_id(id: Id) -> Option<Self> {
        let Id::Standard(id) = id else { return None };
        TABLE
            .iter()
            .find(|row| row.id == id.as_raw())
            .map(|row| row.message)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_stand_in_the_order_of_messages_and_identifiers() {
        for (k, row) in TABLE.iter().enumerate() {
            assert_eq!(row.message as usize, k);
            assert_eq!(row.message.id().as_raw(), row.id);
            assert_eq!(row.message.key(), row.key);
            assert_eq!(
                Message::from_id(Id::Standard(row.message.id())),
                Some(row.message)
            );
            assert!(k == 0 || TABLE[k - 1].id < row.id);
        }
    }

    #[test]
    fn any_two_identifiers_differ_in_four_bits_and_any_two_keys_differ() {
        for (k, a) in TABLE.iter().enumerate() {
            for b in &TABLE[..k] {
                assert!(
                    (a.id ^ b.id).count_ones() >= 4,
                    "{} {}",
                    a.message.name(),
                    b.message.name()
                );
                assert_ne!(a.key, b.key);
            }
        }
    }
}
