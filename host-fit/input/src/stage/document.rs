//! The parsed text of a stage file: the values of its tables, and the place and the key of every fault.

use super::error::{StageError, TextPosition};
use crate::draft::MARK;
use crate::shipped::STAGE_TOML;
use serde::de::DeserializeOwned;
use std::cell::RefCell;
use std::ops::Range;
use std::path::Path;
use toml::Spanned;
use toml::de::{DeTable, DeValue, ValueDeserializer};

/// A parsed stage file.
pub(super) struct Document<'t> {
    path: &'t Path,
    text: &'t str,
    top: Spanned<DeValue<'t>>,
    /// The keys that were asked for, each after its table: those that are known.
    asked: RefCell<Vec<(String, String)>>,
}

/// A list of the file.
pub(super) type List<T> = Spanned<Vec<T>>;

impl<'t> Document<'t> {
    pub(super) fn parse(text: &'t str, path: &'t Path) -> Result<Self, StageError> {
        let top = DeTable::parse(text).map_err(|error| {
            let place = position(path, text, error.span().map_or(0, |span| span.start));
            let line = text.lines().nth(place.line - 1).unwrap_or_default();
            let value = line.split_once('=').map_or("", |(_, value)| value);
            let message = decimal_comma(value);
            StageError::Syntax {
                place,
                message: message.unwrap_or_else(|| error.message().to_owned()),
            }
        })?;
        let top = Spanned::new(top.span(), DeValue::Table(top.into_inner()));
        Ok(Self {
            path,
            text,
            top,
            asked: RefCell::default(),
        })
    }

    /// The value of the key `name` in a table of the file, if it is there.
    pub(super) fn read<T: DeserializeOwned>(
        &self,
        table: &str,
        name: &str,
    ) -> Result<Option<T>, StageError> {
        let Some(value) = self.value(table, name)? else {
            return Ok(None);
        };
        let read = T::deserialize(ValueDeserializer::from(value.clone()));
        read.map(Some).map_err(|error| {
            let span = error.span().unwrap_or_else(|| value.span());
            self.wrong_kind(span, error.message())
        })
    }

    /// The value of the key `name` in a table of the file.
    pub(super) fn require<T: DeserializeOwned>(
        &self,
        table: &str,
        name: &str,
    ) -> Result<T, StageError> {
        let value = self.read(table, name)?;
        value.ok_or_else(|| match self.table(table) {
            Some(found) => self.missing(found, table, name),
            None => self.missing(&self.top, "", table),
        })
    }

    /// Where the value of a key stands.
    pub(super) fn span(&self, table: &str, name: &str) -> Range<usize> {
        let value = self
            .table(table)
            .and_then(|table| table.get_ref().get(name));
        value.map_or(0..0, Spanned::span)
    }

    /// Whether the key `name` of a table holds a text.
    pub(super) fn is_text(&self, table: &str, name: &str) -> Result<bool, StageError> {
        let value = self.value(table, name)?;
        Ok(value.is_some_and(|value| value.get_ref().is_str()))
    }

    /// Refuses keys that nobody asked for: a misspelt one would otherwise be ignored without a word.
    pub(super) fn refuse_unknown(&self) -> Result<(), StageError> {
        self.refuse_unknown_in(&self.top, "")
    }

    fn refuse_unknown_in(
        &self,
        table: &Spanned<DeValue<'t>>,
        path: &str,
    ) -> Result<(), StageError> {
        let DeValue::Table(entries) = table.get_ref() else {
            return Ok(());
        };
        let asked = self.asked.borrow();
        let asked = asked.iter().filter(|(table, _)| table == path);
        let known: Vec<&str> = asked.map(|(_, name)| name.as_str()).collect();
        let mut names: Vec<_> = entries.keys().collect();
        names.sort_by_key(|name| name.span().start);
        for name in names {
            let (span, name) = (name.span(), name.get_ref().as_ref());
            if known.contains(&name) {
                let value = entries.get(name).unwrap_or(table);
                self.refuse_unknown_in(value, &joined(path, name))?;
                continue;
            }
            let absent = known.iter().filter(|known| !entries.contains_key(**known));
            let meant = absent.copied().find(|known| is_like(known, name));
            let remedy = meant.map_or_else(
                || {
                    format!(
                        "an unknown key, expected one of {}; remove it",
                        known.join(", ")
                    )
                },
                |meant| format!("an unknown key; did you mean `{meant}`?"),
            );
            return Err(self.refuse(span, remedy));
        }
        Ok(())
    }

