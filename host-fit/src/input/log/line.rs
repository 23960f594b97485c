//! One line of a table, taken apart into cells.
//!
//! A cell that begins with a quotation mark ends with the next one and may hold separators; two
//! marks in it stand for one. No cell goes on in the next line: a mark that is not closed in its
//! line, as a ditto mark, is text.

use super::decimal;

/// How the cells of a table are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Dialect {
    pub(super) separator: u8,
    /// Whether numbers have decimal commas.
    pub(super) decimal_commas: bool,
}

/// Takes lines apart, one after the other.
#[derive(Debug, Default)]
pub(super) struct Splitter {
    cells: Vec<Cell>,
    /// The cells of a line whose text is not that of its cells.
    rebuilt: Vec<u8>,
}

/// A cell of the line in hand.
#[derive(Clone, Copy, Debug)]
struct Cell {
    /// Where it ends, in the text of the line or in `rebuilt`; a separator follows.
    end: usize,
    /// Its integer, if it is a plain one.
    integer: Option<i64>,
}

/// Most digits of a plain integer, which covers every sound code and time of a log.
const PLAIN_DIGITS: usize = 15;

/// The cells of a line.
#[derive(Clone, Copy, Debug)]
pub(super) struct Line<'a> {
    text: &'a [u8],
    cells: &'a [Cell],
    /// A cell with a decimal point in a table with decimal commas.
    pub(super) pointed: Option<usize>,
}

impl<'a> Line<'a> {
    /// How many cells it has.
    pub(super) const fn len(&self) -> usize {
        self.cells.len()
    }

    /// A cell, from 0; empty if there is none.
    #[inline]
    pub(super) fn cell(&self, cell: usize) -> &'a [u8] {
        let Some(&Cell { end, .. }) = self.cells.get(cell) else {
            return &[];
        };
        let before = cell
            .checked_sub(1)
            .and_then(|before| self.cells.get(before));
        let start = before.map_or(0, |before| before.end + 1);
        self.text.get(start..end).unwrap_or_default()
    }

    /// The integer in a cell that is written as up to 15 digits, with or without a minus sign.
    #[inline]
    pub(super) fn integer(&self, cell: usize) -> Option<i64> {
        self.cells.get(cell)?.integer
    }
}

/// A cell whose end is still to come.
#[derive(Clone, Copy, Debug, Default)]
struct OpenCell {
    start: usize,
    /// That of its digits, unless there are too many.
    value: u64,
    is_negative: bool,
    /// Whether it holds anything else than digits and a minus sign before them.
    is_other: bool,
}

impl OpenCell {
    #[inline]
    fn close(self, end: usize) -> Cell {
        let digits = end - self.start - usize::from(self.is_negative);
        let is_plain = !self.is_other && (1..=PLAIN_DIGITS).contains(&digits);
        // Fits: 15 digits.
        let value = self.value as i64;
        let value = if self.is_negative { -value } else { value };
        Cell {
            end,
            integer: is_plain.then_some(value),
        }
    }
}

