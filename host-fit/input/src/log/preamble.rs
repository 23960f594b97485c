//! What stands above the rows of a table: notes, the header, facts and units of the columns.
//!
//! The rows are the longest run of lines with mostly numbers. Their cells say what separates cells, and how many
//! there are. The header is the last line of distinct names above the rows.

use super::cell::shown;
use super::decimal::NumberForm;
use super::error::{LogError, LogProblem, Place};
use super::lines::{TextLine, lines_of};
use super::record::{Record, WHITE_SPACE};
use super::table::COLUMNS_MAX;
use super::units;
use super::words::{are_names, are_numbers, columns, is_word, names};
use crate::other_format;
use crate::source::SourceProblem;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// Starts a comment, as the first byte of a line.
pub(super) const COMMENT: u8 = b'#';

/// What may separate cells; the first of them where two do as well. White space does where none of them does.
const SEPARATORS: [u8; 4] = [b'\t', b';', b',', b'|'];

/// Number of lines that decide the form of a table, without comments and blank lines: those about its header.
const LINES_MAX: usize = 1000;

/// Fewest different known names of columns that make a header by themselves.
const KNOWN_MIN: usize = 3;

/// Longest unit in a row of units, in characters, with brackets.
const UNIT_CHARACTERS: usize = 16;

/// What stands above the rows of a table.
pub(super) struct Preamble {
    /// The line of the header, from 1.
    pub(super) line: usize,
    /// The line above the first row.
    pub(super) above: usize,
    /// The first byte of the first row.
    pub(super) end: usize,
    /// What separates the cells.
    pub(super) separator: u8,
    /// Names of the columns, without white space around them.
    pub(super) names: Vec<String>,
    /// Units of the columns, where a line has them.
    pub(super) units: Vec<String>,
    /// The usual number of cells of the rows.
    pub(super) cells: usize,
}

/// A line of a text, taken apart; a comment without its mark.
#[derive(Clone)]
struct Line {
    line: usize,
    /// The first byte after it.
    end: usize,
    /// Its cells, without white space around them.
    names: Vec<String>,
}

impl Preamble {
    /// Of a table that begins with these bytes.
    ///
    /// The header is the first line with at least three known names; without one, the line of known names in the
    /// last comment above the rows, as NumPy writes it; without one, the last line of distinct names above the
    /// rows; without rows, the first line.
    ///
    /// # Errors
    /// `Empty`, `NoHeader`, `NoSeparator`, `TooManyColumns`, and `OtherFormat` of a source.
    pub(super) fn read(
        bytes: &[u8],
        path: &Path,
        is_known: impl Fn(&str) -> bool,
    ) -> Result<Self, LogError> {
        let written = lines_of(bytes).filter(|line| !line.text.trim_ascii().is_empty());
        let (notes, plain): (Vec<_>, Vec<_>) =
            written.partition(|line| line.text.first() == Some(&COMMENT));
        let separator = separator(plain.get(..LINES_MAX).unwrap_or(&plain));
        let mut record = Record::new(separator, NumberForm::default());
        let mut apart = |line: &TextLine<'_>| Line::new(line, &mut record);
        let is_header = |line: &Line| {
            let words = line.names.iter().filter(|name| is_word(name));
            let known: BTreeSet<&String> = words.filter(|name| is_known(name)).collect();
            known.len() >= KNOWN_MIN
        };
        let by_name = plain.iter().position(|line| is_header(&apart(line)));
        let above = by_name.map_or(0, |header| header.saturating_sub(LINES_MAX / 2));
        let about = plain.get(above..).unwrap_or_default();
        let about = about.get(..LINES_MAX).unwrap_or(about);
        let lines: Vec<Line> = about.iter().map(&mut apart).collect();
        let notes = notes.iter().map(apart);
        let by_name = by_name.map(|header| header - above);
        // A table of numbers above the header may be longer.
        let below = by_name.map_or(0, |header| header + 1);
        let (first, cells) = rows(lines.get(below..).unwrap_or_default());
        let first = below + first;
        let first_row = lines.get(first);
        let is_above = |line: &Line| first_row.is_none_or(|row| line.line < row.line);
        let by_name = by_name.and_then(|header| lines.get(header)).cloned();
        let in_note = || {
            notes
                .filter(|note| is_above(note) && is_header(note))
                .last()
        };
        let format = plain
            .first()
            .and_then(|line| other_format::in_text(line.text));
        let by_place = || match first_row {
            None => lines.first().filter(|_| format.is_none()),
            Some(_) => lines.iter().take(first).rfind(|line| line.has_names(cells)),
        };
        let header = by_name.or_else(in_note).or_else(|| by_place().cloned());
        let in_columns = |mut header: Line| {
            let is_other = header.names.len() != cells && first_row.is_some();
            if separator == WHITE_SPACE
                && is_other
                && let Some(line) = plain.iter().find(|line| line.line == header.line)
            {
                header.names = columns(line.text, " ");
                let is_found = header.names.len() == cells;
                header.names.truncate(if is_found { cells } else { 1 });
            }
            header
        };
        let header = header.map(in_columns);
        let header = header.ok_or(LogProblem::NoHeader).and_then(Line::checked);
        let header = header.map_err(|problem| {
            let first = plain.first();
            let problem = match format {
                _ if first.is_none() => LogProblem::Empty,
                Some(looks_like) => SourceProblem::OtherFormat { looks_like }.into(),
                None => problem,
            };
            Place::new(path, first.map(|line| line.line)).refuse(problem)
        })?;
        // Facts and units of the columns stand between the header and the rows. A fact begins with a word.
        let begins_with_word = |line: &Line| line.names.first().is_some_and(is_word);
        let has_facts = !first_row.is_some_and(begins_with_word);
        let is_fact = |line: &Line| {
            line.is_units() || (has_facts && is_above(line) && begins_with_word(line))
        };
        let row = lines
            .iter()
            .position(|line| line.line > header.line && !is_fact(line));
        let passed = lines.get(..row.unwrap_or(lines.len())).unwrap_or_default();
        let is_wide = |line: &&Line| line.names.len() + 1 >= cells;
        let units = passed.iter().filter(is_wide).rfind(|line| line.is_units());
        let last = passed
            .last()
            .filter(|last| last.line > header.line)
            .unwrap_or(&header);
        Ok(Self {
            line: header.line,
            above: last.line,
            end: last.end,
            separator,
            units: units.map_or_else(Vec::new, |line| line.names.clone()),
            cells: first_row.map_or(header.names.len(), |_| cells),
            names: header.names,
        })
    }
}

