//! A result as tables: of every figure its name, its value and its unit. The terminal and the pages
//! show the same tables, and JSON has the same figures.

use hallstage_solver::problem::terms::shown;
use serde::Serialize;
use serde_json::{Map, Value};
use std::borrow::Cow;
use std::path::Path;

/// The units that end the name of a figure.
const UNITS: [&str; 9] = ["um", "urad", "us", "ms", "s", "m", "rad", "hz", "percent"];

/// Figures that have no unit where the others beside them have one.
const BARE: [&str; 5] = ["sigma", "of_prior", "ratio", "correlation", "inflation"];

/// A table. The first cell of a row names it.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Table {
    /// What it shows.
    pub title: String,
    /// Titles of the columns; none where every row is a name with its value and unit.
    pub columns: Vec<String>,
    /// Rows of as many cells.
    pub rows: Vec<Vec<String>>,
}

impl Table {
    /// A table with these columns after the one of the names.
    pub fn new(title: impl Into<String>, columns: &[&str]) -> Self {
        let columns = [""].iter().chain(columns);
        Self {
            title: title.into(),
            columns: columns.map(|title| (*title).to_owned()).collect(),
            rows: Vec::new(),
        }
    }

    /// Adds a row.
    pub fn row(&mut self, name: impl Into<String>, cells: impl IntoIterator<Item = String>) {
        self.rows
            .push(std::iter::once(name.into()).chain(cells).collect());
    }
}

/// The tables of a result: its plain figures first, then one for each group of figures, in the order
/// in which they stand. What is null, empty or `hidden` is left out.
pub fn tables(result: &impl Serialize, hidden: &[&str]) -> Vec<Table> {
    let Ok(Value::Object(fields)) = serde_json::to_value(result) else {
        return Vec::new();
    };
    let mut tables = group("", &fields, hidden);
    tables.retain(|table| !table.rows.is_empty());
    tables
}

/// The tables of an object: one of its plain figures, one with a row for each object in it, and those of
/// what holds objects or lists itself.
fn group(title: &str, members: &Map<String, Value>, hidden: &[&str]) -> Vec<Table> {
    let mut plain = Table {
        title: words(title),
        ..Table::default()
    };
    let mut rows = Vec::new();
    let mut others = Vec::new();
    for (key, value) in members
        .iter()
        .filter(|(key, _)| !hidden.contains(&key.as_str()))
    {
        let inner = format!("{title} {key}");
        match value {
            Value::Object(object) if title.is_empty() || object.values().any(Value::is_object) => {
                others.extend(group(inner.trim(), object, &[]));
            }
            Value::Object(object) => {
                let mut row = object.clone();
                row.shift_insert(0, String::new(), Value::String(key.clone()));
                rows.push(row);
            }
            Value::Array(items) if items.iter().any(Value::is_object) => {
                others.push(list_of(
                    inner.trim(),
                    items.iter().filter_map(Value::as_object),
                ));
            }
            Value::Array(items) if items.iter().any(Value::is_array) => {
                let cells =
                    |row: &Vec<Value>| row.iter().filter_map(|x| text_of(x, 1.0, "")).collect();
                others.push(Table {
                    title: words(inner.trim()),
                    columns: Vec::new(),
                    rows: items
                        .iter()
                        .filter_map(Value::as_array)
                        .map(cells)
                        .collect(),
                });
            }
            value => plain
                .rows
                .extend(figure(key, value, "").map(|[name, text, unit]| {
                    vec![name, format!("{text} {unit}").trim_end().to_owned()]
                })),
        }
    }
    // One beside plain figures has a title, not a name.
    let rows = match &mut rows[..] {
        [row] if !plain.rows.is_empty() && !title.is_empty() => {
            let name = row.shift_remove("").unwrap_or_default();
            let title = format!("{title} {}", name.as_str().unwrap_or_default());
            list_of(&title, std::iter::once(&*row))
        }
        rows => list_of(title, rows.iter()),
    };
    let mut tables = vec![plain, rows];
    tables.append(&mut others);
    tables
}

/// A table with a row for each item.
pub fn list(title: &str, items: &[impl Serialize]) -> Table {
    let objects: Vec<_> = items
        .iter()
        .filter_map(|item| serde_json::to_value(item).ok())
        .collect();
    list_of(title, objects.iter().filter_map(Value::as_object))
}

