//! A log as a table: named columns, then rows of cells, each with its place in the file.
//!
//! Readers of logs and references see a table only through [`Head`] and [`Table`], so another format than CSV is
//! possible. [`super::header`] decides which columns are needed.

use super::cell::{Cell, shown};
use super::decimal::NumberForm;
use super::error::{LogError, LogProblem, Place};
use super::header::Source;
use super::lines::{Lines, TextLine, lines_of};
use super::preamble::{COMMENT, Preamble};
use super::record::Record;
use super::time::{Clock, is_time};
use super::units;
use super::words;
use crate::statistics::median;
use crate::text::TextReader;
use crate::watch::Watch;
use std::path::PathBuf;

/// Most columns of a table. A table with more is damaged or hostile.
pub(super) const COLUMNS_MAX: usize = 4096;

/// The head of a table, above its rows.
#[derive(Debug)]
pub struct Head {
    /// The file.
    pub path: PathBuf,
    /// The line of the header, from 1.
    pub line: usize,
    /// Names of the columns, without white space around them.
    pub names: Vec<String>,
    /// Units of the columns, where a line above the rows holds them.
    units: Vec<String>,
    /// Whether the cells of the first row hold a time that is no plain number.
    times: Vec<bool>,
    /// Fewest cells of a row.
    cells_min: usize,
    /// Columns with the name of an earlier column, both from 0: their cells are the same.
    pub(super) copies: Vec<(usize, usize)>,
    /// The header and the lines between it and the rows, as they are written, without blank ones.
    lines: Vec<Vec<u8>>,
}

impl Head {
    /// The unit that a line above the rows gives for a column, from 0; empty if it gives none.
    pub fn unit(&self, column: usize) -> &str {
        let unit = self
            .units
            .get(column)
            .map_or("", |unit| units::inside(unit));
        let is_unit = units::is_known(unit) || units::is_count(unit);
        if is_unit { unit } else { "" }
    }

    /// Whether a column, from 0, holds a date and time or a duration with its unit in the first row.
    pub fn is_time(&self, column: usize) -> bool {
        self.times.get(column).is_some_and(|is_time| *is_time)
    }

    /// A cell of the row in this line, for messages.
    pub fn place(&self, line: usize, cell: usize, movement: Option<i64>) -> Box<Place> {
        let name = shown(self.names.get(cell).map_or(&[], |name| name.as_bytes()));
        Box::new(Place {
            path: self.path.clone(),
            line: Some(line),
            column: Some((cell + 1, name)),
            movement,
        })
    }
}

/// Most lines above the header of another table in the same file.
const HEAD_LINES: usize = 100;

/// Whether a line is neither blank nor a comment. `#N/A` is a missing value.
fn is_row(line: &[u8], separator: u8) -> bool {
    (line.first() != Some(&COMMENT) || line.starts_with(b"#N/A"))
        && (!line.iter().all(u8::is_ascii_whitespace) || line.contains(&separator))
}

/// A table, one row in hand at a time.
pub struct Table<'a> {
    /// The head, above the rows.
    pub head: Head,
    pub(super) lines: Lines<'a>,
    /// The row in hand.
    pub(super) row: Record,
    /// Whether the header stands again above the row in hand.
    pub(super) begins_anew: bool,
    /// The line of the last row, if no line break follows it.
    pub(super) open_line: Option<usize>,
}

impl<'a> Table<'a> {
    /// Opens a table, and reads what stands above its rows: see `preamble.rs`.
    ///
    /// Lines end in LF, CRLF or CR, a line that starts with `#` is a comment, blank lines are skipped. Numbers may
    /// have decimal commas where commas do not separate cells. A row may have more cells than names, if they are
    /// empty, and fewer, down to the usual number or the last known name. All this is decided by the first mebibyte
    /// of the text.
    ///
    /// # Errors
    /// Errors of reading, `Empty`, `NoHeader`, `NoSeparator`, `TooManyColumns`, `OtherFormat`, `LineTooLong`.
    pub fn open(text: TextReader<'a>, is_known: impl Fn(&str) -> bool) -> Result<Self, LogError> {
        let path = text.path().to_path_buf();
        let mut lines = Lines::new(text);
        let opening = lines.opening()?;
        let Preamble {
            line,
            above,
            end,
            separator,
            mut names,
            units,
            cells,
        } = Preamble::read(opening, &path, &is_known)?;
        let rows = opening.get(end..).unwrap_or_default();
        let mut row = Record::new(separator, NumberForm::new(rows, separator));
        let written = lines_of(opening).filter(|text| (line..=above).contains(&text.line));
        let written = written.filter(|line| !line.text.trim_ascii().is_empty());
        let written = written.map(|line| line.text.to_vec()).collect();
        let mut times = Vec::new();
        if let Some(first) = lines_of(rows).find(|line| is_row(line.text, separator)) {
            row.split(first.text);
            times = row.cells().map(|cell| is_time(cell.text)).collect();
        }
        // The index of a data frame.
        if let (Some(name), Some(true)) = (names.first_mut(), times.first())
            && name.is_empty()
        {
            "time".clone_into(name);
        }
        let first = |name: &String| names.iter().position(|earlier| earlier == name);
        let named = names.iter().enumerate().filter(|(_, name)| is_known(name));
        let copies = named.filter_map(|(cell, name)| Some((cell, first(name)?)));
        let copies = copies.filter(|(cell, first)| first < cell).collect();
        while lines.line < above && lines.next_line()?.is_some() {}
        let known = names.iter().rposition(|name| is_known(name));
        let head = Head {
            path,
            line,
            cells_min: cells.clamp(known.map_or(0, |last| last + 1), names.len()),
            names,
            units,
            times,
            copies,
            lines: written,
        };
        Ok(Self {
            head,
            lines,
            row,
            begins_anew: false,
            open_line: None,
        })
    }

