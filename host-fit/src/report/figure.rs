//! Figures of a result, in groups: JSON has them by key, tables show them with their units.

use super::text::{file_name, words};
use hallstage_input::axis::Axis;
use serde_json::Value;
use std::path::Path;

/// A value of a result.
#[derive(Clone, Debug, PartialEq)]
pub enum Figure {
    /// Not known, or not there.
    None,
    /// A name or a sentence.
    Text(String),
    /// Yes or no.
    Is(bool),
    /// A whole number.
    Count(i64),
    /// A quantity; its value is null in JSON where it is not finite.
    Number {
        /// In the unit.
        value: f64,
        /// The unit, empty for a pure number.
        unit: Unit,
        /// The standard error, where it is known.
        error: Option<f64>,
    },
    /// Several in a fixed order.
    List(Vec<Figure>),
}

/// The unit of a figure, as `um`, `urad`, `1/m`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Unit {
    /// What a table shows.
    pub name: &'static str,
    /// Whether the key in JSON ends with the unit, as `peak_um`.
    pub in_key: bool,
}

impl Unit {
    /// What follows the name of a figure in its key.
    pub(super) fn suffix(self) -> String {
        match self.name {
            _ if !self.in_key => String::new(),
            "" => String::new(),
            "%" => "_percent".to_owned(),
            "degC" => "_c".to_owned(),
            unit => format!(
                "_{}",
                unit.to_lowercase()
                    .replace("1/", "per_")
                    .replace('/', "_per_")
                    .replace(['(', ')'], "")
            ),
        }
    }
}

/// A figure with its unit at the end of its key.
pub fn figure(value: f64, unit: &'static str) -> Figure {
    number(value, unit, true)
}

/// A figure with a key that does not name its unit.
pub fn bare(value: f64, unit: &'static str) -> Figure {
    number(value, unit, false)
}

const fn number(value: f64, name: &'static str, in_key: bool) -> Figure {
    let (unit, error) = (Unit { name, in_key }, None);
    Figure::Number { value, unit, error }
}

/// An error along an axis, given in SI and shown in millionths: um or urad.
pub fn micro(axis: &Axis, error: f64) -> Figure {
    figure(error * 1e6, axis.micro)
}

/// The name of a file without its folder.
pub fn file(path: &Path) -> Figure {
    Figure::Text(file_name(path))
}

impl Figure {
    /// The same with its standard error.
    pub fn with_error(self, standard_error: Option<f64>) -> Self {
        match self {
            Self::Number { value, unit, .. } => Self::Number {
                value,
                unit,
                error: standard_error,
            },
            other => other,
        }
    }

    /// Its unit; a list has the unit of its first figure.
    pub fn unit(&self) -> Unit {
        match self {
            Self::Number { unit, .. } => *unit,
            Self::List(all) => all.first().map(Self::unit).unwrap_or_default(),
            _ => Unit::default(),
        }
    }

    /// Whether it holds a text, or a yes or no.
    pub(super) fn is_text(&self) -> bool {
        match self {
            Self::Text(_) | Self::Is(_) => true,
            Self::List(all) => all.iter().any(Self::is_text),
            _ => false,
        }
    }

    /// Whether it has no value.
    pub(super) fn is_empty(&self) -> bool {
        match self {
            Self::None => true,
            Self::List(all) => all.is_empty(),
            _ => false,
        }
    }

    /// The same in a unit that reads well: angles in mrad, and where `small` lengths and angles in millionths.
    pub(super) fn readable(&self, small: bool) -> Self {
        let scaled = |value: f64, by: f64, name, error: Option<f64>| {
            bare(value * by, name).with_error(error.map(|error| error * by))
        };
        match *self {
            Self::Number { value, unit, error } => match unit.name {
                "m" if small && value.abs() < 0.01 => scaled(value, 1e6, "um", error),
                "rad" if small && value.abs() < 0.01 => scaled(value, 1e6, "urad", error),
                "rad" => scaled(value, 1e3, "mrad", error),
                _ => self.clone(),
            },
            Self::List(ref all) => Self::List(all.iter().map(|one| one.readable(small)).collect()),
            _ => self.clone(),
        }
    }
}

