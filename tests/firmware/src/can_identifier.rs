//! Identifiers in the registers of bxCAN.

use embedded_can::{ExtendedId, Id, StandardId};

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
pub fn from_register(bits: u32) -> Option<Id> {
    match bits & EXTENDED {
        0 => StandardId::new((bits >> 21) as u16).map(Id::Standard),
        _ => ExtendedId::new(bits >> 3).map(Id::Extended),
    }
}