    /// The same, watched while it is read; `work` is being done with it.
    #[must_use]
    pub fn watched(mut self, watch: Watch<'static>, work: &'static str) -> Self {
        self.lines = self.lines.watched(watch, work);
        self
    }

    /// The median time between the rows that follow in one movement, us, by the next mebibyte of the
    /// text; `None` if that does not show it.
    ///
    /// # Errors
    /// Errors of reading, `LineTooLong`.
    pub fn period_us(
        &mut self,
        time: Source,
        movement: Option<Source>,
    ) -> Result<Option<f64>, LogError> {
        let (mut clock, mut before, mut steps) = (Clock::default(), None, Vec::new());
        let separator = self.row.separator;
        for line in lines_of(self.lines.opening()?).filter(|l| is_row(l.text, separator)) {
            self.row.split(line.text);
            let movement = movement.map(|source| self.row.cell(source.cell).text.to_vec());
            if let Ok(t_us) = clock.t_us(self.row.cell(time.cell), time.scale) {
                if let Some((same, before_us)) = before
                    && same == movement
                    && before_us < t_us
                {
                    steps.push(t_us - before_us);
                }
                before = Some((movement, t_us));
            }
        }
        Ok(median(&mut steps))
    }

    /// Takes the next row in hand; `false` at the end. A header that stands again is passed over.
    ///
    /// # Errors
    /// Errors of reading, `LineTooLong`, `CellCount`, `CutLine`, `OtherTable`, `RepeatedColumn`.
    pub fn next_row(&mut self) -> Result<bool, LogError> {
        let expected = self.head.cells_min;
        self.begins_anew = false;
        loop {
            let Some(line) = self.lines.next_line()? else {
                return Ok(false);
            };
            if self.head.lines.iter().any(|written| written == line) {
                self.begins_anew = true;
            } else if is_row(line, self.row.separator) {
                self.row.split(line);
                break;
            }
        }
        let (found, line) = (self.row.len(), self.lines.line);
        let refuse = |problem| Err(Place::new(&self.head.path, line).refuse(problem));
        if self.lines.is_open() {
            self.open_line = Some(line);
            let last_is_empty = self.row.cell(found.saturating_sub(1)).text.is_empty();
            if found < expected || (found == expected && last_is_empty) {
                let found = found - usize::from(last_is_empty);
                return refuse(LogProblem::CutLine { expected, found });
            }
        }
        let names = self.head.names.len();
        let is_empty = |cell: usize| self.row.cell(cell).text.trim_ascii().is_empty();
        if found < expected || !(names..found).all(is_empty) {
            let problem = match self.other_table()? {
                Some(header) => LogProblem::OtherTable { header },
                None => LogProblem::CellCount {
                    expected: names,
                    found,
                },
            };
            return Err(Place::new(&self.head.path, line).refuse(problem));
        }
        let differs = |(cell, first): &&(usize, usize)| {
            self.row.cell(*cell).text != self.row.cell(*first).text
        };
        match self.head.copies.iter().find(differs) {
            Some((cell, first)) => {
                let problem = LogProblem::RepeatedColumn { first: first + 1 };
                Err(self.head.place(line, *cell, None).refuse(problem))
            }
            None => Ok(true),
        }
    }

    /// The line of the header of another table, if it is the row in hand, or stands soon below it.
    ///
    /// # Errors
    /// Errors of reading, `LineTooLong`.
    pub(super) fn other_table(&mut self) -> Result<Option<usize>, LogError> {
        let cells = self.head.cells_min;
        let line = self.lines.line;
        let names = words::names(&self.row);
        if words::are_names(&names, cells) {
            return Ok(Some(line));
        }
        if words::are_numbers(&names) {
            return Ok(None);
        }
        let (head, lines) = (&self.head, &mut self.lines);
        let is_header = |below: &TextLine<'_>| head.lines.iter().any(|own| own == below.text);
        let mut below = lines_of(lines.opening()?).take(HEAD_LINES);
        Ok(below.find(is_header).map(|header| line + header.line))
    }

    /// A cell of the row in hand, from 0; empty if there is none.
    pub fn cell(&self, cell: usize) -> Cell<'_> {
        self.row.cell(cell)
    }

    /// The line of the row in hand, from 1.
    pub const fn row_line(&self) -> usize {
        self.lines.line
    }
}
