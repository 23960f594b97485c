//! Where the header of a table stands: instruments write notes above it, some put it in a comment.

use super::decimal;
use super::lines::{TextLine, lines_of};
use super::record::{Dialect, Record};
use super::table::COLUMNS_MAX;

/// Starts a comment, as the first byte of a line.
pub(super) const COMMENT: u8 = b'#';

/// What may separate cells.
const SEPARATORS: [u8; 3] = [b',', b';', b'\t'];

/// Most lines of notes above the header, without comments and blank lines.
const LINES_MAX: usize = 200;

/// Fewest known names of columns in a header.
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
    let mut records = SEPARATORS.map(|separator| {
        Record::new(Dialect {
            separator,
            decimal_commas: false,
        })
    });
    for TextLine { text, line, end } in lines_of(bytes) {
        let note = text.strip_prefix(&[COMMENT]);
        let found = HeaderLine::new(note.unwrap_or(text), line, end, &mut records);
        if note.is_some() {
            let is_header = known(&found) >= KNOWN_MIN && !plain.iter().any(is_row);
            comment = if is_header { Some(found) } else { comment };
        } else if !text.trim_ascii().is_empty() {
            if known(&found) >= KNOWN_MIN {
                return Some(found);
            }
            plain.push(found);
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
    let is_number = |cell: &&String| decimal::is_number(cell.as_bytes());
    let numbers = line.names.iter().filter(is_number).count();
    numbers >= 2 && 2 * numbers > line.names.len()
}

/// Whether every name is a number: then the line is a row.
pub(super) fn is_numeric(names: &[String]) -> bool {
    names.iter().all(|name| name.parse::<f64>().is_ok())
}

impl HeaderLine {
    fn new(text: &[u8], line: usize, end: usize, records: &mut [Record; 3]) -> Self {
        // The most frequent separator of the line.
        let count = |which: &usize| text.iter().filter(|b| **b == SEPARATORS[*which]).count();
        let which = (1..3).fold(0, |best, other| match count(&other) > count(&best) {
            true => other,
            false => best,
        });
        let record = &mut records[which];
        record.split(text);
        // One column too many is enough to refuse it.
        let cells = record.cells().take(COLUMNS_MAX + 1);
        Self {
            line,
            end,
            separator: SEPARATORS[which],
            names: cells.map(|cell| self::text(cell.text)).collect(),
        }
    }
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
        // Without known names: the line above the rows, or the first line that is no comment.
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
