//! Prints the `.dbc` file of a node, for the tools of other makers.
//!
//! ```sh
//! cargo run -p hal-adapters --example dbc 5
//! ```

use embedded_can::Id;
use hal_adapters::can::{Message, NodeNumber};
use std::error::Error;

/// The file of node 0.
const NODE_0: &str = include_str!("../stage.dbc");
/// The bit of an extended identifier in this format.
const EXTENDED: u32 = 0x8000_0000;

fn main() -> Result<(), Box<dyn Error>> {
    let number = std::env::args().nth(1).and_then(|text| text.parse().ok());
    let node = number.and_then(NodeNumber::new);
    let node = node.ok_or_else(|| format!("use: dbc NODE, a number up to {}", NodeNumber::MAX))?;
    for line in NODE_0.lines() {
        println!("{}", renumbered(line, node));
    }
    Ok(())
}

/// A line with the identifier of its message at this node.
fn renumbered(line: &str, node: NodeNumber) -> String {
    let mut words: Vec<String> = line.split(' ').map(str::to_owned).collect();
    let at = match line.split(' ').next() {
        Some("BO_" | "VAL_" | "SIG_VALTYPE_") => 1,
        Some("CM_" | "BA_") => 2 + usize::from(line.starts_with("BA_")),
        _ => return line.to_owned(),
    };
    let Some(message) = words.get(at).and_then(|word| message(word)) else {
        return line.to_owned();
    };
    words[at] = match node.identifier(message) {
        Id::Standard(id) => id.as_raw().to_string(),
        Id::Extended(id) => (id.as_raw() | EXTENDED).to_string(),
    };
    words.join(" ")
}

/// The message of this identifier, as the file writes it.
fn message(word: &str) -> Option<Message> {
    let id = embedded_can::StandardId::new(word.parse().ok()?)?;
    Message::from_id(Id::Standard(id))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_line_of_a_message_has_the_identifier_of_its_node() {
        let node = NodeNumber::new(5).expect("within");
        // 0x100, then 18 bits of the number, and the bit of an extended identifier.
        let id = (0x100 << 18 | 5) | EXTENDED;
        for (line, want) in [
            ("BO_ 256 Hall: 8 Sensor", format!("BO_ {id} Hall: 8 Sensor")),
            (
                "CM_ SG_ 256 HallA \"code\";",
                format!("CM_ SG_ {id} HallA \"code\";"),
            ),
            (
                "BA_ \"GenMsgCycleTime\" BO_ 256 2;",
                format!("BA_ \"GenMsgCycleTime\" BO_ {id} 2;"),
            ),
            (
                "BU_: Sensor Decoder Host",
                "BU_: Sensor Decoder Host".to_owned(),
            ),
        ] {
            assert_eq!(renumbered(line, node), want);
        }
        assert!(
            NODE_0
                .lines()
                .all(|line| renumbered(line, NodeNumber::TABLE) == line)
        );
    }
}
