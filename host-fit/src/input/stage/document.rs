//! The parsed text of a stage file: gives its tables to derived types, and says of whatever
//! is wrong where it stands and which key it is.

use super::error::{Place, StageError};
use crate::input::draft::MARK;
use crate::input::shipped::STAGE_TOML;
use serde::de::DeserializeOwned;
use std::ops::Range;
use std::path::Path;
use toml::Spanned;
use toml::de::{DeTable, DeValue, Error, ValueDeserializer};

/// What to do about an unknown key.
const MISSPELT: &str = "remove it or correct its spelling";

/// A parsed stage file.
pub(super) struct Document<'t> {
    path: &'t Path,
    text: &'t str,
    top: Spanned<DeValue<'t>>,
}

/// A list as it stands in the file.
pub(super) type List<T> = Spanned<Vec<T>>;

impl<'t> Document<'t> {
    pub(super) fn parse(text: &'t str, path: &'t Path) -> Result<Self, StageError> {
        let top = DeTable::parse(text).map_err(|error| StageError::Syntax {
            place: place(path, text, error.span().map_or(0, |span| span.start)),
            message: error.message().to_owned(),
        })?;
        let top = Spanned::new(top.span(), DeValue::Table(top.into_inner()));
        Ok(Self { path, text, top })
    }

    /// The whole file.
    pub(super) fn read_all<T: DeserializeOwned>(&self) -> Result<T, StageError> {
        // serde would take a list for a struct, by the order of its fields.
        if let DeValue::Table(entries) = self.top.get_ref() {
            let lists = entries.values().filter(|entry| entry.get_ref().is_array());
            if let Some(list) = lists.min_by_key(|entry| entry.span().start) {
                return Err(self.wrong_kind(list.span(), "invalid type: a list, expected a table"));
            }
        }
        self.deserialize(&self.top)
    }

    /// The value of the key `name` in a table of the file, if it is there.
    pub(super) fn read<T: DeserializeOwned>(
        &self,
        table: &str,
        name: &str,
    ) -> Result<Option<T>, StageError> {
        let value = self.value(table, name);
        value.map(|value| self.deserialize(value)).transpose()
    }

    /// The value of the key `name` in a table of the file.
    pub(super) fn require<T: DeserializeOwned>(
        &self,
        table: &str,
        name: &str,
    ) -> Result<T, StageError> {
        let value = self.read(table, name)?;
        value.ok_or_else(|| self.missing(self.span(table), &format!("{table}.{name}")))
    }

    /// Whether the key `name` of a table holds a text.
    pub(super) fn is_text(&self, table: &str, name: &str) -> bool {
        self.value(table, name)
            .is_some_and(|value| value.get_ref().is_str())
    }

    /// Refuses keys of a table other than `known`.
    pub(super) fn only(&self, table: &str, known: &[&str]) -> Result<(), StageError> {
        let entries = self.top.get_ref().get(table);
        let entries = entries.and_then(|table| table.get_ref().as_table());
        let names = entries.into_iter().flat_map(DeTable::keys);
        let unknown = names
            .filter(|name| !known.contains(&name.get_ref().as_ref()))
            .min_by_key(|name| name.span().start);
        unknown.map_or(Ok(()), |name| {
            let known = known.join(", ");
            let problem = format!("unknown key, expected one of {known}; {MISSPELT}");
            Err(self.refuse(name.span(), problem))
        })
    }

