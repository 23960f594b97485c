//! A draft of `stage.toml` for logs as they are: their columns mapped, as far as names and units
//! tell, and everything else as lines to fill in.
//!
//! A line to fill in is a comment until the user writes its value, so a draft that is not finished
//! lacks a key, and is refused.

use super::log::LogError;
use super::log::cell;
use super::log::guess::guess;
use super::log::layout::{Kind, Quantity};
use super::log::table::{Head, Table};
use super::log::time::{self, Clock};
use super::log::units;
use super::shipped::STAGE_TOML;
use super::source;
use super::text::TextReader;
use std::fmt::Write;
use std::path::Path;

/// What stands before a line to fill in.
pub const MARK: &str = "# FILL IN: ";
/// So many rows of the first log tell its period.
const ROWS_MAX: usize = 10_000;
/// Where the comments of the drafted lines begin.
const COMMENT_COLUMN: usize = 60;

/// A draft of `stage.toml`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Draft {
    /// The file.
    pub text: String,
    /// Columns of the logs that it maps.
    pub mapped: usize,
    /// Names of the columns that it leaves out.
    pub ignored: Vec<String>,
    /// How many lines must be filled in.
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
}

/// Drafts a stage file for these logs.
///
/// # Errors
/// Those of opening a log, and of a row with too few or too many cells.
pub fn draft<P: AsRef<Path>>(logs: &[P]) -> Result<Draft, LogError> {
    let mut columns: Vec<LogColumn> = Vec::new();
    let mut period_s = None;
    for path in logs {
        let text = TextReader::open(path.as_ref())?;
        let mut table = Table::open(text, |name| guess(name).is_some())?;
        for cell in 0..table.head.names.len() {
            let column = LogColumn::of(&table.head, cell);
            let is_new = columns.iter().all(|known| known.name != column.name);
            if is_new && !column.name.is_empty() {
                columns.push(column);
            }
        }
        if period_s.is_none() {
            period_s = period(&mut table)?;
        }
    }
    settle(&mut columns);
    let mut lines = Lines::default();
    lines.head(logs);
    lines.stage(period_s, &columns);
    lines.log(&columns);
    Ok(Draft {
        to_fill_in: lines.text.lines().filter(|l| l.starts_with(MARK)).count(),
        mapped: lines.mapped,
        ignored: lines.ignored,
        text: lines.text,
    })
}

impl LogColumn {
    fn of(table: &Head, cell: usize) -> Self {
        let name = table.names.get(cell).cloned().unwrap_or_default();
        let quantity = guess(&name);
        let named = units::split(&name).1.map(str::to_owned);
        let in_name = named.is_some();
        let below = Some(table.unit(cell)).filter(|unit| !unit.is_empty());
        let is_time = quantity == Some(Quantity::Time);
        let unit = match is_time && time::is_date_time(table.first_cell(cell)) {
            true => Some("iso".to_owned()),
            false => named.or(below.map(str::to_owned)),
        };
        Self {
            in_name: in_name && unit.as_deref() != Some("iso"),
            name,
            unit,
            quantity,
        }
    }

    /// Its value in the table `[log]`, and whether its unit is known.
    fn mapping(&self, kind: Kind) -> (String, bool) {
        let name = quoted(&self.name);
        let unit = self.unit.as_deref().unwrap_or_default();
        let is_plain = matches!(kind, Kind::Index | Kind::Code) && units::is_count(unit);
        let known = kind.unit(unit).is_some();
        match (is_plain || (known && self.in_name), known) {
            (true, _) => (name, true),
            (false, true) => (
                format!("{{ column = {name}, unit = {} }}", quoted(unit)),
                true,
            ),
            (false, false) => (format!("{{ column = {name}, unit = \"..\" }}"), false),
        }
    }
}

/// X beside Y1 and Y2 is a beam; beside Y it is that of a pose.
fn settle(columns: &mut [LogColumn]) {
    let has = |quantity| columns.iter().any(|c| c.quantity == Some(quantity));
    let beam = has(Quantity::BeamY1) && !has(Quantity::BeamX) && !has(Quantity::Y);
    for column in columns {
        if beam && column.quantity == Some(Quantity::X) {
            column.quantity = Some(Quantity::BeamX);
        }
    }
}

