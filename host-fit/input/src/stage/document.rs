//! The parsed text of a stage file: its values, and the place and the key of every fault.
//!
//! `keys.toml` has every key with a value. A file is checked against it: its keys must be there, and its values be of the
//! same kind.

use super::error::{StageError, TextPosition};
use crate::draft::MARK;
use serde::de::DeserializeOwned;
use std::borrow::Cow;
use std::ops::Range;
use std::path::Path;
use toml::Spanned;
use toml::de::{DeTable, DeValue, ValueDeserializer};

/// Every key.
const KEYS: &str = include_str!("keys.toml");

/// A parsed stage file.
pub(super) struct Document<'t> {
    path: &'t Path,
    text: &'t str,
    top: Spanned<DeValue<'t>>,
    keys: Spanned<DeValue<'static>>,
}

/// A value of the file, with its full key, as `search.a_per_m[0]`.
pub(super) struct Value<'d> {
    key: String,
    value: &'d Spanned<DeValue<'d>>,
}

impl<'d> Value<'d> {
    /// The member of a table.
    fn member(&self, name: &str) -> Option<Self> {
        let key = joined(&self.key, name);
        let value = self.value.get_ref().get(name)?;
        Some(Self { key, value })
    }

    /// The items of a list.
    pub(super) fn items(&self) -> Vec<Self> {
        let items = self.value.get_ref().as_array().into_iter().flatten();
        let item = |(k, value): (usize, &'d Spanned<DeValue<'d>>)| Self {
            key: format!("{}[{k}]", self.key),
            value,
        };
        items.enumerate().map(item).collect()
    }

    /// A text.
    pub(super) fn as_text(&self) -> Option<&'d str> {
        self.value.get_ref().as_str()
    }
}

impl<'t> Document<'t> {
    /// Parses a text. Unknown keys, and values of another kind than in `keys.toml`, are refused.
    pub(super) fn parse(text: &'t str, path: &'t Path) -> Result<Self, StageError> {
        let parsed = DeTable::parse(text).map_err(|error| {
            let place = position(path, text, error.span().map_or(0, |span| span.start));
            let line = text.lines().nth(place.line - 1).unwrap_or_default();
            let value = line.split_once('=').map_or("", |(_, value)| value);
            let message = match has_decimal_comma(value) {
                true => "a decimal comma; write a decimal point, as 0.1975",
                false => error.message(),
            };
            let message = message.to_owned();
            StageError::Syntax { place, message }
        });
        let document = Self {
            path,
            text,
            top: as_value(parsed?),
            keys: as_value(DeTable::parse_recoverable(KEYS).0),
        };
        document.check(&document.top(), &document.keys)?;
        Ok(document)
    }

