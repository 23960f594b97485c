//! TOML values with their key and their place, so that every error can name both.

use super::error::{Place, StageError, ValueFault};
use std::path::Path;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// The text of a stage file, for turning offsets into places.
#[derive(Clone, Copy)]
pub(super) struct Document<'t> {
    pub(super) path: &'t Path,
    pub(super) text: &'t str,
}

impl Document<'_> {
    /// Line and column of a byte offset.
    pub(super) fn place(&self, offset: usize) -> Place {
        let before = self.text.get(..offset).unwrap_or(self.text);
        let line_start = before.rfind('\n').map_or(0, |newline| newline + 1);
        Place {
            path: self.path.to_path_buf(),
            line: before.matches('\n').count() + 1,
            column: before.get(line_start..).unwrap_or("").chars().count() + 1,
        }
    }
}

/// A table of the document; `name` is empty for the top of the file.
pub(super) struct Table<'t> {
    document: Document<'t>,
    name: String,
    start: usize,
    entries: &'t DeTable<'t>,
}

/// One value with its full key.
#[derive(Clone)]
pub(super) struct Value<'t> {
    document: Document<'t>,
    key: String,
    start: usize,
    value: &'t DeValue<'t>,
}

impl<'t> Table<'t> {
    pub(super) const fn top(document: Document<'t>, entries: &'t DeTable<'t>) -> Self {
        Self {
            document,
            name: String::new(),
            start: document.text.len(),
            entries,
        }
    }

    fn full(&self, key: &str) -> String {
        if self.name.is_empty() {
            key.to_owned()
        } else {
            format!("{}.{key}", self.name)
        }
    }

    /// The value of `key`, if it is there.
    pub(super) fn get(&self, key: &str) -> Option<Value<'t>> {
        let value = self.entries.get(key)?;
        Some(Value {
            document: self.document,
            key: self.full(key),
            start: value.span().start,
            value: value.get_ref(),
        })
    }

    /// The value of `key`; `hint` says what it should hold if it is missing.
    pub(super) fn require(&self, key: &str, hint: &str) -> Result<Value<'t>, StageError> {
        self.get(key).ok_or_else(|| StageError::Missing {
            place: self.document.place(self.start),
            key: self.full(key),
            hint: hint.to_owned(),
        })
    }

    /// The table `key`; `hint` says what it should hold if it is missing.
    pub(super) fn table(&self, key: &str, hint: &str) -> Result<Table<'t>, StageError> {
        self.require(key, hint)?.table()
    }

    /// Refuses keys other than `known`.
    pub(super) fn only(&self, known: &[&str]) -> Result<(), StageError> {
        let unknown = self
            .entries
            .keys()
            .filter(|key| !known.contains(&key.get_ref().as_ref()))
            .min_by_key(|key| key.span().start);
        match unknown {
            None => Ok(()),
            Some(key) => Err(StageError::Unknown {
                place: self.document.place(key.span().start),
                key: self.full(key.get_ref()),
                known: known.join(", "),
            }),
        }
    }
}

impl<'t> Value<'t> {
    /// An error at this value.
    pub(super) fn absurd(&self, fault: ValueFault) -> StageError {
        StageError::Absurd {
            place: self.document.place(self.start),
            key: self.key.clone(),
            fault,
        }
    }

    fn wrong_type(&self, expected: &'static str) -> StageError {
        let found = match self.value {
            DeValue::String(_) => "a text",
            DeValue::Integer(_) => "a whole number out of range",
            DeValue::Float(_) => "a number with a fraction",
            DeValue::Boolean(_) => "true or false",
            DeValue::Datetime(_) => "a date or time",
            DeValue::Array(_) => "a list",
            DeValue::Table(_) => "a table",
        };
        let found = match self.value {
            DeValue::Array(items) => format!("a list of {}", items.len()),
            _ => found.to_owned(),
        };
        StageError::WrongType {
            place: self.document.place(self.start),
            key: self.key.clone(),
            expected,
            found,
        }
    }

    /// A finite number.
    pub(super) fn number(&self) -> Result<f64, StageError> {
        let text = match self.value {
            DeValue::Float(number) => number.as_str(),
            DeValue::Integer(number) if number.radix() == 10 => number.as_str(),
            _ => return Err(self.wrong_type("a number")),
        };
        let value: f64 = text.parse().map_err(|_| self.wrong_type("a number"))?;
        if value.is_finite() {
            Ok(value)
        } else {
            Err(self.absurd(ValueFault::NotFinite { value }))
        }
    }

    /// A number above zero and within `low` to `high`.
    pub(super) fn positive(
        &self,
        low: f64,
        high: f64,
        unit: &'static str,
    ) -> Result<f64, StageError> {
        let value = self.number()?;
        if value <= 0.0 {
            return Err(self.absurd(ValueFault::NotPositive { value, unit }));
        }
        self.within(value, low, high, unit)
    }

    /// `value`, if it lies within `low` to `high`.
    pub(super) fn within(
        &self,
        value: f64,
        low: f64,
        high: f64,
        unit: &'static str,
    ) -> Result<f64, StageError> {
        if (low..=high).contains(&value) {
            Ok(value)
        } else {
            Err(self.absurd(ValueFault::Implausible {
                value,
                low,
                high,
                unit,
            }))
        }
    }

    /// A whole number.
    pub(super) fn integer(&self) -> Result<i64, StageError> {
        let DeValue::Integer(number) = self.value else {
            return Err(self.wrong_type("a whole number"));
        };
        i64::from_str_radix(number.as_str(), number.radix())
            .map_err(|_| self.wrong_type("a whole number of up to 64 bits"))
    }

    /// A text.
    pub(super) fn text(&self) -> Result<&'t str, StageError> {
        match self.value {
            DeValue::String(text) => Ok(text.as_ref()),
            _ => Err(self.wrong_type("a text in quotes")),
        }
    }

    /// Whether this is a table.
    pub(super) const fn is_table(&self) -> bool {
        matches!(self.value, DeValue::Table(_))
    }

    /// The values of a list.
    pub(super) fn list(&self) -> Result<Vec<Value<'t>>, StageError> {
        let DeValue::Array(items) = self.value else {
            return Err(self.wrong_type("a list"));
        };
        let item = |(k, item): (usize, &'t Spanned<DeValue<'t>>)| Value {
            document: self.document,
            key: format!("{}[{k}]", self.key),
            start: item.span().start,
            value: item.get_ref(),
        };
        Ok(items.iter().enumerate().map(item).collect())
    }

    /// The values of a list of exactly N; `expected` says of what.
    pub(super) fn items<const N: usize>(
        &self,
        expected: &'static str,
    ) -> Result<[Value<'t>; N], StageError> {
        if !matches!(self.value, DeValue::Array(_)) {
            return Err(self.wrong_type(expected));
        }
        self.list()?
            .try_into()
            .map_err(|_| self.wrong_type(expected))
    }

    /// The table that this value is.
    pub(super) fn table(&self) -> Result<Table<'t>, StageError> {
        match self.value {
            DeValue::Table(entries) => Ok(Table {
                document: self.document,
                name: self.key.clone(),
                start: self.start,
                entries,
            }),
            _ => Err(self.wrong_type("a table")),
        }
    }
}
