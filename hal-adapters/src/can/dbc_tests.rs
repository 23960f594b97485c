//! The file `stage.dbc` and the tables of `protocol.md` follow from [`ROWS`]. The tests below
//! compare them, and write them anew when they run with `UPDATE_PROTOCOL=1`.

extern crate std;

use super::PROTOCOL_VERSION;
use super::e2e::BASE_LIST;
use super::load_tests::{FRAME_BITS_MAX, Traffic};
use super::sensor::Layout;
use super::signals_tests::{Kind, Node, PROTECTION, ROWS, Rate, Row, Signal};
use super::table::FRAME_BYTES;
use core::fmt::{Result, Write};
use std::string::String;

/// Servo period that the cycle times of the file are for, ms.
const PERIOD_MS: u32 = 2;

/// Writes the `.dbc` file.
fn write_dbc(out: &mut impl Write) -> Result {
    writeln!(out, "VERSION \"{PROTOCOL_VERSION}\"\n\nNS_ :\n\nBS_:\n")?;
    out.write_str("BU_:")?;
    for node in Node::ALL {
        write!(out, " {node:?}")?;
    }
    out.write_str("\n\n")?;
    for row in &ROWS {
        let (id, name, sender) = (row.spec.id, row.spec.message.name(), row.sender);
        writeln!(out, "BO_ {id} {name}: {FRAME_BYTES} {sender:?}")?;
        for signal in PROTECTION.iter().chain(row.signals) {
            write_signal(out, signal)?;
        }
        out.write_char('\n')?;
    }
    write_comments(out)?;
    out.write_str(
        "BA_DEF_ \"E2EProfile\" STRING;\nBA_DEF_ \"E2EDataIdBaseList\" STRING;\n\
         BA_DEF_ BO_ \"E2EDataIdKey\" INT 0 255;\n\
         BA_DEF_ BO_ \"GenMsgCycleTime\" INT 0 60000;\n\
         BA_DEF_DEF_ \"E2EProfile\" \"\";\nBA_DEF_DEF_ \"E2EDataIdBaseList\" \"\";\n\
         BA_DEF_DEF_ \"E2EDataIdKey\" 0;\nBA_DEF_DEF_ \"GenMsgCycleTime\" 0;\n\
         BA_ \"E2EProfile\" \"2\";\nBA_ \"E2EDataIdBaseList\" \"",
    )?;
    for id in BASE_LIST {
        write!(out, "{id:02X}")?;
    }
    out.write_str("\";\n")?;
    for row in &ROWS {
        writeln!(
            out,
            "BA_ \"E2EDataIdKey\" BO_ {} {};",
            row.spec.id, row.spec.key
        )?;
        if let Rate::Ticks(ticks) | Rate::Decimated(ticks) = row.rate {
            let cycle_ms = u32::from(ticks) * PERIOD_MS;
            writeln!(
                out,
                "BA_ \"GenMsgCycleTime\" BO_ {} {cycle_ms};",
                row.spec.id
            )?;
        }
    }
    for (row, signal) in all_signals() {
        if !signal.values.is_empty() {
            write!(out, "VAL_ {} {}", row.spec.id, signal.name)?;
            for (value, name) in signal.values {
                write!(out, " {value} \"{name}\"")?;
            }
            out.write_str(" ;\n")?;
        }
    }
    for (row, signal) in all_signals() {
        if signal.kind == Kind::Float {
            writeln!(out, "SIG_VALTYPE_ {} {} : 1;", row.spec.id, signal.name)?;
        }
    }
    Ok(())
}

fn all_signals() -> impl Iterator<Item = (&'static Row, &'static Signal)> {
    const ALL: &[Row] = &ROWS;
    ALL.iter()
        .flat_map(|row| row.signals.iter().map(move |signal| (row, signal)))
}

fn write_signal(out: &mut impl Write, s: &Signal) -> Result {
    write!(out, " SG_ {}", s.name)?;
    match (s.kind, s.page) {
        (Kind::Selector, _) => out.write_str(" M")?,
        (_, Some(page)) => write!(out, " m{page}")?,
        _ => {}
    }
    let sign = match s.kind {
        Kind::Unsigned | Kind::Selector => '+',
        Kind::Signed | Kind::Float => '-',
    };
    writeln!(
        out,
        " : {}|{}@1{sign} (1,0) [0|0] \"{}\" Vector__XXX",
        s.start, s.bits, s.unit
    )
}

fn write_comments(out: &mut impl Write) -> Result {
    for row in &ROWS {
        writeln!(out, "CM_ BO_ {} \"{}\";", row.spec.id, row.what)?;
    }
    for (row, signal) in all_signals() {
        writeln!(
            out,
            "CM_ SG_ {} {} \"{}\";",
            row.spec.id, signal.name, signal.what
        )?;
    }
    Ok(())
}