/// The median time between rows, s; `None` if the log does not tell it.
fn period(table: &mut Table<'_>) -> Result<Option<f64>, LogError> {
    let is_time = |name: &String| guess(name) == Some(Quantity::Time);
    let Some(cell) = table.head.names.iter().position(is_time) else {
        return Ok(None);
    };
    let column = LogColumn::of(&table.head, cell);
    let Some(scale) = column.unit.and_then(|unit| Kind::Time.unit(&unit)) else {
        return Ok(None);
    };
    let mut clock = Clock::default();
    let mut times: Vec<f64> = Vec::new();
    while times.len() < ROWS_MAX && table.next_row()? {
        times.extend(clock.t_us(table.cell(cell), scale));
    }
    let steps = times.windows(2).filter_map(|pair| match pair {
        [before, after] if after > before => Some(after - before),
        _ => None,
    });
    let mut steps: Vec<f64> = steps.collect();
    if steps.is_empty() {
        return Ok(None);
    }
    let middle = steps.len() / 2;
    let (_, median_us, _) = steps.select_nth_unstable_by(middle, f64::total_cmp);
    Ok(Some(median_us.round() / 1e6))
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
             # words off. As long as one of a key that is needed is left, the file is refused.\n\n",
            names.join(", "),
            MARK.trim_end(),
        );
    }

    /// The tables but `[log]`, as the stage file that ships with the program has them.
    fn stage(&mut self, period_s: Option<f64>, columns: &[LogColumn]) {
        let mut lines = STAGE_TOML.lines().skip_while(|line| !line.starts_with('['));
        let mut table = "";
        for line in &mut lines {
            let found = line
                .split(']')
                .next()
                .and_then(|line| line.strip_prefix('['));
            table = found.unwrap_or(table);
            match (period_s, line.starts_with("period_s")) {
                (Some(period_s), true) => {
                    let key = format!("period_s = {period_s}");
                    self.line(
                        &key,
                        "of the log; correct it if the log holds not every sample",
                    );
                }
                _ if line.is_empty() || line.starts_with('[') => {
                    let _ = writeln!(self.text, "{line}");
                }
                _ => {
                    let _ = writeln!(self.text, "{MARK}{line}");
                }
            }
            let is_voltage = |column: &LogColumn| {
                let quantity = column.quantity.filter(|q| q.table() == table);
                let unit = column.unit.as_deref().unwrap_or_default();
                quantity.is_some_and(|q| q.kind().unit(unit).is_some())
            };
            if line.starts_with("m_per_count") && columns.iter().any(is_voltage) {
                let key = format!("{MARK}volts_per_count = 3.125e-4");
                self.line(&key, "V per code: the log holds voltages, the stage codes");
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
            let (key, kind) = (quantity.key(), quantity.kind());
            match named.as_slice() {
                [] if quantity == Quantity::Movement => {
                    let _ = writeln!(
                        self.text,
                        "# no column for the movement: one begins after a gap in time"
                    );
                }
                [] => {
                    // Of two sets that hold the same, the one that is not there is not missed.
                    let missed = match quantity {
                        _ if Quantity::PLANAR.contains(&quantity) => {
                            has(&Quantity::PLANAR) && !has(&Quantity::BEAMS)
                        }
                        _ if Quantity::BEAMS.contains(&quantity) => {
                            !has(&Quantity::PLANAR) || has(&Quantity::BEAMS)
                        }
                        _ if Quantity::VERTICAL.contains(&quantity) => {
                            has(&Quantity::VERTICAL) && !has(&Quantity::GAPS)
                        }
                        _ if Quantity::GAPS.contains(&quantity) => {
                            !has(&Quantity::VERTICAL) || has(&Quantity::GAPS)
                        }
                        _ => true,
                    };
                    if missed {
                        self.line(
                            &format!("{MARK}{key} = \"..\""),
                            "not found: name its column",
                        );
                    }
                }
                [one] => match one.mapping(kind) {
                    (value, true) => {
                        self.line(&format!("{key} = {value}"), what(quantity));
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

/// What a quantity is, in words.
const fn what(quantity: Quantity) -> &'static str {
    match quantity {
        Quantity::Movement => "number of the movement",
        Quantity::Time => "time of the sample",
        Quantity::BeamX => "interferometer along X",
        Quantity::BeamY1 => "interferometer along Y at x = +baseline/2",
        Quantity::BeamY2 => "interferometer along Y at x = -baseline/2",
        Quantity::X | Quantity::Y | Quantity::Rz => "reference pose",
        Quantity::Gap1 | Quantity::Gap2 | Quantity::Gap3 => {
            "capacitive sensor, in the order of probes_m"
        }
        Quantity::Z | Quantity::Rx | Quantity::Ry => "pose by the capacitive sensors",
        Quantity::HallA => "Hall probe A (h1), senses Y",
        Quantity::HallB => "Hall probe B (h2), senses Y",
        Quantity::HallC => "Hall probe C (h3), senses X",
    }
}

/// A text in quotes, as TOML has it; what JSON escapes is escaped in the same way.
fn quoted(text: &str) -> String {
    serde_json::Value::from(text).to_string()
}

#[cfg(test)]
mod tests;
