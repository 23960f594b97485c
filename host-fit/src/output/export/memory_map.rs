//! The parameter slots of the project's `memory.x`, read when this is compiled, so that their
//! addresses stand in one place.

const MAP: &str = include_str!("../../../../memory.x");

/// Addresses of the slots 0 and 1.
pub const SLOTS: [u32; 2] = [
    symbol("_parameter_slot_0 = 0x"),
    symbol("_parameter_slot_1 = 0x"),
];

/// The hexadecimal number behind some text of the map; a map without it does not compile.
const fn symbol(text: &str) -> u32 {
    let (map, text) = (MAP.as_bytes(), text.as_bytes());
    let mut at = 0;
    while at + text.len() < map.len() {
        let mut same = 0;
        while same < text.len() && map[at + same] == text[same] {
            same += 1;
        }
        if same == text.len() {
            return number(map, at + same);
        }
        at += 1;
    }
    panic!("memory.x lacks a symbol of the parameter slots")
}

const fn number(map: &[u8], mut at: usize) -> u32 {
    let mut number = 0;
    while at < map.len() && map[at].is_ascii_hexdigit() {
        let digit = match map[at] {
            digit @ b'0'..=b'9' => digit - b'0',
            letter => (letter | 0x20) - b'a' + 10,
        };
        number = number * 16 + digit as u32;
        at += 1;
    }
    number
}