impl Line {
    fn new(line: &TextLine<'_>, record: &mut Record) -> Self {
        let text = line.text.strip_prefix(&[COMMENT]).unwrap_or(line.text);
        record.split(text);
        let mut names = names(record);
        if record.separator == WHITE_SPACE && !are_numbers(&names) {
            // Two spaces or more may stand between names with spaces.
            let wide = columns(text, "  ");
            names = if wide.len() < KNOWN_MIN { names } else { wide };
        }
        Self {
            line: line.line,
            end: line.end,
            names,
        }
    }

    /// The same, as a header.
    fn checked(self) -> Result<Self, LogProblem> {
        match self.names.as_slice() {
            [one] => Err(LogProblem::NoSeparator {
                text: shown(one.as_bytes()),
            }),
            names if names.len() > COLUMNS_MAX => {
                Err(LogProblem::TooManyColumns { limit: COLUMNS_MAX })
            }
            _ => Ok(self),
        }
    }

    /// Whether it may be a header of rows with this usual number of cells.
    fn has_names(&self, cells: usize) -> bool {
        are_names(&self.names, cells) && !self.is_units()
    }

    /// Whether it holds the units of columns: no number, at least two units, and nothing as long as a remark.
    fn is_units(&self) -> bool {
        let is_short = |cell: &String| cell.chars().count() <= UNIT_CHARACTERS;
        let known = |cell: &&String| units::is_known(units::inside(cell));
        self.names
            .iter()
            .all(|cell| is_short(cell) && cell.parse::<f64>().is_err())
            && self.names.iter().filter(known).count() >= 2
    }
}

