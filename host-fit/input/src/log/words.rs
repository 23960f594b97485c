//! The cells of a line as words: names of columns, or numbers and times.

use super::decimal;
use super::record::Record;
use super::table::COLUMNS_MAX;
use super::time::is_time;
use std::collections::BTreeSet;

/// The cells of a record as text; one column too many is enough to refuse it.
pub(super) fn names(record: &Record) -> Vec<String> {
    let cells = record.cells().take(COLUMNS_MAX + 1);
    cells.map(|cell| text(cell.text)).collect()
}

/// The names of a header, by the white space between them.
pub(super) fn columns(header: &[u8], between: &str) -> Vec<String> {
    let header = text(header);
    let names = header.split(between).map(str::trim);
    names
        .filter(|name| !name.is_empty())
        .map(str::to_owned)
        .collect()
}

/// Whether cells are more than half numbers and times, and at least two.
pub(super) fn are_numbers(cells: &[String]) -> bool {
    let is_number =
        |cell: &&String| decimal::is_number(cell.as_bytes()) || is_time(cell.as_bytes());
    let numbers = cells.iter().filter(is_number).count();
    numbers >= 2 && 2 * numbers > cells.len()
}

/// Whether cells are distinct words, for at least half of the usual cells; or pairs with the same first word each, as
/// where every signal has a column for its time.
pub(super) fn are_names(names: &[String], cells: usize) -> bool {
    let pairs = names.chunks(2);
    let are_pairs = names.len() > 3 && pairs.clone().all(|pair| pair.first() == names.first());
    let pairs = pairs.filter_map(<[String]>::last);
    let names: Vec<&String> = match are_pairs {
        true => names.iter().take(1).chain(pairs).collect(),
        false => names.iter().filter(|name| !name.is_empty()).collect(),
    };
    let distinct: BTreeSet<&&String> = names.iter().collect();
    distinct.len() == names.len()
        && names.len() >= 2
        && 2 * names.len() >= cells
        && names.into_iter().all(is_word)
}

/// Whether a cell is neither empty nor a number or a time.
pub(super) fn is_word(cell: &String) -> bool {
    let cell = cell.as_bytes();
    !cell.is_empty() && !decimal::is_number(cell) && !is_time(cell)
}

/// A cell's text without white space around it. Other text than UTF-8 is Latin-1: older programs write the micro
/// sign in it.
pub(super) fn text(cell: &[u8]) -> String {
    let cell = cell.trim_ascii();
    match core::str::from_utf8(cell) {
        Ok(text) => text.trim().to_owned(),
        Err(_) => cell.iter().map(|byte| char::from(*byte)).collect(),
    }
}
