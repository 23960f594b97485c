//! Identifiers in the registers of bxCAN, and frames of a node with the identifiers of the table.

use embedded_can::{ExtendedId, Frame, Id, StandardId};
use hal_adapters::can::{BusFrame, NodeNumber};

/// IDE: the identifier has 29 bits, from bit 3 on, else eleven from bit 21 on (RM0090 32.9.3).
pub const EXTENDED: u32 = 1 << 2;

/// The bits of an identifier in a register.
pub fn to_register(id: Id) -> u32 {
    match id {
        Id::Standard(id) => u32::from(id.as_raw()) << 21,
        Id::Extended(id) => id.as_raw() << 3 | EXTENDED,
    }
}

/// The identifier in a register.
fn from_register(bits: u32) -> Option<Id> {
    match bits & EXTENDED {
        0 => StandardId::new((bits >> 21) as u16).map(Id::Standard),
        _ => ExtendedId::new(bits >> 3).map(Id::Extended),
    }
}

/// A frame of a node with the identifier of the table. A foreign frame keeps its first eleven bits.
pub fn from_bus(node: NodeNumber, register: u32, bytes: [u8; 8]) -> Option<(u16, [u8; 8])> {
    let frame = BusFrame::new(from_register(register)?, &bytes)?;
    let own = node.from_bus(&frame).unwrap_or(frame);
    let bytes = own.data().try_into().ok()?;
    match own.id {
        Id::Standard(id) => Some((id.as_raw(), bytes)),
        Id::Extended(id) => Some((id.standard_id().as_raw(), bytes)),
    }
}
