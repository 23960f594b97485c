//! Several stages on one bus, or a stage beside other protocols with standard identifiers.
//!
//! The frames of the table belong to node 0 of a bus. Another node has extended identifiers: the eleven
//! bits of the table first, so the priorities stay, then the node's number. Data, check and counter are the
//! same. A frame is 20 bits longer, plus up to five stuff bits.
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

use super::frame::BusFrame;
use super::table::Message;
use embedded_can::{ExtendedId, Id, StandardId};

/// Bits that an extended identifier has below the bits of a standard identifier.
const LOW_BITS: u32 = 18;

/// The stage's number on the bus. The default, 0, has the standard identifiers of the table.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct NodeNumber(u32);

impl NodeNumber {
    /// The node with the identifiers of the table.
    pub const TABLE: Self = Self(0);
    /// The highest number.
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

    /// The identifier of a message of this node.
    pub fn identifier(self, message: Message) -> Id {
        self.extend(message.id())
    }

    fn extend(self, id: StandardId) -> Id {
        match ExtendedId::new((id.as_raw() as u32) << LOW_BITS | self.0) {
            Some(extended) if self.0 > 0 => Id::Extended(extended),
            _ => Id::Standard(id),
        }
    }

    /// A frame of the table as this node sends it.
    pub fn to_bus(self, frame: &BusFrame) -> BusFrame {
        match frame.id {
            Id::Standard(id) => frame.with_id(self.extend(id)),
            Id::Extended(_) => *frame,
        }
    }

    /// The frame of the table, if this node sent it. Node 0 takes every frame unchanged.
    pub fn from_bus(self, frame: &BusFrame) -> Option<BusFrame> {
        match frame.id {
            _ if self.0 == 0 => Some(*frame),
            Id::Extended(id) if id.as_raw() & Self::MAX == self.0 => {
                Some(frame.with_id(Id::Standard(id.standard_id())))
            }
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::can::table::TABLE;
    use embedded_can::Frame;

    #[test]
    fn a_frame_of_a_node_is_its_own_and_of_no_other_node() {
        let frame = BusFrame::new(Message::Command.id(), &[1; 8]).expect("eight bytes");
        for number in [0, 1, 5, 0x80, 0x1234, NodeNumber::MAX] {
            let node = NodeNumber::new(number).expect("within");
            let sent = node.to_bus(&frame);
            assert_eq!(matches!(sent.id, Id::Standard(_)), number == 0);
            assert_eq!(node.from_bus(&sent), Some(frame));
            for other in (1..300).filter(|other| *other != number) {
                let other = NodeNumber::new(other).expect("within");
                assert_eq!(other.from_bus(&sent), None);
            }
        }
        assert_eq!(NodeNumber::new(NodeNumber::MAX + 1), None);
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
