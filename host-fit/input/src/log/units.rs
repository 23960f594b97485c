//! Units, and how headers write them: `ifm_x_um`, `X [um]`, `X (um)`, `X/um`, with either micro
//! sign.

use super::layout::Dimension;
use std::borrow::Cow;

const LENGTHS: [(&str, f64); 5] = [
    ("m", 1.0),
    ("mm", 1e-3),
    ("um", 1e-6),
    ("nm", 1e-9),
    ("pm", 1e-12),
];
const ANGLES: [(&str, f64); 5] = [
    ("rad", 1.0),
    ("mrad", 1e-3),
    ("urad", 1e-6),
    ("nrad", 1e-9),
    ("deg", core::f64::consts::PI / 180.0),
];
/// `days` are times of spreadsheets; `iso` is a date and time or a duration, which a cell says by itself: a number is
/// us.
const TIMES_TO_US: [(&str, f64); 6] = [
    ("s", 1e6),
    ("ms", 1e3),
    ("us", 1.0),
    ("ns", 1e-3),
    ("days", 8.64e10),
    ("iso", 1.0),
];
const VOLTAGES: [(&str, f64); 3] = [("V", 1.0), ("mV", 1e-3), ("uV", 1e-6)];
/// Marks of codes and indices, which have no unit.
const COUNTS: [&str; 7] = ["", "-", "cnt", "count", "counts", "code", "LSB"];

/// Units by their words.
const WORDS: [(&str, &str); 7] = [
    ("sec", "s"),
    ("secs", "s"),
    ("second", "s"),
    ("seconds", "s"),
    ("msec", "ms"),
    ("volt", "V"),
    ("volts", "V"),
];

/// A symbol as the tables here write it.
fn plain(symbol: &str) -> Cow<'_, str> {
    let symbol = symbol.trim();
    let mut words = WORDS.into_iter();
    if let Some((_, unit)) = words.find(|(word, _)| symbol.eq_ignore_ascii_case(word)) {
        return unit.into();
    }
    match symbol.is_ascii() {
        true => symbol.into(),
        false => symbol
            .replace(['\u{b5}', '\u{3bc}'], "u")
            .replace('\u{b0}', "deg")
            .into(),
    }
}

/// The unit in a cell below a header: without brackets around it, or without a remark in brackets behind it.
pub(super) fn inside(cell: &str) -> &str {
    let cell = cell.trim();
    let bare = cell
        .strip_prefix('[')
        .and_then(|cell| cell.strip_suffix(']'));
    let bare = bare.or_else(|| cell.strip_prefix('(')?.strip_suffix(')'));
    bare.unwrap_or_else(|| cell.split_once(" (").map_or(cell, |(unit, _)| unit))
}

/// Whether the symbol stands for no unit.
pub fn is_count(symbol: &str) -> bool {
    COUNTS.contains(&symbol.trim())
}

/// Whether the symbol says that a time counts rows.
pub fn is_rows(symbol: &str) -> bool {
    ["row", "rows", "sample", "samples"].contains(&symbol.trim())
}

/// Whether the symbol is a unit of any kind.
pub(super) fn is_known(symbol: &str) -> bool {
    let kinds = [
        Dimension::Length,
        Dimension::Angle,
        Dimension::Time,
        Dimension::Code,
    ];
    kinds.into_iter().any(|kind| kind.unit(symbol).is_some())
}

impl Dimension {
    const fn table(self) -> &'static [(&'static str, f64)] {
        match self {
            Self::Length => &LENGTHS,
            Self::Angle => &ANGLES,
            Self::Time => &TIMES_TO_US,
            Self::Code => &VOLTAGES,
            Self::Index => &[],
        }
    }

    /// One `symbol` in m, rad, us or, for codes, V; `None` if this kind has no such unit.
    pub fn unit(self, symbol: &str) -> Option<f64> {
        let symbol = plain(symbol);
        let found = self.table().iter().find(|(name, _)| *name == symbol)?;
        Some(found.1)
    }

    /// Whether one unit of this kind is `scale` m, rad or us.
    pub(super) fn has_unit(self, scale: f64) -> bool {
        self.table().iter().any(|(_, unit)| *unit == scale)
    }

    /// The unit that a column's name ends in, as `_nm` in `ifm_x_nm` or `[um]` in `X [um]`.
    pub fn unit_in_name(self, name: &str) -> Option<f64> {
        self.unit(split(name).1.unwrap_or(name))
    }

    /// Its units, as messages list them.
    pub fn units(self) -> String {
        let symbols: Vec<&str> = self.table().iter().map(|(symbol, _)| *symbol).collect();
        match (self, symbols.join(", ")) {
            (Self::Index, _) => "none".to_owned(),
            (Self::Time, symbols) => symbols + ", rows",
            (_, symbols) => symbols,
        }
    }

    /// The SI unit, and its scale; `None` for numbers without a unit, and for voltages.
    pub fn si(self) -> Option<(&'static str, f64)> {
        let first = || self.table().first().copied();
        first().filter(|_| !matches!(self, Self::Index | Self::Code))
    }
}

/// A column's name without its unit, and the unit: the text in brackets at its end, or a known unit after the last
/// slash or underscore.
pub fn split(name: &str) -> (&str, Option<&str>) {
    let name = name.trim();
    for (open, close) in [('[', ']'), ('(', ')')] {
        let inside = name.strip_suffix(close).and_then(|n| n.rsplit_once(open));
        if let Some((base, unit)) = inside {
            return (base.trim_end(), Some(unit.trim()));
        }
    }
    let is_unit = |unit: &str| is_known(unit) || (is_count(unit) && !unit.trim().is_empty());
    for mark in ['/', '_'] {
        if let Some((base, unit)) = name.rsplit_once(mark).filter(|(_, unit)| is_unit(unit)) {
            return (base.trim_end(), Some(unit.trim()));
        }
    }
    (name, None)
}

/// A name without its unit, written like a key: lower case, one underscore between words.
pub fn to_key(base: &str) -> String {
    let words = base.split(|c: char| c.is_whitespace() || "_-.".contains(c));
    let words: Vec<String> = words
        .filter(|word| !word.is_empty())
        .map(str::to_lowercase)
        .collect();
    words.join("_")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_is_split_into_base_and_unit_in_every_spelling() {
        for (name, base, unit) in [
            ("ifm_x_nm", "ifm_x", Some("nm")),
            ("Time (sec)", "Time", Some("sec")),
            ("X [um]", "X", Some("um")),
            ("X(um)", "X", Some("um")),
            ("X / \u{b5}m", "X", Some("\u{b5}m")),
            ("ifm_y1_\u{3bc}m", "ifm_y1", Some("\u{3bc}m")),
            ("hall_a_cnt", "hall_a", Some("cnt")),
            ("Hall A [mV]", "Hall A", Some("mV")),
            ("T [degC]", "T", Some("degC")),
            ("hall_a", "hall_a", None),
            ("ifm_x_", "ifm_x_", None),
            ("movement", "movement", None),
            ("X/Y_um", "X/Y", Some("um")),
            ("in/out", "in/out", None),
            ("[", "[", None),
            ("", "", None),
        ] {
            assert_eq!(split(name), (base, unit), "{name}");
        }
        assert_eq!(to_key("Hall  A"), "hall_a");
        assert_eq!(to_key("IFM-Y1"), "ifm_y1");
    }
}