/// A member of a group.
#[derive(Clone, Debug, PartialEq)]
pub enum Item {
    /// A figure.
    Figure(Figure),
    /// Figures that belong together.
    Group(Group),
    /// Groups of the same figures: the rows of a table.
    List(Vec<Group>),
    /// For JSON alone: shown in another way, or nowhere.
    Hidden(Value),
}

/// Figures by name, in order.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Group(pub Vec<(String, Item)>);

impl Group {
    /// Replaces a member, or adds it at the end.
    pub fn set(&mut self, name: &str, item: impl Into<Item>) {
        match self.0.iter_mut().find(|(key, _)| key == name) {
            Some((_, old)) => *old = item.into(),
            None => self.0.push((name.to_owned(), item.into())),
        }
    }

    /// Whether groups are in it.
    pub(super) fn has_groups(&self) -> bool {
        self.0
            .iter()
            .any(|(_, item)| matches!(item, Item::Group(_)))
    }

    /// Its figures and the figures of the groups in it, these with the name of their group before their own.
    pub(crate) fn flat(&self) -> Vec<(String, Figure)> {
        let one = |(name, item): &(String, Item)| match item {
            Item::Figure(figure) => vec![(words(name), figure.readable(false))],
            Item::Group(group) => {
                let inner = group.flat().into_iter();
                inner
                    .map(|(inner, figure)| (format!("{} {inner}", words(name)), figure))
                    .collect()
            }
            Item::List(groups) => {
                let lines = groups.iter().map(|group| {
                    Figure::List(
                        group
                            .0
                            .iter()
                            .filter_map(|(_, item)| match item {
                                Item::Figure(figure) => Some(figure.clone()),
                                _ => None,
                            })
                            .collect(),
                    )
                });
                vec![(words(name), Figure::List(lines.collect()))]
            }
            Item::Hidden(_) => Vec::new(),
        };
        self.0.iter().flat_map(one).collect()
    }
}

/// A group, written as `group! { "rows" => rows, "rmse" => micro(axis, rms) }`.
macro_rules! group {
    ($($name:expr => $item:expr),* $(,)?) => {
        $crate::report::figure::Group(vec![$(($name.into(), $crate::report::figure::Item::from($item))),*])
    };
}
pub(crate) use group;

/// Plain values as figures.
macro_rules! from {
    ($($type:ty: $value:ident => $figure:expr;)*) => {$(
        impl From<$type> for Figure {
            fn from($value: $type) -> Self {
                $figure
            }
        }
        impl From<$type> for Item {
            fn from(value: $type) -> Self {
                Self::Figure(Figure::from(value))
            }
        }
    )*};
}

from! {
    &str: text => Self::Text(text.to_owned());
    String: text => Self::Text(text);
    bool: is => Self::Is(is);
    i32: count => Self::Count(count.into());
    u32: count => Self::Count(count.into());
    usize: count => Self::Count(count as i64);
    u64: count => Self::Count(count as i64);
    f64: value => figure(value, "");
}

impl From<Figure> for Item {
    fn from(figure: Figure) -> Self {
        Self::Figure(figure)
    }
}

impl From<Group> for Item {
    fn from(group: Group) -> Self {
        Self::Group(group)
    }
}

impl From<Vec<Group>> for Item {
    fn from(list: Vec<Group>) -> Self {
        Self::List(list)
    }
}

impl From<Value> for Item {
    fn from(value: Value) -> Self {
        Self::Hidden(value)
    }
}

impl<T: Into<Self>> From<Option<T>> for Item {
    fn from(item: Option<T>) -> Self {
        item.map_or(Self::Figure(Figure::None), Into::into)
    }
}

impl<T: Into<Figure>> FromIterator<T> for Figure {
    fn from_iter<I: IntoIterator<Item = T>>(all: I) -> Self {
        Self::List(all.into_iter().map(Into::into).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_key_of_a_figure_ends_with_its_unit() {
        for (unit, suffix) in [
            ("", ""),
            ("um", "_um"),
            ("%", "_percent"),
            ("degC", "_c"),
            ("1/K", "_per_k"),
            ("um/(m/s2)", "_um_per_m_per_s2"),
        ] {
            assert_eq!(figure(1.0, unit).unit().suffix(), suffix);
        }
        assert_eq!(bare(1.0, "um").unit().suffix(), "");
    }
}