impl Splitter {
    /// The cells of the line at the start of `text`, which may go on, and the length of the line
    /// without its end.
    pub(super) fn split<'a>(&'a mut self, text: &'a [u8], dialect: Dialect) -> (Line<'a>, usize) {
        self.cells.clear();
        let mut quoted = false;
        let mut end = text.len();
        let mut cell = OpenCell::default();
        for (at, byte) in text.iter().enumerate() {
            let digit = byte.wrapping_sub(b'0');
            if digit <= 9 {
                cell.value = cell.value.wrapping_mul(10).wrapping_add(u64::from(digit));
            } else if *byte == dialect.separator {
                self.cells.push(cell.close(at));
                cell = OpenCell {
                    start: at + 1,
                    ..OpenCell::default()
                };
            } else {
                match byte {
                    b'\n' | b'\r' => {
                        end = at;
                        break;
                    }
                    b'-' if at == cell.start => cell.is_negative = true,
                    _ => {
                        cell.is_other = true;
                        quoted |= *byte == b'"';
                    }
                }
            }
        }
        self.cells.push(cell.close(end));
        let text = text.get(..end).unwrap_or(text);
        if quoted || dialect.decimal_commas {
            return (self.rebuild(text, dialect), end);
        }
        let line = Line {
            text,
            cells: &self.cells,
            pointed: None,
        };
        (line, end)
    }

    fn rebuild(&mut self, text: &[u8], dialect: Dialect) -> Line<'_> {
        self.cells.clear();
        self.rebuilt.clear();
        let mut pointed = None;
        let mut rest = Some(text);
        while let Some(text) = rest {
            let start = self.rebuilt.len();
            rest = self.push_cell(text, dialect.separator);
            let cell = self.rebuilt.get_mut(start..).unwrap_or_default();
            if dialect.decimal_commas && decimal::is_number(cell) {
                if cell.contains(&b'.') {
                    pointed.get_or_insert(self.cells.len());
                }
                for byte in cell.iter_mut().filter(|byte| **byte == b',') {
                    *byte = b'.';
                }
            }
            self.cells.push(Cell {
                end: self.rebuilt.len(),
                integer: None,
            });
            self.rebuilt.push(dialect.separator);
        }
        Line {
            text: &self.rebuilt,
            cells: &self.cells,
            pointed,
        }
    }

    /// Adds the first cell of `text`; gives what follows its separator.
    fn push_cell<'t>(&mut self, text: &'t [u8], separator: u8) -> Option<&'t [u8]> {
        let start = self.rebuilt.len();
        let mut after = text;
        if let [b'"', inside @ ..] = text {
            after = inside;
            loop {
                let Some(mark) = after.iter().position(|byte| *byte == b'"') else {
                    // Not closed: a mark like any other.
                    self.rebuilt.truncate(start);
                    after = text;
                    break;
                };
                let (quoted, rest) = after.split_at(mark);
                self.rebuilt.extend_from_slice(quoted);
                match rest {
                    [_, b'"', rest @ ..] => {
                        self.rebuilt.push(b'"');
                        after = rest;
                    }
                    [_, rest @ ..] => {
                        after = rest;
                        break;
                    }
                    [] => break,
                }
            }
        }
        match after.iter().position(|byte| *byte == separator) {
            Some(end) => {
                let (cell, rest) = after.split_at(end);
                self.rebuilt.extend_from_slice(cell);
                rest.get(1..)
            }
            None => {
                self.rebuilt.extend_from_slice(after);
                None
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[track_caller]
    fn cells(text: &str, separator: u8, decimal_commas: bool) -> (Vec<String>, Option<usize>) {
        let dialect = Dialect {
            separator,
            decimal_commas,
        };
        let mut splitter = Splitter::default();
        let (line, length) = splitter.split(text.as_bytes(), dialect);
        assert_eq!(length, text.find(['\r', '\n']).unwrap_or(text.len()));
        let cell = |k| String::from_utf8_lossy(line.cell(k)).into_owned();
        assert_eq!(cell(line.len()), "", "there is none");
        ((0..line.len()).map(cell).collect(), line.pointed)
    }

    #[test]
    fn cells_may_be_quoted_and_never_go_on_in_the_next_line() {
        for (text, want) in [
            ("a,b\nc", &["a", "b"][..]),
            ("", &[""]),
            (",\r\n", &["", ""]),
            ("\"a,b\",c", &["a,b", "c"]),
            ("\"a\"\"b\",\"\"", &["a\"b", ""]),
            ("\"a\"b,c", &["ab", "c"]),
            (" \"a,b", &[" \"a", "b"]),
            ("1,\",2\n\",3", &["1", "\"", "2"]),
            ("\"\"\",2", &["\"\"\"", "2"]),
        ] {
            assert_eq!(cells(text, b',', false).0, want, "{text:?}");
        }
    }

    #[test]
    fn plain_integers_are_told_and_all_else_is_not() {
        let dialect = Dialect {
            separator: b',',
            decimal_commas: false,
        };
        let mut splitter = Splitter::default();
        let text =
            b"0,-12,007,-,,--1,1-,+1, 2,3.0,999999999999999,-999999999999999,1000000000000000,5";
        let (line, _) = splitter.split(text, dialect);
        let found: Vec<_> = (0..=line.len()).map(|cell| line.integer(cell)).collect();
        let most = 999_999_999_999_999;
        let mut want = vec![Some(0), Some(-12), Some(7)];
        want.extend([None; 7]);
        want.extend([Some(most), Some(-most), None, Some(5), None]);
        assert_eq!(found, want);
    }

    #[test]
    fn decimal_commas_become_points_and_points_are_told() {
        let split = |text| cells(text, b';', true);
        assert_eq!(split("0,5;\"-1,25\";a,b").0, ["0.5", "-1.25", "a,b"]);
        assert_eq!(split("0,5;1").1, None);
        assert_eq!(split("0,5;a.b;1.5;2.5").1, Some(2));
    }
}
