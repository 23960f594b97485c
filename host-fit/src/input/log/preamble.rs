//! Where the header of a table stands: instruments write notes above it, some put it in a comment.

use super::decimal;
use super::line::{Dialect, Splitter};
use super::table::COLUMNS_MAX;

/// Starts a comment, as the first byte of a line.
pub(super) const COMMENT: u8 = b'#';

/// How many lines of notes may stand above the header, comments and blank lines not counted.
const LINES_MAX: usize = 200;

/// So many names of columns that are known make a line the header.
const KNOWN_MIN: usize = 3;

/// The header of a table.
pub(super) struct HeaderLine {
    /// Its line, from 1.
    pub(super) line: usize,
    /// The first byte after it.
    pub(super) end: usize,
    /// What separates the cells of the table.
    pub(super) separator: u8,
    /// Names of the columns, without white space around them.
    pub(super) names: Vec<String>,
}

/// The header: the first line with at least three known names; without one, the line of known
/// names in the last comment above the rows, as NumPy writes it; without one, the line above the
/// first row of numbers, or above its row of units, with as many cells; without one, the first line
/// that is neither blank nor a comment. `None` if there is no such line.
pub(super) fn find_header(bytes: &[u8], is_known: impl Fn(&str) -> bool) -> Option<HeaderLine> {
    let known = |line: &HeaderLine| line.names.iter().filter(|name| is_known(name)).count();
    let mut plain: Vec<HeaderLine> = Vec::new();
    let mut comment = None;
    for Found { text, line, end } in lines(bytes) {
        if let Some(note) = text.strip_prefix(&[COMMENT]) {
            let line = header_line(note, line, end);
            let is_header = known(&line) >= KNOWN_MIN && !plain.iter().any(is_row);
            comment = if is_header { Some(line) } else { comment };
        } else if !text.trim_ascii().is_empty() {
            let line = header_line(text, line, end);
            if known(&line) >= KNOWN_MIN {
                return Some(line);
            }
            plain.push(line);
            if plain.len() == LINES_MAX {
                break;
            }
        }
    }
    let above_rows = || {
        let row = plain.iter().position(is_row)?;
        let cells = plain.get(row)?.names.len();
        let above = plain.get(..row)?.iter().rev();
        let as_many = above.take_while(|line| line.names.len() == cells).count();
        (as_many > 0).then_some(row - as_many)
    };
    let header = above_rows().unwrap_or(0);
    comment.or_else(|| plain.into_iter().nth(header))
}

/// Whether a line is more than half numbers, and has at least two.
fn is_row(line: &HeaderLine) -> bool {
    let is_number = |cell: &&String| {
        let cell = decimal::with_point(cell.as_bytes());
        core::str::from_utf8(&cell).is_ok_and(|cell| cell.parse::<f64>().is_ok())
    };
    let numbers = line.names.iter().filter(is_number).count();
    numbers >= 2 && 2 * numbers > line.names.len()
}

/// Whether every name is a number: then the line is a row.
pub(super) fn is_numeric(names: &[String]) -> bool {
    names.iter().all(|name| name.parse::<f64>().is_ok())
}

/// A line without its break.
struct Found<'a> {
    text: &'a [u8],
    /// Its number, from 1.
    line: usize,
    /// The first byte after it.
    end: usize,
}

/// The lines; one between the carriage return and the line feed of a line break is empty.
fn lines(bytes: &[u8]) -> impl Iterator<Item = Found<'_>> {
    let (mut start, mut line) = (0, 1);
    bytes
        .split(|b| *b == b'\n' || *b == b'\r')
        .map(move |text| {
            let end = start + text.len();
            let found = Found { text, line, end };
            let is_half = bytes.get(end..end + 2) == Some(b"\r\n");
            (start, line) = (end + 1, line + usize::from(!is_half));
            found
        })
}

fn header_line(text: &[u8], line: usize, end: usize) -> HeaderLine {
    let separator = separator(text);
    let dialect = Dialect {
        separator,
        decimal_commas: false,
    };
    let mut splitter = Splitter::default();
    let (cells, _) = splitter.split(text, dialect);
    // One too many is enough to refuse it.
    let cells = (0..cells.len().min(COLUMNS_MAX + 1)).map(|cell| cells.cell(cell));
    HeaderLine {
        line,
        end,
        separator,
        names: cells.map(self::text).collect(),
    }
}

/// A cell's text without white space around it. What is not UTF-8 is Latin-1, in which older
/// programs write the micro sign.
pub(super) fn text(cell: &[u8]) -> String {
    let cell = cell.trim_ascii();
    match core::str::from_utf8(cell) {
        Ok(text) => text.trim().to_owned(),
        Err(_) => cell.iter().map(|byte| char::from(*byte)).collect(),
    }
}

/// The separator of the cells: of comma, semicolon and tab, the one that the header has most.
fn separator(header: &[u8]) -> u8 {
    let count = |separator: u8| header.iter().filter(|b| **b == separator).count();
    let mut best = b',';
    for candidate in [b';', b'\t'] {
        if count(candidate) > count(best) {
            best = candidate;
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;

    #[track_caller]
    fn header(text: &str) -> (usize, Vec<String>) {
        let is_known = |name: &str| ["a", "b", "c", "d"].contains(&name);
        let line = find_header(text.as_bytes(), is_known).expect("a header");
        (line.line, line.names)
    }

    #[test]
    fn notes_above_the_header_are_passed_over() {
        let names = ["a", "b", "c"].map(str::to_owned).to_vec();
        for (text, line) in [
            ("a,b,c\n1,2,3", 1),
            (
                "Stage 7\nDate;2026-01-02;\"open quote\n\n# note\n a;b ;c\n1;2;3",
                5,
            ),
            ("rate\t500\na\tb\tc\n1\t2\t3", 2),
            ("# by hand\n# a,b,c\n1,2,3", 2),
            ("# a,b,c\nrate,500,2\na,b,c\n1,2,3", 3),
        ] {
            assert_eq!(header(text), (line, names.clone()), "{text:?}");
        }
        // Nothing is known: the line above the rows, or the first that is no comment.
        assert_eq!(header("note\nrate;500\nx;y;z\num;um;V\n1;2,5;3").0, 3);
        assert_eq!(
            header("note\n\n# note\nx,y,z\n2026-01-02T03:04:05,2,3").0,
            4
        );
        assert_eq!(header("# note\n\nx,y\n1,2").0, 3);
        assert_eq!(header("1,2\n3,4").0, 1);
        assert!(find_header(b"\n# a\n", |_| true).is_none());
    }
}
