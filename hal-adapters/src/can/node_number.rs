//! Several stages on one bus, and one that leaves all standard identifiers to others.
//!
//! The frames of the table belong to node 0 of a bus. Those of another node have extended
//! identifiers: the eleven bits of the table first, so that priorities stay, then the number. Their
//! data IDs are those of the table XOR the lowest byte of the number, so that a frame whose
//! identifier was damaged is not taken for one of another node. A frame is 20 bits longer, and up to
//! five stuff bits.
//!
//! ```
//! use hal_adapters::can::{BusFrame, Coded, Message, NodeNumber};
//! use hal_adapters::can::command::{Command, Content, Mailbox, Request};
//!
//! let request = Content::Command(Command::new(Request::ClearZero, 17));
//! let frame = BusFrame::from(Mailbox::default().send(&request).unwrap());
//! let node = NodeNumber::new(5).unwrap();
//! let sent = node.to_bus(&frame);
//! assert_eq!(sent.id, node.identifier(Message::Command));
//! assert_eq!(node.from_bus(&sent), Some(frame));
//! assert_eq!(NodeNumber::new(6).unwrap().from_bus(&sent), None);
//! ```

use super::e2e::{Payload, protect};
use super::frame::BusFrame;
use super::table::Message;
use embedded_can::{ExtendedId, Id, StandardId};

/// Bits of an extended identifier below those of a standard one.
const LOW_BITS: u32 = 18;

/// Which stage of a bus: 0, the default, sends the standard identifiers of the table.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct NodeNumber(u32);

impl NodeNumber {
    /// The node whose frames are those of the table.
    pub const TABLE: Self = Self(0);
    /// The highest.
    pub const MAX: u32 = (1 << LOW_BITS) - 1;

    /// The node of this number; `None` above [`NodeNumber::MAX`].
    pub const fn new(number: u32) -> Option<Self> {
        if number <= Self::MAX {
            Some(Self(number))
        } else {
            None
        }
    }

    /// The number.
    pub const fn number(self) -> u32 {
        self.0
    }

    /// The identifier that a message of this node has on the bus.
    pub fn identifier(self, message: Message) -> Id {
        self.on_bus(message.id())
    }

    fn on_bus(self, id: StandardId) -> Id {
        match ExtendedId::new((id.as_raw() as u32) << LOW_BITS | self.0) {
            Some(extended) if self.0 > 0 => Id::Extended(extended),
            _ => Id::Standard(id),
        }
    }

    /// Key of the data ID list of a message of this node.
    pub const fn key(self, message: Message) -> u8 {
        message.key() ^ self.0 as u8
    }

    /// What the number changes in the check, the first byte of a frame, by XOR: a CRC is linear, and the
    /// data ID comes last.
    pub const fn seal(self) -> u8 {
        let nothing = Payload { short: 0, long: 0 };
        protect(self.0 as u8, 0, nothing)[0] ^ protect(0, 0, nothing)[0]
    }

    /// A frame of the table as this node sends it.
    pub fn to_bus(self, frame: &BusFrame) -> BusFrame {
        match frame.id {
            Id::Standard(id) => frame.readdressed(self.on_bus(id), self.seal()),
            Id::Extended(_) => *frame,
        }
    }

    /// The frame of the table, if it is one of this node's, or one that belongs to none: of node 0
    /// every frame.
    pub fn from_bus(self, frame: &BusFrame) -> Option<BusFrame> {
        match frame.id {
            _ if self.0 == 0 => Some(*frame),
            Id::Extended(id) if id.as_raw() & Self::MAX == self.0 => {
                let id = Id::Standard(id.standard_id());
                Some(frame.readdressed(id, self.seal()))
            }
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::can::command::{Command, Content, Mailbox, Request};
    use crate::can::e2e::unprotect;
    use crate::can::table::TABLE;
    use embedded_can::Frame;

    fn command() -> BusFrame {
        let content = Content::Command(Command::new(Request::Rezero { ticks: 500 }, 17));
        BusFrame::from(Mailbox::default().send(&content).expect("a command"))
    }

    #[test]
    fn a_frame_of_a_node_is_that_of_the_table_for_itself_and_none_for_any_other() {
        for number in [0, 1, 5, 0x80, 0x1234, NodeNumber::MAX] {
            let node = NodeNumber::new(number).expect("within");
            let sent = node.to_bus(&command());
            assert_eq!(matches!(sent.id, Id::Standard(_)), number == 0);
            assert_eq!(node.from_bus(&sent), Some(command()));
            for other in (1..300).filter(|other| *other != number) {
                let other = NodeNumber::new(other).expect("within");
                assert_eq!(other.from_bus(&sent), None);
            }
        }
        assert_eq!(NodeNumber::new(NodeNumber::MAX + 1), None);
    }

    #[test]
    fn its_check_is_that_of_its_own_key() {
        for (row, number) in TABLE
            .iter()
            .zip([1, 2, 3, 200, 255, 256, 70_000].into_iter().cycle())
        {
            let node = NodeNumber::new(number).expect("within");
            let payload = Payload {
                short: 0xabcde,
                long: 0x0123_4567,
            };
            for counter in 0..16 {
                let bytes = protect(row.key, counter, payload);
                let frame = BusFrame::new(row.message.id(), &bytes).expect("eight bytes");
                let sent = node.to_bus(&frame);
                let bytes: [u8; 8] = sent.data().try_into().expect("eight bytes");
                assert_eq!(
                    unprotect(node.key(row.message), &bytes),
                    Some((counter, payload))
                );
            }
        }
    }

    #[test]
    fn a_frame_whose_number_was_damaged_fails_the_check_of_the_other_node() {
        let sender = NodeNumber::new(5).expect("within");
        let sent = sender.to_bus(&command());
        for bit in 0..8 {
            let receiver = NodeNumber::new(5 ^ 1 << bit).expect("within");
            let moved = sent.readdressed(receiver.identifier(Message::Command), 0);
            let taken = receiver.from_bus(&moved).expect("by its identifier");
            assert!(
                matches!(Mailbox::default().take(&taken), Some(Err(_))),
                "{bit}"
            );
        }
    }

    #[test]
    fn the_order_of_priorities_is_that_of_the_table() {
        let node = NodeNumber::new(NodeNumber::MAX).expect("within");
        let ids = TABLE.map(|row| match node.identifier(row.message) {
            Id::Extended(id) => id.as_raw(),
            Id::Standard(_) => 0,
        });
        assert!(ids.is_sorted() && ids[0] > 0);
    }
}