    /// The items of a list, if they are N: serde's own arrays take longer lists from TOML
    /// without a word.
    pub(super) fn exactly<'l, T, const N: usize>(
        &self,
        list: &'l List<T>,
    ) -> Result<&'l [T; N], StageError> {
        let items = list.get_ref().as_slice();
        let problem = || format!("a list of {}, expected a list of {N}", items.len());
        let items = items.try_into();
        items.map_err(|_| self.wrong_kind(list.span(), &problem()))
    }

    /// A number, if it lies within `low` to `high`; infinities and NaN never do.
    pub(super) fn within(
        &self,
        number: &Spanned<f64>,
        low: f64,
        high: f64,
        unit: &str,
    ) -> Result<f64, StageError> {
        let (span, value) = (number.span(), *number.get_ref());
        let written = self.text.get(span.clone()).unwrap_or_default();
        if ["0x", "0o", "0b"]
            .iter()
            .any(|base| written.starts_with(base))
        {
            let problem = format!("{written} is not a decimal number; write it in decimal digits");
            return Err(self.refuse(span, problem));
        }
        if (low..=high).contains(&value) {
            return Ok(value);
        }
        let range = format!("{low:e} to {high:e} {unit}");
        let problem =
            format!("{value} {unit} is outside {range}; check the value and its unit (SI)");
        Err(self.refuse(span, problem))
    }

    /// An error at the value or the name that stands at `span`; `problem` says what to do.
    pub(super) fn refuse(&self, span: Range<usize>, problem: impl Into<String>) -> StageError {
        self.error(span.start, self.key(&span), problem.into())
    }

    fn value(&self, table: &str, name: &str) -> Option<&Spanned<DeValue<'t>>> {
        self.top.get_ref().get(table)?.get_ref().get(name)
    }

    fn deserialize<T: DeserializeOwned>(
        &self,
        value: &Spanned<DeValue<'t>>,
    ) -> Result<T, StageError> {
        T::deserialize(ValueDeserializer::from(value.clone()))
            .map_err(|error| self.explain(&error, value.span()))
    }

    /// What serde refused, by itself or within the value at `whole`. It tells a missing, an
    /// unknown and a mistyped key apart in words only.
    fn explain(&self, error: &Error, whole: Range<usize>) -> StageError {
        let (span, message) = (error.span().unwrap_or(whole), error.message());
        if let Some(name) = message.strip_prefix("missing field ") {
            let key = format!("{}.{}", self.key(&span), name.trim_matches('`'));
            return self.missing(span, key.trim_start_matches('.'));
        }
        if let Some((_, known)) = message
            .strip_prefix("unknown field ")
            .and_then(|m| m.split_once(", "))
        {
            return self.refuse(span, format!("unknown key, {known}; {MISSPELT}"));
        }
        self.wrong_kind(span, message)
    }

    fn wrong_kind(&self, span: Range<usize>, message: &str) -> StageError {
        let key = self.key(&span);
        // What was found quotes the file; what was expected is in serde's words.
        let (found, expected) = message.split_once(", expected ").unwrap_or((message, ""));
        let expected = expected
            .replace("f64", "a number")
            .replace("i128", "a whole number")
            .replace("i64", "a whole number")
            .replace("a map", "a table")
            .replace("a sequence", "a list");
        let message = format!("{found}, expected {expected}");
        let remedy = example(&key).map(|example| format!("write it like {example}"));
        let remedy = remedy.unwrap_or_else(|| "write what is expected".to_owned());
        self.refuse(span, format!("{message}; {remedy}"))
    }

    fn missing(&self, table: Range<usize>, key: &str) -> StageError {
        let example = example(key).map(|example| format!(", for instance {example}"));
        let example = example.unwrap_or_default();
        let problem = match self.text.matches(MARK).count() {
            0 => format!("missing; add it{example}"),
            lines => format!(
                "missing; fill in the {lines} lines that begin with `{}`{example}",
                MARK.trim()
            ),
        };
        self.error(table.start, key.to_owned(), problem)
    }

    fn error(&self, offset: usize, key: String, problem: String) -> StageError {
        StageError::Key {
            place: place(self.path, self.text, offset),
            key,
            problem,
        }
    }

    /// Where a table of the file stands.
    fn span(&self, table: &str) -> Range<usize> {
        self.top.get_ref().get(table).map_or(0..0, Spanned::span)
    }

    /// The full key, as in `search.a_per_m[0]`, of the value or the name that stands at `span`.
    fn key(&self, span: &Range<usize>) -> String {
        let key = key_in(self.top.get_ref(), span).unwrap_or_default();
        key.trim_start_matches('.').to_owned()
    }
}

fn key_in(value: &DeValue<'_>, span: &Range<usize>) -> Option<String> {
    let below = |name: String, own: bool, value: &Spanned<DeValue<'_>>| {
        let here = own || value.span() == *span;
        let deeper = key_in(value.get_ref(), span).map(|rest| format!("{name}{rest}"));
        deeper.or_else(|| here.then_some(name))
    };
    match value {
        DeValue::Table(entries) => entries.iter().find_map(|(name, value)| {
            below(format!(".{}", name.get_ref()), name.span() == *span, value)
        }),
        DeValue::Array(items) => (0..)
            .zip(items.iter())
            .find_map(|(k, value): (usize, _)| below(format!("[{k}]"), false, value)),
        _ => None,
    }
}

/// Line and column of a byte offset.
fn place(path: &Path, text: &str, offset: usize) -> Place {
    let before = text.get(..offset).unwrap_or(text);
    let line_start = before.rfind('\n').map_or(0, |newline| newline + 1);
    Place {
        path: path.to_path_buf(),
        line: before.matches('\n').count() + 1,
        column: before.get(line_start..).unwrap_or("").chars().count() + 1,
    }
}

/// How the stage file that ships with the program writes the key, if it has it.
fn example(key: &str) -> Option<String> {
    let (key, _) = key.split_once('[').unwrap_or((key, ""));
    let (table, name) = key.split_once('.').unwrap_or((key, ""));
    let shipped = DeTable::parse(STAGE_TOML).ok()?;
    let entries = shipped.get_ref().get(table)?.get_ref().as_table()?;
    if name.is_empty() {
        let names: Vec<&str> = entries.keys().map(|name| name.get_ref().as_ref()).collect();
        return Some(format!("`[{table}]` with {}", names.join(", ")));
    }
    let value = STAGE_TOML.get(entries.get(name)?.span())?;
    Some(format!("`{name} = {value}`"))
}
