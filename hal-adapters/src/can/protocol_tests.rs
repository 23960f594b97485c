//! `protocol.md` and `stage.dbc` describe the messages of the table. (`tests/vcan` loads the file with cantools,
//! which refuses signals that overlap.)

extern crate std;

use super::PROTOCOL_VERSION;
use super::e2e::BASE_LIST;
use super::table::TABLE;
use std::format;
use std::string::String;
use std::vec::Vec;

const DBC: &str = include_str!("../../stage.dbc");

#[test]
fn the_protocol_names_every_message_with_identifier_and_key() {
    let (_, rest) = include_str!("protocol.md")
        .split_once("| identifier | message | key | sent by | every | what |")
        .expect("the table");
    let rows = rest.lines().skip(2).take_while(|row| row.starts_with('|'));
    let heads = rows.map(|row| row.split(" | ").take(3).collect::<Vec<_>>().join(" | "));
    let expected = TABLE.map(|row| {
        let name = row.message.name();
        format!("| 0x{:03X} | {name} | 0x{:02X}", row.id, row.key)
    });
    assert_eq!(heads.collect::<Vec<_>>(), expected);
}

#[test]
fn the_dbc_file_names_every_message_with_identifier_and_key() {
    let lines =
        |start: &str| -> Vec<&str> { DBC.lines().filter(|line| line.starts_with(start)).collect() };
    assert_eq!(
        lines("VERSION"),
        [format!("VERSION \"{PROTOCOL_VERSION}\"")]
    );
    let list: String = BASE_LIST.iter().map(|id| format!("{id:02X}")).collect();
    let list = format!("BA_ \"E2EDataIdBaseList\" \"{list}\";");
    assert_eq!(lines("BA_ \"E2EDataIdBaseList\""), [list]);
    let keys = TABLE.map(|row| format!("BA_ \"E2EDataIdKey\" BO_ {} {};", row.id, row.key));
    assert_eq!(lines("BA_ \"E2EDataIdKey\""), keys);
    let heads = lines("BO_ ").into_iter().map(|line| line.split(':').next());
    let expected = TABLE.map(|row| Some(format!("BO_ {} {}", row.id, row.message.name())));
    assert!(heads.map(|head| head.map(String::from)).eq(expected));
}
