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
    use hal_adapters::can::table::TABLE;

    fn file(number: u32) -> Vec<String> {
        let node = NodeNumber::new(number).expect("within");
        NODE_0.lines().map(|line| renumbered(line, node)).collect()
    }

    #[test]
    fn the_file_of_node_0_stays() {
        assert_eq!(file(0), NODE_0.lines().collect::<Vec<_>>());
    }

    /// Only lines that name a message change.
    #[test]
    fn each_line_of_a_message_has_the_nodes_identifier() {
        let mut found = 0;
        for (before, after) in NODE_0.lines().zip(file(5)) {
            let names = ["BO_", "VAL_", "SIG_VALTYPE_", "CM_", "BA_"];
            let is_named = names.contains(&before.split(' ').next().unwrap_or(""));
            let is_its = |id: u16| is_named && before.contains(&format!(" {id} "));
            let Some(row) = TABLE.iter().find(|row| is_its(row.id)) else {
                assert_eq!(before, after);
                continue;
            };
            // The table's bits, the node's 18, and the bit of an extended one.
            let id = u32::from(row.id) << 18 | 5 | 1 << 31;
            let own = before.replacen(&format!(" {} ", row.id), &format!(" {id} "), 1);
            assert_eq!(after, own);
            found += 1;
        }
        assert!(found > 3 * TABLE.len(), "{found}");
    }
}
