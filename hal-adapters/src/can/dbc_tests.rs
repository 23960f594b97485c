//! The file `stage.dbc` and the load in `protocol.md` follow from the tables there. The tests below
//! compare them, and write them anew when they run with `UPDATE_PROTOCOL=1`.

extern crate std;

use super::PROTOCOL_VERSION;
use super::e2e::BASE_LIST;
use super::load_tests::{FRAME_BITS_MAX, frames_in_slow_ticks, worst_load};
use super::sensor::{Layout, REPEAT_US};
use super::table::FRAME_BYTES;
use super::tables_tests::{Kind, Rate, Row, Signal, rows};
use core::fmt::{Result, Write};
use std::string::String;

/// Servo period that the cycle times of the file are for, ms.
const PERIOD_MS: u32 = 2;

/// Writes the `.dbc` file.
fn write_dbc(out: &mut impl Write) -> Result {
    let rows = rows();
    writeln!(out, "VERSION \"{PROTOCOL_VERSION}\"\n\nNS_ :\n\nBS_:\n")?;
    out.write_str("BU_: Sensor Decoder Host\n\n")?;
    for row in &rows {
        let (id, name, sender) = (row.spec.id, row.spec.message.name(), row.sender);
        writeln!(out, "BO_ {id} {name}: {FRAME_BYTES} {sender}")?;
        for signal in &row.signals {
            write_signal(out, signal)?;
        }
        out.write_char('\n')?;
    }
    for row in &rows {
        writeln!(out, "CM_ BO_ {} \"{}\";", row.spec.id, row.what)?;
    }
    for (id, s) in own_signals(&rows) {
        writeln!(out, "CM_ SG_ {id} {} \"{}\";", s.name, s.what)?;
    }
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
    for Row { spec, rate, .. } in &rows {
        writeln!(out, "BA_ \"E2EDataIdKey\" BO_ {} {};", spec.id, spec.key)?;
        if let Rate::Ticks(ticks) | Rate::Decimated(ticks) = rate {
            let cycle_ms = u32::from(*ticks) * PERIOD_MS;
            writeln!(out, "BA_ \"GenMsgCycleTime\" BO_ {} {cycle_ms};", spec.id)?;
        }
        if *rate == Rate::Held {
            let cycle_ms = REPEAT_US / 1000;
            writeln!(out, "BA_ \"GenMsgCycleTime\" BO_ {} {cycle_ms};", spec.id)?;
        }
    }
    for (id, s) in own_signals(&rows).filter(|(_, s)| s.kind == Kind::Named) {
        write!(out, "VAL_ {id} {}", s.name)?;
        for (value, name) in &s.values {
            write!(out, " {value} \"{name}\"")?;
        }
        out.write_str(" ;\n")?;
    }
    for (id, s) in own_signals(&rows).filter(|(_, s)| s.kind == Kind::Float) {
        writeln!(out, "SIG_VALTYPE_ {id} {} : 1;", s.name)?;
    }
    Ok(())
}

/// The signals besides check and counter, with the identifiers of their messages.
fn own_signals(rows: &[Row]) -> impl Iterator<Item = (u16, &Signal)> {
    rows.iter()
        .flat_map(|row| row.signals[2..].iter().map(|signal| (row.spec.id, signal)))
}

fn write_signal(out: &mut impl Write, s: &Signal) -> Result {
    write!(out, " SG_ {}", s.name)?;
    match (s.kind, s.page) {
        (Kind::Selector, _) => out.write_str(" M")?,
        (_, Some(page)) => write!(out, " m{page}")?,
        _ => {}
    }
    let sign = match s.kind {
        Kind::Unsigned | Kind::Named | Kind::Selector => '+',
        Kind::Signed | Kind::Float => '-',
    };
    writeln!(
        out,
        " : {}|{}@1{sign} (1,0) [0|0] \"{}\" Vector__XXX",
        s.start, s.bits, s.unit
    )
}

fn write_load(out: &mut impl Write) -> Result {
    write!(
        out,
        "Worst-case load at 500 ticks per second, every frame {FRAME_BITS_MAX} bits long (111 and 24 stuff bits):\n\n"
    )?;
    out.write_str("| sensor frames | vertical axes every | frames in 16 ticks | 1 Mbit/s | 500 kbit/s |\n|---|---|---|---|---|\n")?;
    for (codes, layout) in [
        ("16 bit", Some(Layout::Bits16)),
        ("24 bit", Some(Layout::Bits24)),
        ("none", None),
    ] {
        for vertical_ticks in [1, 4, 16] {
            let load = |bits_per_s| 100.0 * worst_load(layout, vertical_ticks, bits_per_s);
            let tick = if vertical_ticks == 1 { "tick" } else { "ticks" };
            writeln!(
                out,
                "| {codes} | {vertical_ticks} {tick} | {} | {:.1} % | {:.1} % |",
                frames_in_slow_ticks(layout, vertical_ticks),
                load(1_000_000),
                load(500_000),
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
            "{} does not follow from the tables; run the tests once with UPDATE_PROTOCOL=1",
            path.display()
        );
    }
}

#[test]
fn the_dbc_file_follows_from_the_tables() {
    let mut text = String::new();
    write_dbc(&mut text).expect("a string");
    compare("stage.dbc", "", &text);
}

#[test]
fn the_load_follows_from_the_tables() {
    let mut text = String::new();
    write_load(&mut text).expect("a string");
    compare("src/can/protocol.md", "<!-- generated -->\n\n", &text);
}
