//! Figures as JSON: an object for each group. A key ends with the unit of its figure, as `peak_um`.

use super::figure::{Figure, Group, Item};
use serde::ser::{Serialize, SerializeMap, Serializer};

impl Serialize for Figure {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::None => to.serialize_none(),
            Self::Text(text) => to.serialize_str(text),
            Self::Is(is) => to.serialize_bool(*is),
            Self::Count(count) => to.serialize_i64(*count),
            Self::Number { value, .. } => Some(*value).filter(|x| x.is_finite()).serialize(to),
            Self::List(all) => all.serialize(to),
        }
    }
}

impl Serialize for Item {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Figure(figure) => figure.serialize(to),
            Self::Group(group) => group.serialize(to),
            Self::List(groups) => groups.serialize(to),
            Self::Hidden(value) => value.serialize(to),
        }
    }
}

impl Serialize for Group {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        let mut map = to.serialize_map(None)?;
        for (name, item) in &self.0 {
            let Item::Figure(figure) = item else {
                map.serialize_entry(name, item)?;
                continue;
            };
            let suffix = figure.unit().suffix();
            map.serialize_entry(&format!("{name}{suffix}"), figure)?;
            let errors = standard_errors(figure);
            if errors != Figure::None {
                map.serialize_entry(&format!("standard_error{suffix}"), &errors)?;
            }
        }
        map.end()
    }
}

/// The standard error of a figure, or those of a list where all are known.
fn standard_errors(figure: &Figure) -> Figure {
    match figure {
        Figure::Number {
            error: Some(error), ..
        } => (*error).into(),
        Figure::List(all) if !all.is_empty() => {
            let errors: Vec<_> = all.iter().map(standard_errors).collect();
            match errors.contains(&Figure::None) {
                true => Figure::None,
                false => Figure::List(errors),
            }
        }
        _ => Figure::None,
    }
}
