//! The tables of `protocol.md`: who sends a message, when, and its signals. Bits are numbered as in
//! a `.dbc` file, little-endian: bit 8 n is the lowest of byte n. Check and counter take bits 0 to
//! 11 of every message.

extern crate std;

use super::table::{SLOW_TICKS, Spec, TABLE, VERTICAL_TICKS};
use std::format;
use std::vec::Vec;

/// When a message is sent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Rate {
    /// Every so many ticks.
    Ticks(u8),
    /// Every [`REPEAT_US`](super::sensor::REPEAT_US), and when it changes.
    Held,
    /// Every so many ticks by default; the sender can be set to 1 to 16.
    Decimated(u8),
    /// When asked for.
    OnRequest,
}

/// How the bits of a signal are read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Unsigned,
    /// Unsigned, with names for its values.
    Named,
    /// Two's complement.
    Signed,
    /// IEEE 754 single precision, 32 bits.
    Float,
    /// Selects which of the paged signals the frame carries.
    Selector,
}

/// One signal.
#[derive(Debug)]
pub(super) struct Signal {
    pub(super) name: &'static str,
    /// Lowest bit.
    pub(super) start: u8,
    pub(super) bits: u8,
    pub(super) kind: Kind,
    /// Unit; empty for none.
    pub(super) unit: &'static str,
    /// The value of the selector with which a paged signal is sent.
    pub(super) page: Option<u8>,
    /// Named values.
    pub(super) values: Vec<(u8, &'static str)>,
    pub(super) what: &'static str,
}

/// What a message carries.
#[derive(Debug)]
pub(super) struct Row {
    pub(super) spec: Spec,
    pub(super) sender: &'static str,
    pub(super) rate: Rate,
    pub(super) what: &'static str,
    /// With check and counter.
    pub(super) signals: Vec<Signal>,
}

/// The rows below the heading of a table.
fn table(heading: &str) -> Vec<[&'static str; 6]> {
    let (_, rest) = include_str!("protocol.md")
        .split_once(heading)
        .expect(heading);
    let rows = rest
        .lines()
        .skip(2)
        .take_while(|line| line.starts_with('|'));
    let cells = |row: &'static str| {
        let cells: Vec<_> = row.trim_matches('|').split(" | ").map(str::trim).collect();
        cells.try_into().expect(row)
    };
    rows.map(cells).collect()
}

fn number(text: &str) -> u8 {
    text.parse().expect(text)
}

fn signal([_, name, bits, kind, unit, what]: [&'static str; 6]) -> Signal {
    let (first, last) = bits.split_once("..").expect(bits);
    let paged = what
        .strip_suffix(')')
        .and_then(|what| what.split_once(" (page "));
    let (what, page) = paged.map_or((what, None), |(what, page)| (what, Some(number(page))));
    let kind = match kind {
        "unsigned" => Kind::Unsigned,
        "named" => Kind::Named,
        "signed" => Kind::Signed,
        "float32" => Kind::Float,
        "selector" => Kind::Selector,
        other => panic!("{name}: {other}"),
    };
    let value = |item: &'static str| {
        let (value, name) = item.split_once(' ').expect(item);
        (number(value), name)
    };
    let (what, values) = match what.split_once(": ") {
        Some((what, values)) if kind == Kind::Named => {
            (what, values.split(", ").map(value).collect())
        }
        _ => (what, Vec::new()),
    };
    Signal {
        name,
        start: number(first),
        bits: number(last) + 1 - number(first),
        kind,
        unit: if unit == "-" { "" } else { unit },
        page,
        values,
        what,
    }
}

/// The messages, in their order.
pub(super) fn rows() -> Vec<Row> {
    let signals = table("| message | signal | bits | type | unit | what |");
    let messages = table("| identifier | message | key | sent by | every | what |");
    assert_eq!(messages.len(), TABLE.len());
    let row = |(spec, [id, name, key, sender, every, what]): (Spec, [&'static str; 6])| {
        let of_table = (format!("0x{:03X}", spec.id), format!("0x{:02X}", spec.key));
        assert_eq!(
            (id, name, key),
            (&*of_table.0, spec.message.name(), &*of_table.1)
        );
        let decimated = format!("1 to 16 ticks, default {VERTICAL_TICKS}");
        let rate = match every {
            "tick" => Rate::Ticks(1),
            "on request" => Rate::OnRequest,
            "100 ms" => Rate::Held,
            every if every == decimated => Rate::Decimated(VERTICAL_TICKS),
            every if every == format!("{SLOW_TICKS} ticks") => Rate::Ticks(SLOW_TICKS),
            other => panic!("{name}: {other}"),
        };
        let own = |row: &&[&str; 6]| row[0] == "every message" || row[0] == name;
        let signals = signals.iter().filter(own).copied().map(signal);
        Row {
            spec,
            sender,
            rate,
            what,
            signals: signals.collect(),
        }
    };
    TABLE.into_iter().zip(messages).map(row).collect()
}

#[test]
fn no_two_signals_of_a_frame_share_a_bit() {
    for row in rows() {
        let pages = row.signals.iter().filter_map(|s| s.page).max();
        for page in 0..=pages.unwrap_or(0) {
            let mut used = 0u64;
            for s in row
                .signals
                .iter()
                .filter(|s| s.page.is_none_or(|p| p == page))
            {
                assert!(s.bits >= 1 && s.start + s.bits <= 64, "{}", s.name);
                let mask = (u64::MAX >> (64 - s.bits)) << s.start;
                assert_eq!(used & mask, 0, "{} {}", row.spec.message.name(), s.name);
                used |= mask;
                assert!(s.kind != Kind::Float || s.bits == 32);
            }
        }
    }
}
