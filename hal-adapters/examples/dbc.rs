//! Prints the `.dbc` file of a node, for the tools of other makers.
//!
//! ```sh
//! cargo run -p hal-adapters --example dbc 5
//! ```

use embedded_can::Id;
use hal_adapters::can::{Message, NodeNumber};
use std::error::Error;

/// The file of node 0.
const OF_THE_TABLE: &str = include_str!("../stage.dbc");
/// In this format, the bit of an extended identifier.
const EXTENDED: u32 = 0x8000_0000;

fn main() -> Result<(), Box<dyn Error>> {
    let number = std::env::args().nth(1).and_then(|text| text.parse().ok());
    let node = number.and_then(NodeNumber::new);
    let node = node.ok_or_else(|| format!("use: dbc NODE, a number up to {}", NodeNumber::MAX))?;
    for line in OF_THE_TABLE.lines() {
        println!("{}", of_node(line, node));
    }
    Ok(())
}

/// A line with the identifier and the key that a message has at this node.
fn of_node(line: &str, node: NodeNumber) -> String {
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
    if line.starts_with("BA_ \"E2EDataIdKey\"") {
        words[at + 1] = format!("{};", node.key(message));
    }
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
        OF_THE_TABLE
            .lines()
            .map(|line| of_node(line, node))
            .collect()
    }

    #[test]
    fn the_file_of_node_0_is_that_of_the_table() {
        assert_eq!(file(0), OF_THE_TABLE.lines().collect::<Vec<_>>());
    }

    /// Lines that name a message name its identifier, and the others stay as they are.
    #[test]
    fn each_line_of_a_message_has_the_nodes_identifier_and_key() {
        let mut found = 0;
        for (before, after) in OF_THE_TABLE.lines().zip(file(5)) {
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
            let own = match before.contains("E2EDataIdKey") {
                true => own.replace(&format!(" {};", row.key), &format!(" {};", row.key ^ 5)),
                false => own,
            };
            assert_eq!(after, own);
            found += 1;
        }
        assert!(found > 3 * TABLE.len(), "{found}");
    }
}