/// Writes the generated part of `protocol.md`: messages, signals and bus load.
fn write_tables(out: &mut impl Write) -> Result {
    out.write_str("| identifier | message | key | sent by | every | what |\n")?;
    out.write_str("|---|---|---|---|---|---|\n")?;
    for row in &ROWS {
        let (id, name, key, sender) = (
            row.spec.id,
            row.spec.message.name(),
            row.spec.key,
            row.sender,
        );
        write!(out, "| 0x{id:03X} | {name} | 0x{key:02X} | {sender:?} | ")?;
        match row.rate {
            Rate::Ticks(1) => out.write_str("tick")?,
            Rate::Ticks(n) => write!(out, "{n} ticks")?,
            Rate::Decimated(n) => write!(out, "1 to 16 ticks, default {n}")?,
            Rate::OnRequest => out.write_str("on request")?,
        }
        writeln!(out, " | {} |", row.what)?;
    }
    out.write_str(
        "\n| message | signal | bits | type | unit | what |\n|---|---|---|---|---|---|\n",
    )?;
    for signal in &PROTECTION {
        write_row(out, "every message", signal)?;
    }
    for (row, signal) in all_signals() {
        write_row(out, row.spec.message.name(), signal)?;
    }
    write_load(out)
}

fn write_row(out: &mut impl Write, message: &str, s: &Signal) -> Result {
    let last = s.start + s.bits - 1;
    let kind = match s.kind {
        Kind::Unsigned => "unsigned",
        Kind::Signed => "signed",
        Kind::Float => "float32",
        Kind::Selector => "selector",
    };
    let unit = if s.unit.is_empty() { "-" } else { s.unit };
    write!(
        out,
        "| {message} | {} | {}..{last} | {kind} | {unit} | {}",
        s.name, s.start, s.what
    )?;
    if let Some(page) = s.page {
        write!(out, " (page {page})")?;
    }
    for (k, (value, name)) in s.values.iter().enumerate() {
        let separator = if k == 0 { ": " } else { ", " };
        write!(out, "{separator}{value} {name}")?;
    }
    out.write_str(" |\n")
}

fn write_load(out: &mut impl Write) -> Result {
    write!(
        out,
        "\nWorst-case load at 500 ticks per second, every frame {FRAME_BITS_MAX} bits long (111 and 24 stuff bits):\n\n"
    )?;
    out.write_str("| sensor frames | vertical axes every | frames in 16 ticks | 1 Mbit/s | 500 kbit/s |\n|---|---|---|---|---|\n")?;
    for (codes, layout) in [
        ("16 bit", Some(Layout::Bits16)),
        ("24 bit", Some(Layout::Bits24)),
        ("none", None),
    ] {
        for vertical_ticks in [1, 4, 16] {
            let traffic = Traffic {
                ticks_per_s: 500,
                layout,
                vertical_ticks,
            };
            let tick = if vertical_ticks == 1 { "tick" } else { "ticks" };
            writeln!(
                out,
                "| {codes} | {vertical_ticks} {tick} | {} | {:.1} % | {:.1} % |",
                traffic.frames_in_slow_ticks(),
                100.0 * traffic.worst_load(1_000_000),
                100.0 * traffic.worst_load(500_000),
            )?;
        }
    }
    Ok(())
}

/// With `UPDATE_PROTOCOL` set, writes the files instead of comparing them.
fn compare(path: &str, before: &str, text: &str) {
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join(path);
    let file = std::fs::read_to_string(&path).unwrap_or_default();
    let head_end = file.find(before).map_or(0, |at| at + before.len());
    if std::env::var_os("UPDATE_PROTOCOL").is_some() {
        let whole = std::format!("{}{text}", &file[..head_end]);
        std::fs::write(&path, whole).expect("writable");
    } else {
        let file = file.replace("\r\n", "\n");
        assert!(
            file.ends_with(text) && file.len() == head_end + text.len(),
            "{} does not follow from the table; run the tests once with UPDATE_PROTOCOL=1",
            path.display()
        );
    }
}

#[test]
fn the_dbc_file_follows_from_the_table() {
    let mut text = String::new();
    write_dbc(&mut text).expect("a string");
    compare("stage.dbc", "", &text);
}

#[test]
fn the_tables_of_the_documentation_follow_from_the_table() {
    let mut text = String::new();
    write_tables(&mut text).expect("a string");
    compare("src/can/protocol.md", "<!-- generated -->\n\n", &text);
}
