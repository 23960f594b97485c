//! The address of a node: an interface, and the node's number on this bus.

use hal_adapters::can::NodeNumber;
use std::fmt::{Display, Formatter, Result as FmtResult};
use std::str::FromStr;

/// A node of a bus: `can0`, or `can0@5` for node 5.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct BusAddress {
    /// The CAN interface, for instance can0.
    pub interface: String,
    /// Which node of the bus.
    pub node: NodeNumber,
}

/// A text that is no address.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "`{text}` is no address on a bus: write an interface, as can0, and for another node than 0 its number from 1 to {}, as \
     can0@5",
    NodeNumber::MAX
)]
pub struct AddressError {
    text: String,
}

impl FromStr for BusAddress {
    type Err = AddressError;

    fn from_str(text: &str) -> Result<Self, AddressError> {
        let (interface, number) = text.split_once('@').unwrap_or((text, "0"));
        let node = number.parse().ok().and_then(NodeNumber::new);
        match node {
            Some(node) if !interface.is_empty() => Ok(Self {
                interface: interface.to_owned(),
                node,
            }),
            _ => Err(AddressError {
                text: text.to_owned(),
            }),
        }
    }
}

impl Display for BusAddress {
    fn fmt(&self, f: &mut Formatter<'_>) -> FmtResult {
        f.write_str(&self.interface)?;
        match self.node.number() {
            0 => Ok(()),
            number => write!(f, "@{number}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_address_is_read_as_it_is_written_and_anything_else_refused() {
        for (text, number) in [("can0", 0), ("vcan1@5", 5), ("can0@262143", 262_143)] {
            let address: BusAddress = text.parse().expect("an address");
            assert_eq!(
                (address.to_string().as_str(), address.node.number()),
                (text, number)
            );
        }
        for text in ["", "@5", "can0@", "can0@-1", "can0@262144", "can0@five"] {
            let error = text.parse::<BusAddress>().expect_err(text).to_string();
            assert!(error.contains("can0@5"), "{error}");
        }
    }
}
