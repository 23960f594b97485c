//! A draft of `stage.toml` for given logs. It maps columns with clear names and units; everything else is a
//! line to fill in.
//!
//! A line to fill in is a comment until the user writes its value, so an unfinished draft lacks a key and is
//! refused.

use super::log::LogError;
use super::log::cell;
use super::log::layout::{Dimension, Quantity};
use super::log::table::Table;
use super::log::time::Clock;
use super::log::units;
use super::shipped::STAGE_TOML;
use super::source;
use super::text::TextReader;
use crate::statistics::median;
use std::fmt::Write;
use std::path::Path;

/// The start of a line to fill in.
pub const MARK: &str = "# FILL IN: ";
/// Number of rows that are read for the period and the codes of a log.
const ROWS_MAX: usize = 10_000;
/// Periods that a servo may have, s. Another one shows that the unit of the time is wrong.
const PERIODS_S: std::ops::RangeInclusive<f64> = 1e-4..=0.1;
/// Where the comments of the drafted lines begin.
const COMMENT_COLUMN: usize = 60;
/// Codes of a converter of 16 bits and of 24 bits. Larger codes in the log mean 24 bits.
const CODES: [[i32; 2]; 2] = [[-32_768, 32_767], [-8_388_608, 8_388_607]];
/// Units for a time without a unit, each with the smallest step between rows that suits it: the period is then
/// 0.1 ms to 100 ms.
const STEPS: [(&str, f64); 4] = [("ns", 1e5), ("us", 100.0), ("ms", 0.1), ("s", 1e-4)];
/// A draft of `stage.toml`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Draft {
    /// The file.
    pub text: String,
    /// Number of columns that it maps.
    pub mapped: usize,
    /// Names of the columns that it leaves out.
    pub ignored: Vec<String>,
    /// Number of lines to fill in.
    pub to_fill_in: usize,
}

/// A column of the logs.
struct LogColumn {
    name: String,
    /// The unit of its name, or of the row below; `iso` for dates and times.
    unit: Option<String>,
    /// Whether the unit stands in its name.
    in_name: bool,
    quantity: Option<Quantity>,
    /// Its first numbers, or dates and times in us.
    numbers: Vec<f64>,
}

/// Drafts a stage file for these logs.
///
/// # Errors
/// Errors of opening a log, and `CellCount`.
pub fn draft<P: AsRef<Path>>(logs: &[P]) -> Result<Draft, LogError> {
    let mut columns: Vec<LogColumn> = Vec::new();
    for path in logs {
        let text = TextReader::open(path.as_ref())?;
        let guessed = |name: &str| Quantity::guess(name, None).is_some();
        for column in LogColumn::all(Table::open(text, guessed)?)? {
            let is_new = columns.iter().all(|known| known.name != column.name);
            if is_new && !column.name.is_empty() {
                columns.push(column);
            }
        }
    }
    decide_by_neighbours(&mut columns);
    let mut lines = Lines::default();
    lines.head(logs);
    lines.stage(&columns);
    lines.log(&columns);
    Ok(Draft {
        to_fill_in: lines.text.lines().filter(|l| l.starts_with(MARK)).count(),
        mapped: lines.mapped,
        ignored: lines.ignored,
        text: lines.text,
    })
}

impl LogColumn {
    /// The columns of a log, in its order.
    fn all(mut table: Table<'_>) -> Result<Vec<Self>, LogError> {
        let head = &table.head;
        let named = head.names.iter().enumerate();
        let column = named.map(|(cell, name)| {
            let in_name = units::split(name).1;
            let below = Some(head.unit(cell)).filter(|unit| !unit.is_empty());
            let is_time = head.is_time(cell);
            let unit = in_name.or(below).filter(|_| !is_time);
            Self {
                name: name.clone(),
                in_name: in_name.is_some() && !is_time,
                quantity: Quantity::guess(name, unit),
                unit: unit.or(is_time.then_some("iso")).map(str::to_owned),
                numbers: Vec::new(),
            }
        });
        let mut columns: Vec<Self> = column.collect();
        let mut clocks = vec![Clock::default(); columns.len()];
        let mut rows = 0;
        while rows < ROWS_MAX && table.next_row()? {
            rows += 1;
            for (cell, (column, clock)) in columns.iter_mut().zip(&mut clocks).enumerate() {
                column.numbers.extend(clock.t_us(table.cell(cell), 1.0));
            }
        }
        Ok(columns)
    }