    fn top(&self) -> Value<'_> {
        let (key, value) = (String::new(), &self.top);
        Value { key, value }
    }

    /// Refuses what is not like the example.
    fn check(&self, found: &Value<'_>, example: &Spanned<DeValue<'_>>) -> Result<(), StageError> {
        match (found.value.get_ref(), example.get_ref()) {
            (DeValue::Table(entries), DeValue::Table(known)) => {
                for name in entries.keys() {
                    let example = known.get(name.get_ref().as_ref());
                    let example = example.ok_or_else(|| self.unknown(found, name, known))?;
                    let member = found.member(name.get_ref());
                    member.map_or(Ok(()), |member| self.check(&member, example))?;
                }
                Ok(())
            }
            // A list of one text stands for any number of them.
            (DeValue::Array(items), DeValue::Array(like))
                if items.len() == like.len() || like.len() == 1 =>
            {
                let mut pairs = found.items().into_iter().zip(like.iter().cycle());
                pairs.try_for_each(|(item, like)| self.check(&item, like))
            }
            (DeValue::String(_), DeValue::Table(known)) if known.contains_key("column") => Ok(()),
            (DeValue::Integer(_), DeValue::Float(_)) => Ok(()),
            (value, like) if value.type_str() == like.type_str() && !value.is_array() => Ok(()),
            (value, _) => {
                let (kind, example) = (value.type_str(), self.example(&found.key));
                let problem = format!("this {kind} does not fit; write it like {example}");
                Err(self.refuse(found, problem))
            }
        }
    }

    fn unknown(
        &self,
        table: &Value<'_>,
        name: &Spanned<Cow<'_, str>>,
        known: &DeTable<'_>,
    ) -> StageError {
        let known: Vec<&str> = known.keys().map(|name| name.get_ref().as_ref()).collect();
        let mut absent = known.iter().filter(|known| table.member(known).is_none());
        let problem = match absent.find(|known| is_like(known, name.get_ref())) {
            Some(meant) => format!("an unknown key; did you mean `{meant}`?"),
            None => format!(
                "an unknown key, expected one of {}; remove it",
                known.join(", ")
            ),
        };
        self.error(name.span(), joined(&table.key, name.get_ref()), problem)
    }

    /// The value of the key `name` in a table of the file, if it is there.
    pub(super) fn get(&self, table: &str, name: &str) -> Option<Value<'_>> {
        self.table(table)?.member(name)
    }

    /// The same.
    ///
    /// # Errors
    /// [`StageError::Key`] if it is missing.
    pub(super) fn require(&self, table: &str, name: &str) -> Result<Value<'_>, StageError> {
        self.get(table, name)
            .ok_or_else(|| match self.table(table) {
                Some(found) => self.missing(&found, joined(table, name)),
                None => self.missing(&self.top(), table.to_owned()),
            })
    }

    /// A table of the file by its key, as in `motion.x`.
    fn table(&self, key: &str) -> Option<Value<'_>> {
        key.split('.')
            .try_fold(self.top(), |table, name| table.member(name))
    }

    /// A number from `low` to `high`; `None` if the file does not have it.
    ///
    /// # Errors
    /// As [`Self::within`].
    pub(super) fn number(
        &self,
        table: &str,
        name: &str,
        range: (f64, f64),
        unit: &str,
    ) -> Result<Option<f64>, StageError> {
        let given = self.get(table, name);
        given
            .map(|number| self.within(&number, range, unit))
            .transpose()
    }

    /// The same of a number that must be there.
    ///
    /// # Errors
    /// As [`Self::require`] and [`Self::within`].
    pub(super) fn required(
        &self,
        table: &str,
        name: &str,
        range: (f64, f64),
        unit: &str,
    ) -> Result<f64, StageError> {
        self.within(&self.require(table, name)?, range, unit)
    }

    /// A number, if it lies within `low` to `high`; infinities and NaN never do.
    pub(super) fn within(
        &self,
        number: &Value<'_>,
        (low, high): (f64, f64),
        unit: &str,
    ) -> Result<f64, StageError> {
        let value: f64 = self.read(number)?;
        if (low..=high).contains(&value) {
            return Ok(value);
        }
        let problem = format!(
            "{value} {unit} is outside {low:e} to {high:e} {unit}; check the value and its unit (SI)"
        );
        Err(self.refuse(number, problem))
    }

    /// A value as a type.
    pub(super) fn read<T: DeserializeOwned>(&self, value: &Value<'_>) -> Result<T, StageError> {
        let read = T::deserialize(ValueDeserializer::from(value.value.clone()));
        read.map_err(|error| self.refuse(value, format!("{}; correct it", error.message())))
    }

    /// An error at a value; `problem` says what to do.
    pub(super) fn refuse(&self, value: &Value<'_>, problem: impl Into<String>) -> StageError {
        self.error(value.value.span(), value.key.clone(), problem.into())
    }

    fn missing(&self, table: &Value<'_>, key: String) -> StageError {
        let example = self.example(&key);
        let problem = match self.text.matches(MARK).count() {
            0 => format!("missing; add it, for instance {example}"),
            lines => format!(
                "missing; fill in the {lines} lines that begin with `{}`, for instance {example}",
                MARK.trim()
            ),
        };
        self.error(table.value.span(), key, problem)
    }

    fn error(&self, span: Range<usize>, key: String, problem: String) -> StageError {
        let place = position(self.path, self.text, span.start);
        StageError::Key {
            place,
            key,
            problem,
        }
    }

    /// How `keys.toml` writes the key.
    fn example(&self, key: &str) -> String {
        let (key, _) = key.split_once('[').unwrap_or((key, ""));
        let mut names = key.split('.');
        let value = names.try_fold(&self.keys, |table, name| table.get_ref().get(name));
        match value.map(|value| (value.get_ref(), KEYS.get(value.span()))) {
            Some((value, Some(text))) if !value.is_table() || text.starts_with('{') => {
                format!("`{} = {text}`", key.rsplit('.').next().unwrap_or(key))
            }
            _ => format!("`[{key}]`"),
        }
    }
}

fn as_value(table: Spanned<DeTable<'_>>) -> Spanned<DeValue<'_>> {
    Spanned::new(table.span(), DeValue::Table(table.into_inner()))
}

/// The key of `name` in a table; the key of the file itself is empty.
fn joined(table: &str, name: &str) -> String {
    format!("{table}.{name}").trim_start_matches('.').to_owned()
}

/// Whether one name is the other but for a letter in three.
fn is_like(one: &str, other: &str) -> bool {
    let letters = one.chars().count().max(other.chars().count());
    3 * strsim::damerau_levenshtein(one, other) <= letters
}

/// Whether a value begins like a number with a decimal comma.
fn has_decimal_comma(value: &str) -> bool {
    let digit = |c: char| c.is_ascii_digit();
    let comma = value.split_once(',');
    comma.is_some_and(|(whole, decimals)| whole.ends_with(digit) && decimals.starts_with(digit))
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