    /// The items of a list, if they are N: serde's own arrays take longer lists from TOML
    /// without a word.
    pub(super) fn exactly<'l, T, const N: usize>(
        &self,
        list: &'l List<T>,
    ) -> Result<&'l [T; N], StageError> {
        let items = list.get_ref().as_slice();
        let written = self.text.get(list.span()).unwrap_or_default();
        let comma = decimal_comma(written).filter(|_| items.len() == 2 * N);
        let count = format!("a list of {}, expected a list of {N}", items.len());
        let items = items.try_into();
        items.map_err(|_| match comma {
            Some(comma) => self.refuse(list.span(), comma),
            None => self.wrong_kind(list.span(), &count),
        })
    }

    /// A number from `low` to `high`; `None` if the file does not have it.
    ///
    /// # Errors
    /// As [`Self::read`] and [`Self::within`].
    pub(super) fn number(
        &self,
        table: &str,
        name: &str,
        (low, high): (f64, f64),
        unit: &str,
    ) -> Result<Option<f64>, StageError> {
        let given: Option<Spanned<f64>> = self.read(table, name)?;
        let number = given.map(|number| self.within(&number, low, high, unit));
        number.transpose()
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

    /// The value of a key, which is known from now on.
    fn value(&self, table: &str, name: &str) -> Result<Option<&Spanned<DeValue<'t>>>, StageError> {
        let (mut found, mut path) = (Some(&self.top), String::new());
        for key in names(table).chain([name]) {
            let asked = (path.clone(), key.to_owned());
            if !self.asked.borrow().contains(&asked) {
                self.asked.borrow_mut().push(asked);
            }
            if let Some(value) = found.filter(|value| !value.get_ref().is_table()) {
                return Err(self.wrong_kind(value.span(), "invalid type, expected a table"));
            }
            found = found.and_then(|table| table.get_ref().get(key));
            path = joined(&path, key);
        }
        Ok(found)
    }

    fn wrong_kind(&self, span: Range<usize>, message: &str) -> StageError {
        let key = self.key(&span);
        // serde quotes the file, and names the expected type in words of Rust.
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

    fn missing(&self, table: &Spanned<DeValue<'t>>, path: &str, name: &str) -> StageError {
        let misspelt = table.get_ref().as_table().and_then(|entries| {
            let unknown = |key: &str| example(&joined(path, key)).is_none();
            (entries.keys()).find(|key| is_like(key.get_ref(), name) && unknown(key.get_ref()))
        });
        if let Some(key) = misspelt {
            let problem = format!("an unknown key; did you mean `{name}`?");
            return self.refuse(key.span(), problem);
        }
        let key = joined(path, name);
        let example = example(&key).map(|example| format!(", for instance {example}"));
        let example = example.unwrap_or_default();
        let problem = match self.text.matches(MARK).count() {
            0 => format!("missing; add it{example}"),
            lines => format!(
                "missing; fill in the {lines} lines that begin with `{}`{example}",
                MARK.trim()
            ),
        };
        self.error(table.span().start, key, problem)
    }

    fn error(&self, offset: usize, key: String, problem: String) -> StageError {
        StageError::Key {
            place: position(self.path, self.text, offset),
            key,
            problem,
        }
    }

    /// A table of the file by its key, as in `motion.x`.
    fn table(&self, key: &str) -> Option<&Spanned<DeValue<'t>>> {
        names(key).try_fold(&self.top, |table, name| table.get_ref().get(name))
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

/// The names in a key.
fn names(key: &str) -> impl Iterator<Item = &str> {
    key.split('.').filter(|name| !name.is_empty())
}

/// The key of `name` in a table; the key of the file itself is empty.
fn joined(table: &str, name: &str) -> String {
    match table {
        "" => name.to_owned(),
        _ => format!("{table}.{name}"),
    }
}

/// Whether one name is the other but for a letter in three.
fn is_like(one: &str, other: &str) -> bool {
    let letters = one.chars().count().max(other.chars().count());
    3 * strsim::damerau_levenshtein(one, other) <= letters
}

/// What to say of a number with a decimal comma, if there is one.
fn decimal_comma(text: &str) -> Option<String> {
    let is_digit = |c: char| c.is_ascii_digit();
    text.match_indices(',').find_map(|(at, _)| {
        let (before, after) = (text.get(..at)?, text.get(at + 1..)?);
        let whole = before.get(before.trim_end_matches(is_digit).len()..)?;
        let decimals = after.get(..after.len() - after.trim_start_matches(is_digit).len())?;
        let is_number = !whole.is_empty() && !decimals.is_empty();
        is_number.then(|| {
            format!("a decimal comma; write a decimal point ({whole}.{decimals}, not {whole},{decimals})")
        })
    })
}

/// Line and column of a byte offset.
fn position(path: &Path, text: &str, offset: usize) -> TextPosition {
    let before = text.get(..offset).unwrap_or(text);
    let line_start = before.rfind('\n').map_or(0, |newline| newline + 1);
    TextPosition {
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
