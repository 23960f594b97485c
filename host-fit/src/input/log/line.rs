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
    /// Where the cells of the line in hand end, in its text or in `rebuilt`; a separator follows.
    ends: Vec<usize>,
    /// The cells of a line whose text is not that of its cells.
    rebuilt: Vec<u8>,
}

/// The cells of a line.
#[derive(Clone, Copy, Debug)]
pub(super) struct Line<'a> {
    text: &'a [u8],
    ends: &'a [usize],
    /// A cell with a decimal point in a table with decimal commas.
    pub(super) pointed: Option<usize>,
}

impl<'a> Line<'a> {
    /// How many cells it has.
    pub(super) const fn len(&self) -> usize {
        self.ends.len()
    }

    /// A cell, from 0; empty if there is none.
    #[inline]
    pub(super) fn cell(&self, cell: usize) -> &'a [u8] {
        let Some(&end) = self.ends.get(cell) else {
            return &[];
        };
        let before = cell.checked_sub(1).and_then(|before| self.ends.get(before));
        let start = before.map_or(0, |before| before + 1);
        self.text.get(start..end).unwrap_or_default()
    }
}

impl Splitter {
    /// The cells of the line at the start of `text`, which may go on, and the length of the line
    /// without its end.
    pub(super) fn split<'a>(&'a mut self, text: &'a [u8], dialect: Dialect) -> (Line<'a>, usize) {
        self.ends.clear();
        let mut quoted = false;
        let mut end = text.len();
        for (at, byte) in text.iter().enumerate() {
            // Of all bytes only these matter, and digits are none of them.
            if *byte == dialect.separator {
                self.ends.push(at);
            } else if *byte <= b'"' {
                match byte {
                    b'\n' | b'\r' => {
                        end = at;
                        break;
                    }
                    b'"' => quoted = true,
                    _ => {}
                }
            }
        }
        self.ends.push(end);
        let text = text.get(..end).unwrap_or(text);
        if quoted || dialect.decimal_commas {
            return (self.rebuild(text, dialect), end);
        }
        let line = Line {
            text,
            ends: &self.ends,
            pointed: None,
        };
        (line, end)
    }

    fn rebuild(&mut self, text: &[u8], dialect: Dialect) -> Line<'_> {
        self.ends.clear();
        self.rebuilt.clear();
        let mut pointed = None;
        let mut rest = Some(text);
        while let Some(text) = rest {
            let start = self.rebuilt.len();
            rest = self.push_cell(text, dialect.separator);
            let cell = self.rebuilt.get_mut(start..).unwrap_or_default();
            if dialect.decimal_commas && decimal::is_number(cell) {
                if cell.contains(&b'.') {
                    pointed.get_or_insert(self.ends.len());
                }
                for byte in cell.iter_mut().filter(|byte| **byte == b',') {
                    *byte = b'.';
                }
            }
            self.ends.push(self.rebuilt.len());
            self.rebuilt.push(dialect.separator);
        }
        Line {
            text: &self.rebuilt,
            ends: &self.ends,
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
    fn decimal_commas_become_points_and_points_are_told() {
        let split = |text| cells(text, b';', true);
        assert_eq!(split("0,5;\"-1,25\";a,b").0, ["0.5", "-1.25", "a,b"]);
        assert_eq!(split("0,5;1").1, None);
        assert_eq!(split("0,5;a.b;1.5;2.5").1, Some(2));
    }
}