    /// Its value in the table `[log]`, and whether its unit is known.
    fn mapping(&self, kind: Dimension) -> (String, bool) {
        let name = quoted(&self.name);
        let unit = self.unit.as_deref().unwrap_or_default();
        let is_plain = matches!(kind, Dimension::Index | Dimension::Code) && units::is_count(unit);
        let known = kind.unit(unit).is_some() || (kind == Dimension::Time && units::is_rows(unit));
        match (is_plain || (known && self.in_name), known) {
            (true, _) => (name, true),
            (false, true) => (
                format!("{{ column = {name}, unit = {} }}", quoted(unit)),
                true,
            ),
            (false, false) => (format!("{{ column = {name}, unit = \"..\" }}"), false),
        }
    }

    /// Its unit in m, rad, us or V, if it is a unit of this kind.
    fn scale(&self, kind: Dimension) -> Option<f64> {
        self.unit.as_deref().and_then(|unit| kind.unit(unit))
    }

    /// The median step between its rows, if it grows from row to row, as times do.
    fn step(&self) -> Option<f64> {
        let steps = self.numbers.windows(2).map(|pair| pair[1] - pair[0]);
        let mut forwards: Vec<f64> = steps.filter(|step| *step > 0.0).collect();
        let grows = 10 * forwards.len() + 9 >= 9 * self.numbers.len();
        median(&mut forwards).filter(|_| grows)
    }
}

/// Decides by the other columns: X beside Y1 and Y2 is a beam, X beside Y belongs to a pose. Without a column that
/// is called a time, the time is a column that grows.
fn decide_by_neighbours(columns: &mut [LogColumn]) {
    let has = |quantity| columns.iter().any(|c| c.quantity == Some(quantity));
    let beam = has(Quantity::BeamY1) && !has(Quantity::BeamX) && !has(Quantity::Y);
    let has_time = has(Quantity::Time);
    for column in &mut *columns {
        if beam && column.quantity == Some(Quantity::X) {
            column.quantity = Some(Quantity::BeamX);
        }
        if column.quantity == Some(Quantity::Time)
            && column.unit.is_none()
            && let Some(step) = column.step()
        {
            let unit = STEPS.iter().find(|(_, least)| step >= *least);
            column.unit = unit.map(|(unit, _)| (*unit).to_owned());
        }
    }
    if has_time {
        return;
    }
    let grows = |column: &LogColumn| column.step().filter(|_| column.quantity.is_none());
    let is_time = |c: &LogColumn| grows(c).is_some() && c.scale(Dimension::Time).is_some();
    let is_counter = |c: &LogColumn| grows(c) == Some(1.0) && c.unit.is_none();
    // Its unit is to be filled in.
    let is_bare = |c: &LogColumn| grows(c).is_some() && c.unit.is_none();
    let time = columns.iter().position(is_time);
    let counter = columns.iter().position(is_counter);
    let bare = || columns.iter().position(is_bare);
    if let Some(column) = time
        .or(counter)
        .or_else(bare)
        .and_then(|at| columns.get_mut(at))
    {
        column.quantity = Some(Quantity::Time);
        if time.is_none() && counter.is_some() {
            column.unit = Some("rows".to_owned());
        }
    }
}

/// The text of a draft as it grows.
#[derive(Default)]
struct Lines {
    text: String,
    mapped: usize,
    ignored: Vec<String>,
}

impl Lines {
    fn head<P: AsRef<Path>>(&mut self, logs: &[P]) {
        let names: Vec<String> = logs
            .iter()
            .map(|path| source::shown_name(path.as_ref()).display().to_string())
            .map(|name| cell::shown(name.as_bytes()))
            .collect();
        let _ = write!(
            self.text,
            "# The stage as designed, for {}. SI units: m, rad, s; counts are codes of the converters.\n\
             # Lines that begin with \"{}\" hold an example: write the value of your stage and take these\n\
             # words off. As long as one is left, the file is refused.\n\n",
            names.join(", "),
            MARK.trim_end(),
        );
    }