/// A table with a row for each object, which its first text names. Units stand at the end of the rows
/// where each row has one of its own, else in the titles of the columns.
fn list_of<'m>(title: &str, objects: impl Iterator<Item = &'m Map<String, Value>>) -> Table {
    let mut columns: Vec<[String; 2]> = Vec::new();
    let mut rows: Vec<Vec<(usize, [String; 3])>> = Vec::new();
    for object in objects {
        let mut figures = Vec::new();
        flatten("", object, &mut figures);
        let mut row = Vec::new();
        for figure in figures {
            let place = columns.iter().position(|column| column[0] == figure[0]);
            let place = place.unwrap_or_else(|| {
                columns.push([figure[0].clone(), figure[2].clone()]);
                columns.len() - 1
            });
            row.push((place, figure));
        }
        rows.push(row);
    }
    let unit_of = |row: &[(usize, [String; 3])]| {
        let mut units = row.iter().map(|(_, figure)| figure[2].as_str());
        let unit = units
            .find(|unit| !unit.is_empty())
            .unwrap_or_default()
            .to_owned();
        let others = row.iter().map(|(_, figure)| figure[2].as_str());
        others
            .into_iter()
            .all(|other| other.is_empty() || other == unit)
            .then_some(unit)
    };
    let of_rows: Option<Vec<String>> = rows.iter().map(|row| unit_of(row)).collect();
    let of_rows = of_rows.filter(|units| units.iter().any(|unit| !unit.is_empty()));
    let mut table = Table {
        title: words(title),
        columns: (columns.iter())
            .map(|[name, unit]| match (&of_rows, unit.as_str()) {
                (Some(_), _) | (_, "") => name.clone(),
                (None, unit) => format!("{name}, {unit}"),
            })
            .collect(),
        rows: Vec::new(),
    };
    if of_rows.is_some() {
        table.columns.push("unit".to_owned());
    }
    for (k, row) in rows.into_iter().enumerate() {
        let mut cells = vec!["-".to_owned(); columns.len()];
        for (place, [_, text, _]) in row {
            cells[place] = text;
        }
        cells.extend(of_rows.as_ref().map(|units| units[k].clone()));
        table.rows.push(cells);
    }
    table
}

/// The figures of an object and of the objects in it: name, text and unit of each.
fn flatten(before: &str, object: &Map<String, Value>, figures: &mut Vec<[String; 3]>) {
    let unit = object
        .get("unit")
        .and_then(Value::as_str)
        .unwrap_or_default();
    for (key, value) in object.iter().filter(|(key, _)| *key != "unit") {
        let name = format!("{before}{key}");
        match value {
            Value::Object(inner) => flatten(&format!("{name} "), inner, figures),
            plain => {
                let absent = || figure(&name, &Value::String(String::new()), unit);
                figures.extend(figure(&name, plain, unit).or_else(absent));
            }
        }
    }
}

/// Name, text and unit of a plain figure; `None` where there is none.
fn figure(key: &str, value: &Value, unit: &str) -> Option<[String; 3]> {
    let parts = |unit: &&'static str| Some((key.strip_suffix(*unit)?.strip_suffix('_')?, *unit));
    let parts = UNITS.iter().find_map(parts);
    let (name, suffix) = parts.map_or((key, None), |(name, unit)| (name, Some(unit)));
    // Small lengths and angles read better in millionths.
    let is_small = value.as_f64().is_some_and(|x| x.abs() < 0.01);
    let (scale, unit) = match suffix {
        Some("m") if is_small => (1e6, "um"),
        Some("rad") if is_small => (1e6, "urad"),
        Some(suffix) => (1.0, suffix),
        None if BARE.contains(&key) => (1.0, ""),
        None => shown(1.0, unit),
    };
    let text = text_of(value, scale, unit)?;
    Some([words(name), text, unit.to_owned()])
}

fn text_of(value: &Value, scale: f64, unit: &str) -> Option<String> {
    Some(match value {
        Value::Null => return None,
        Value::Object(members) => {
            let unit = members
                .get("unit")
                .and_then(Value::as_str)
                .unwrap_or_default();
            let parts = members
                .values()
                .filter_map(|value| text_of(value, 1.0, unit));
            parts.collect::<Vec<_>>().join(" ")
        }
        Value::Bool(is) => (if *is { "yes" } else { "no" }).to_owned(),
        Value::String(text) if text.is_empty() => "-".to_owned(),
        Value::String(text) => text.clone(),
        Value::Number(n) if n.is_f64() => number(n.as_f64()? * scale, unit),
        Value::Number(whole) => whole.to_string(),
        Value::Array(items) => {
            let between =
                if items.iter().any(Value::is_string) && items.iter().any(Value::is_number) {
                    " "
                } else {
                    ", "
                };
            let items = items.iter().filter_map(|item| text_of(item, scale, unit));
            let items: Vec<String> = items.collect();
            (!items.is_empty()).then(|| items.join(between))?
        }
    })
}

