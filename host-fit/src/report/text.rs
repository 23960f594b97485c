//! Figures and tables as plain text.

use super::figure::Figure;
use super::table::Table;
use hallstage_input::axis::{AXES, sign};
use std::borrow::Cow;
use std::path::Path;

impl Figure {
    /// What a cell of a table shows, without the unit.
    pub(super) fn text(&self) -> String {
        match self {
            Self::None => "-".to_owned(),
            Self::Text(text) if text.is_empty() => "-".to_owned(),
            Self::Text(text) => text.clone(),
            Self::Is(is) => (if *is { "yes" } else { "no" }).to_owned(),
            Self::Count(count) => count.to_string(),
            Self::Number { value, .. } if !value.is_finite() => "-".to_owned(),
            Self::Number { value, unit, error } => match error.filter(|error| *error > 0.0) {
                None => number(*value, unit.name),
                Some(error) => with_error(*value, error),
            },
            Self::List(all) => {
                let is_mixed = all.iter().any(|one| matches!(one, Self::Text(_)))
                    && all.iter().any(|one| matches!(one, Self::Number { .. }));
                let with_unit = |one: &Self| {
                    format!("{} {}", one.text(), sign(one.unit().name))
                        .trim_end()
                        .to_owned()
                };
                let text = |one: &Self| if is_mixed { with_unit(one) } else { one.text() };
                let all: Vec<String> = all.iter().map(text).collect();
                all.join(if is_mixed { " " } else { ", " })
            }
        }
    }
}

/// A number in its unit: um, urad, us and percent to a thousandth, others in six significant digits.
fn number(x: f64, unit: &str) -> String {
    let size = x.abs();
    let decimals = match unit {
        _ if x == 0.0 => return "0".to_owned(),
        "um" | "urad" | "us" | "%" if size >= 0.01 => return format!("{x:.3}"),
        _ if !(1e-4..1e9).contains(&size) => return format!("{x:.3e}"),
        _ => (5.0 - size.log10().floor()).clamp(0.0, 9.0) as usize,
    };
    trimmed(x, decimals)
}

/// A number with at most this many decimals.
pub(super) fn trimmed(x: f64, decimals: usize) -> String {
    let text = format!("{x:.decimals$}");
    match text.contains('.') {
        true => text.trim_end_matches('0').trim_end_matches('.').to_owned(),
        false => text,
    }
}

/// A value with two digits of its standard error in brackets: -192.98(14).
fn with_error(value: f64, error: f64) -> String {
    let decimals = (1.0 - error.log10().floor()).clamp(0.0, 12.0);
    let digits = (error * 10f64.powf(decimals)).round();
    let decimals = decimals as usize;
    format!("{value:.decimals$}({digits:.0})")
}

/// Tables for a terminal: names and texts to the left, numbers to the right.
pub fn as_text(tables: &[Table]) -> String {
    let mut out = String::new();
    for table in tables {
        if !out.is_empty() {
            out.push('\n');
        }
        if !table.title.is_empty() {
            out += &format!("{}\n", table.title);
        }
        let cells = table.cells();
        let lines = || {
            (!cells.titles.is_empty())
                .then_some(&cells.titles)
                .into_iter()
                .chain(&cells.rows)
        };
        let width = |k: usize| {
            lines()
                .filter_map(|line| line.get(k))
                .map(|cell| plain(cell, "").chars().count())
                .max()
        };
        let widths: Vec<usize> = (0..).map_while(width).collect();
        for line in lines() {
            let mut text = String::from(" ");
            for ((cell, width), is_left) in line.iter().zip(&widths).zip(&cells.is_left) {
                let cell = plain(cell, "");
                text += &match is_left {
                    true => format!(" {cell:<width$} "),
                    false => format!(" {cell:>width$} "),
                };
            }
            out += text.trim_end();
            out.push('\n');
        }
    }
    out
}

/// A key as words, and the key of an axis as its name.
pub(super) fn words(key: &str) -> String {
    let axis = AXES.iter().find(|axis| axis.key == key);
    axis.map_or_else(|| key.replace('_', " "), |axis| axis.name.to_owned())
}

/// Text with escaped control characters, except the characters of `kept`. Characters that reorder their neighbours are
/// escaped, too. So a name, a cell or a serial number from a file cannot forge a line.
pub fn plain<'t>(text: &'t str, kept: &str) -> Cow<'t, str> {
    let harmful = |c: char| {
        let moves = c.is_control()
            || matches!(c, '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}' | '\u{2028}' | '\u{2029}');
        moves && !kept.contains(c)
    };
    if !text.contains(harmful) {
        return Cow::Borrowed(text);
    }
    let mut plain = String::with_capacity(text.len());
    for c in text.chars() {
        match harmful(c) {
            true => plain.extend(c.escape_default()),
            false => plain.push(c),
        }
    }
    Cow::Owned(plain)
}

/// The name of a file without its folder.
pub fn file_name(path: &Path) -> String {
    let name = path.file_name().unwrap_or(path.as_os_str());
    name.to_string_lossy().into_owned()
}

#[cfg(test)]
mod tests {
    use crate::report::figure::{bare, figure};

    #[test]
    fn numbers_have_the_digits_of_their_unit_and_of_their_standard_error() {
        for (figure, want) in [
            (figure(1.5, "um"), "1.500"),
            (figure(0.00012, "um"), "0.00012"),
            (figure(0.1945, "m"), "0.1945"),
            (figure(1e-9, "m"), "1.000e-9"),
            (figure(12.0, "s"), "12"),
            (figure(0.0, "um"), "0"),
            (
                bare(-192.9812, "1/m").with_error(Some(0.1411)),
                "-192.98(14)",
            ),
            (bare(0.2, "1").with_error(Some(1.234e-5)), "0.200000(12)"),
            (bare(1234.0, "1/m").with_error(Some(120.0)), "1234(120)"),
            (bare(0.85, "1").with_error(None), "0.85"),
            (figure(f64::NAN, "um"), "-"),
        ] {
            assert_eq!(figure.text(), want);
        }
    }
}