    /// All tables but `[log]` and `[search]`, copied from the stage file that ships with the program.
    fn stage(&mut self, columns: &[LogColumn]) {
        let period_s = columns.iter().find_map(|column| {
            column.quantity.filter(|q| *q == Quantity::Time)?;
            let period_us = column.step()? * column.scale(Dimension::Time)?;
            let period_s = period_us.round() / 1e6;
            PERIODS_S.contains(&period_s).then_some(period_s)
        });
        let lines = STAGE_TOML.lines().skip_while(|line| !line.starts_with('['));
        // Search ranges have defaults.
        let lines = lines.take_while(|line| !line.starts_with("[search]"));
        let mut table = "";
        for line in lines {
            let found = line
                .split(']')
                .next()
                .and_then(|line| line.strip_prefix('['));
            table = found.unwrap_or(table);
            let of_table = |column: &&LogColumn| {
                let quantity = column.quantity;
                quantity.is_some_and(|quantity| quantity.table() == table)
            };
            let mut held = columns.iter().filter(of_table);
            let key = line.split(' ').next().unwrap_or_default();
            match key {
                "period_s" if let Some(period_s) = period_s => self.line(
                    &format!("period_s = {period_s}"),
                    "of the log; correct it if the log holds not every sample",
                ),
                "code_min" | "code_max" => {
                    let numbers = held.flat_map(|column| &column.numbers);
                    let largest = numbers.fold(0.0f64, |most, number| most.max(number.abs()));
                    let codes = CODES[usize::from(largest > f64::from(i16::MAX) + 1.0)];
                    let code = codes[usize::from(key == "code_max")];
                    self.line(
                        &format!("{key} = {code}"),
                        "correct it for another converter",
                    );
                }
                _ if line.is_empty()
                    || line.starts_with(['[', '#'])
                    || matches!(table, "motion" | "uncertainty") =>
                {
                    let _ = writeln!(self.text, "{line}");
                }
                _ => {
                    let _ = writeln!(self.text, "{MARK}{line}");
                    if key == "m_per_count" && held.any(|c| c.scale(Dimension::Code).is_some()) {
                        let key = format!("{MARK}volts_per_count = 3.125e-4");
                        self.line(&key, "V per code: the log holds voltages, the stage codes");
                    }
                }
            }
        }
    }

    fn log(&mut self, columns: &[LogColumn]) {
        self.text.push_str("\n[log]");
        self.text.push_str(
            "  # which column holds what; a unit that the name has need not be repeated\n",
        );
        let has = |set: &[Quantity]| {
            let held = |column: &LogColumn| column.quantity.is_some_and(|q| set.contains(&q));
            columns.iter().any(held)
        };
        for quantity in Quantity::ALL {
            let named: Vec<&LogColumn> = columns
                .iter()
                .filter(|column| column.quantity == Some(quantity))
                .collect();
            let (key, kind) = (quantity.key(), quantity.dimension());
            match named.as_slice() {
                [] if quantity == Quantity::Movement => {
                    let _ = writeln!(
                        self.text,
                        "# no column for the movement: one begins after a gap in time"
                    );
                }
                [] if Quantity::COMMANDED.contains(&quantity) => {}
                [] => {
                    // Only one of alternative sets is needed.
                    let alternatives: [&[_]; 2] = [&Quantity::REFERENCES, &Quantity::VERTICALS];
                    let mut sets = alternatives
                        .into_iter()
                        .filter(|sets| sets.iter().flatten().any(|q| *q == quantity));
                    let missed = sets.all(|sets| {
                        let there = sets.iter().find(|set| has(*set));
                        there.unwrap_or(&sets[0]).contains(&quantity)
                    });
                    if missed {
                        self.line(
                            &format!("{MARK}{key} = \"..\""),
                            "not found: name its column",
                        );
                    }
                }
                [one] => match one.mapping(kind) {
                    (value, true) => {
                        self.line(&format!("{key} = {value}"), quantity.meaning());
                        self.mapped += 1;
                    }
                    (value, false) => {
                        let units = format!("its unit: {}", kind.units());
                        self.line(&format!("{MARK}{key} = {value}"), &units);
                    }
                },
                several => {
                    let names: Vec<String> = several.iter().map(|c| quoted(&c.name)).collect();
                    let comment = "several may be meant: name one, put the others into `ignore`";
                    self.line(&format!("{MARK}{key} = {}", names.join(" or ")), comment);
                }
            }
        }
        let unknown = columns.iter().filter(|column| column.quantity.is_none());
        self.ignored = unknown.map(|column| column.name.clone()).collect();
        if !self.ignored.is_empty() {
            let names: Vec<String> = self.ignored.iter().map(|name| quoted(name)).collect();
            let line = format!("ignore = [{}]", names.join(", "));
            self.line(&line, "left out; take off what a key above names");
        }
    }

    fn line(&mut self, line: &str, comment: &str) {
        let _ = writeln!(self.text, "{line:<COMMENT_COLUMN$} # {comment}");
    }
}

/// A text in quotes for TOML, which escapes like JSON.
fn quoted(text: &str) -> String {
    serde_json::Value::from(text).to_string()
}

#[cfg(test)]
mod tests;