fn words(key: &str) -> String {
    key.replace('_', " ")
}

/// A number in its unit: um, urad and us to a thousandth, others in six significant digits.
pub fn number(x: f64, unit: &str) -> String {
    let size = x.abs();
    let decimals = match unit {
        _ if x == 0.0 => return "0".to_owned(),
        "um" | "urad" | "us" | "percent" if size >= 0.01 => return format!("{x:.3}"),
        _ if !(1e-4..1e9).contains(&size) => return format!("{x:.3e}"),
        _ => (5.0 - size.log10().floor()).clamp(0.0, 9.0) as usize,
    };
    let text = format!("{x:.decimals$}");
    match text.contains('.') {
        true => text.trim_end_matches('0').trim_end_matches('.').to_owned(),
        false => text,
    }
}

/// A value with its standard error, in units of the last digits: -192.98(14).
pub fn with_error(value: f64, error: Option<f64>) -> String {
    match error.filter(|error| *error > 0.0) {
        None => number(value, ""),
        Some(error) => {
            // Two digits of the standard error.
            let decimals = (1.0 - error.log10().floor()).clamp(0.0, 12.0);
            let digits = (error * 10f64.powf(decimals)).round();
            let decimals = decimals as usize;
            format!("{value:.decimals$}({digits:.0})")
        }
    }
}

/// Tables for a terminal.
pub fn as_text(tables: &[Table]) -> String {
    let mut out = String::new();
    for table in tables {
        if !out.is_empty() {
            out.push('\n');
        }
        if !table.title.is_empty() {
            out += &format!("{}\n", table.title);
        }
        let has_titles = table.columns.iter().any(|title| !title.is_empty());
        let lines: Vec<&Vec<String>> = (has_titles.then_some(&table.columns).into_iter())
            .chain(&table.rows)
            .collect();
        let columns = lines.iter().map(|cells| cells.len()).max().unwrap_or(0);
        let widths: Vec<usize> = (0..columns)
            .map(|k| {
                let cells = lines.iter().filter_map(|cells| cells.get(k));
                cells
                    .map(|cell| plain(cell, "").chars().count())
                    .max()
                    .unwrap_or(0)
            })
            .collect();
        for cells in lines {
            let mut line = String::from(" ");
            for (k, cell) in cells.iter().enumerate() {
                let (width, cell) = (widths[k], plain(cell, ""));
                // Names and texts to the left, numbers to the right.
                let is_number = |row: &Vec<String>| row.get(k).is_none_or(|cell| is_number(cell));
                line += &match k > 0 && has_titles && table.rows.iter().all(is_number) {
                    true => format!(" {cell:>width$} "),
                    false => format!(" {cell:<width$} "),
                };
            }
            out += line.trim_end();
            out.push('\n');
        }
    }
    out
}

/// Text with its control characters escaped, those of `kept` excepted, and those that reorder what
/// stands beside them: a name, cell or serial number of a file shows as it is and forges no line.
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

/// Text with the signs of micrometres, microradians and microseconds where these units follow a number or
/// a comma, or stand alone.
pub fn with_signs(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    let mut before = "";
    for word in text.split_inclusive([' ', '\n', '/', ',', ';', ':', ')', '(']) {
        let bare = word.trim_end_matches([' ', '\n', '/', ',', ';', ':', ')', '.']);
        let follows = before.ends_with([',', '(', '/'])
            || before.ends_with(|c: char| c.is_ascii_digit())
            || before.is_empty();
        match bare {
            "um" | "urad" | "us" if follows => {
                out.push('µ');
                out.push_str(&word[1..]);
            }
            _ => out.push_str(word),
        }
        before = word.trim_end_matches([' ', '\n']);
    }
    out
}

/// The name of a file without its folder.
pub fn file_name(path: &Path) -> String {
    let name = path.file_name().unwrap_or(path.as_os_str());
    name.to_string_lossy().into_owned()
}

/// Whether a cell is a number, or stands for one.
fn is_number(cell: &str) -> bool {
    let number = cell.split_once('(').map_or(cell, |(number, _)| number);
    matches!(cell, "" | "-") || number.parse::<f64>().is_ok()
}

#[cfg(test)]
#[path = "table_tests.rs"]
mod tests;
