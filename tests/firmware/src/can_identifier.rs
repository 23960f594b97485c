//! Identifiers in the registers of bxCAN, and frames of a node as those of the table.

use embedded_can::{ExtendedId, Frame, Id, StandardId};
use hal_adapters::can::{BusFrame, NodeNumber};

/// IDE: the identifier has 29 bits, from bit 3 on, else eleven from bit 21 on (RM0090 32.9.3).
pub const EXTENDED: u32 = 1 << 2;

/// The bits of an identifier in a register.
pub fn bits_of(id: Id) -> u32 {
    match id {
        Id::Standard(id) => u32::from(id.as_raw()) << 21,
        Id::Extended(id) => id.as_raw() << 3 | EXTENDED,
    }
}

/// The identifier in a register.
fn id_of(bits: u32) -> Option<Id> {
    match bits & EXTENDED {
        0 => StandardId::new((bits >> 21) as u16).map(Id::Standard),
        _ => ExtendedId::new(bits >> 3).map(Id::Extended),
    }
}

/// A frame of a node as one of the table; any other as it is, with the first eleven bits of
/// its identifier.
pub fn of_the_table(node: NodeNumber, register: u32, bytes: [u8; 8]) -> Option<(u16, [u8; 8])> {
    let frame = BusFrame::new(id_of(register)?, &bytes)?;
    let own = node.from_bus(&frame).unwrap_or(frame);
    let bytes = own.data().try_into().ok()?;
    match own.id {
        Id::Standard(id) => Some((id.as_raw(), bytes)),
        Id::Extended(id) => Some((id.standard_id().as_raw(), bytes)),
    }
}