/// What separates the cells: most lines agree on their number.
fn separator(lines: &[TextLine<'_>]) -> u8 {
    // The number of lines that agree, and of separators in each.
    let agree = |separator: &u8| {
        let mut lines_of: BTreeMap<usize, usize> = BTreeMap::new();
        for line in lines {
            let text = line.text.trim_ascii_start();
            let runs = text.chunk_by(|a, b| a == b && *a == WHITE_SPACE);
            let count = runs.filter(|run| run[0] == *separator).count();
            *lines_of.entry(count).or_default() += usize::from(count > 0);
        }
        let most = lines_of.into_iter().map(|(count, lines)| (lines, count));
        most.max().unwrap_or_default()
    };
    let best = |one: u8, other: u8| {
        if agree(&other) > agree(&one) {
            other
        } else {
            one
        }
    };
    let found = SEPARATORS.into_iter().reduce(best).unwrap_or(b',');
    let (agreed, _) = agree(&found);
    if 2 * agreed < lines.len() && agree(&WHITE_SPACE).0 > agreed {
        WHITE_SPACE
    } else {
        found
    }
}

/// The first of the rows, which are the longest run of rows (the last of equal ones), and their usual number of
/// cells; the number of lines and 0 without a row.
fn rows(lines: &[Line]) -> (usize, usize) {
    let mut run = lines.len()..lines.len();
    let mut at = 0;
    let is_row = |line: &Line| are_numbers(&line.names);
    for same in lines.chunk_by(|one, other| is_row(one) == is_row(other)) {
        if is_row(&same[0]) && same.len() >= run.len() {
            run = at..at + same.len();
        }
        at += same.len();
    }
    let mut rows_of: BTreeMap<usize, usize> = BTreeMap::new();
    for line in &lines[run.clone()] {
        *rows_of.entry(line.names.len()).or_default() += 1;
    }
    let usual = rows_of.into_iter().max_by_key(|(_, rows)| *rows);
    (run.start, usual.map_or(0, |(cells, _)| cells))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[track_caller]
    fn read(text: &str) -> Preamble {
        let is_known = |name: &str| ["a", "b", "c", "d"].contains(&name);
        Preamble::read(text.as_bytes(), Path::new("log"), is_known).expect("a header")
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
            let found = read(text);
            assert_eq!((found.line, &found.names), (line, &names), "{text:?}");
        }
        let numbers: String = (0..1500).map(|k| format!("{k},0.5\n")).collect();
        let below = read(&format!("p,q\n{numbers}a,b,c\n1,2,3\n4,5,6\n"));
        assert_eq!((below.line, below.cells), (1502, 3));
        for text in ["a b c\n1 2 3\n4  5  6\n", "a|b|c\n1|2|3\n"] {
            assert_eq!(read(text).names, names, "{text}");
        }
        for text in [
            "T (s)  a 1   b\n1 2 3\n4 5 6\n",
            "T   a b   c\n1 2 3 4\n4 5 6 7\n",
        ] {
            let found = read(text).names;
            assert_eq!(
                found.len(),
                text.lines().last().map_or(0, |row| row.len() / 2 + 1)
            );
        }
        // Without known names: the last line of distinct names above the rows, or the first line that is no comment.
        for (text, line) in [
            ("note\nrate;500\nx;y;z\num;um;V\n1;2,5;3", 3),
            ("note\n\n# note\nx,y,z\n2026-01-02T03:04:05,2,3", 4),
            ("# note\n\nx,y\n1,2", 3),
            ("x,y,z\nleft,right,left\n1,2,3", 1),
            ("t,x,t,y\n1,2,1,3\n4,5,4,6", 1),
            ("operator,lab\nx,y,z\n1,2,3\n4,5,6", 2),
            ("# note\nx,y", 2),
        ] {
            assert_eq!(read(text).line, line, "{text:?}");
        }
        let problem = |text: &str| {
            let read = Preamble::read(text.as_bytes(), Path::new("log"), |_| true);
            read.map(|_| ()).expect_err(text).problem
        };
        assert!(matches!(problem("1,2\n3,4"), LogProblem::NoHeader));
        let narrow = problem("a (s) b 1 c\n1 2 3\n4 5 6\n");
        assert!(matches!(narrow, LogProblem::NoSeparator { .. }), "{narrow}");
        assert!(matches!(problem("\n# a\n"), LogProblem::Empty));
        let json = problem("{\"a\": 1, \"b\": 2}\n{\"a\": 1, \"b\": 2}\n");
        assert!(matches!(json, LogProblem::Source(_)), "{json}");
    }

    #[test]
    fn facts_between_header_and_rows_are_passed_over_and_units_found_among_them() {
        let scope = "Name\tp\tq\nType\tREAL\tREAL\nSampleTime[ms]\t2\t2\nUnit\tnm (Length)\tV (Voltage)\n\n0\t1\t2\n2\t1\t2\n";
        let found = read(scope);
        assert_eq!((found.line, found.above), (1, 4));
        assert_eq!(found.units[1], "nm (Length)");
        assert!(scope[found.end..].trim_start().starts_with("0\t1"));
        // Units above the header, rows of facts with numbers, a column without cells.
        let labview = "Samples\t9\t9\nUnit\tnm\tV\nX0\t0\t0\nX_Value\tp\tq\tComment\n0\t1\t2\n1\t1\t2\n2\t2\t3\n";
        let found = read(labview);
        assert_eq!((found.line, found.above, found.cells), (4, 4, 3));
        assert_eq!(found.units, ["Unit", "nm", "V"]);
    }

    #[test]
    fn a_bad_row_is_a_row_wherever_it_stands() {
        for bad in ["1,x,x", "1,,", ",,"] {
            let text = format!("a,b,c\n{bad}\n1,2,3\n4,5,6");
            assert_eq!(read(&text).above, 1, "{bad}");
        }
        // Also below rows that begin with a word.
        let rows = "ok,1,2,3\nok,4,5,6\nok,,,\nok,1,2,3\nok,1,2,3\nok,1,2,3\n";
        assert_eq!(read(&format!("state,a,b,c\n{rows}")).above, 1);
    }

    #[test]
    fn decimal_commas_do_not_separate_cells() {
        assert_eq!(read("a,b,c;d\n1,2,3;4\n1,2,3;4").separator, b',');
        for text in ["x;y;z\n0,5;1,5;2,5\n1,5;2,5;3,5", "x;y\n0;1,5\n1;2,5"] {
            assert_eq!(read(text).separator, b';', "{text:?}");
        }
    }
}
