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

    #[test]
    fn each_line_of_a_message_has_the_nodes_identifier_and_key() {
        let node = NodeNumber::new(5).expect("within");
        let (table, own) = (file(0), file(5));
        let mut found = 0;
        for row in TABLE {
            let Id::Extended(id) = node.identifier(row.message) else {
                panic!("extended");
            };
            let (old, new) = (row.id.to_string(), (id.as_raw() | EXTENDED).to_string());
            for (before, after) in table.iter().zip(&own) {
                let is_its =
                    before.split(' ').any(|word| word == old) && !before.starts_with(" SG_");
                let expected = before.replacen(&format!(" {old} "), &format!(" {new} "), 1);
                let key = (row.key.to_string(), node.key(row.message).to_string());
                let expected = match before.contains("E2EDataIdKey") {
                    true => expected.replace(&format!(" {};", key.0), &format!(" {};", key.1)),
                    false => expected,
                };
                if is_its && before != after {
                    assert_eq!(after, &expected);
                    found += 1;
                }
            }
        }
        // No line of a message is left as it was.
        let same = table
            .iter()
            .zip(&own)
            .filter(|(a, b)| a == b && message_line(a));
        assert_eq!((same.count(), found > 3 * TABLE.len()), (0, true));
    }

    fn message_line(line: &str) -> bool {
        let words: Vec<_> = line.split(' ').collect();
        matches!(words[0], "BO_" | "VAL_" | "SIG_VALTYPE_")
            || matches!(
                words[..],
                ["CM_", "BO_" | "SG_", ..] | ["BA_", _, "BO_", ..]
            )
    }
}
