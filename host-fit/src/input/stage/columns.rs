//! Reads the optional table `[log]`: which column of a log holds what, and in which unit.
//!
//! Each key is a quantity of [`Quantity`]; its value is the column's name, or a table:
//!
//! ```toml
//! [log]
//! movement = "run"
//! hall_a = "ADC 1"
//! ifm_x = "stage_x_um"                             # the unit is read from the name
//! ifm_y1 = { column = "Y left", unit = "um" }
//! ifm_y2 = { column = "Y right", scale = -6.25e-10 }  # m per unit of the column
//! ignore = ["temperature", "operator"]             # columns to leave out
//! ```

use super::error::{StageError, ValueFault};
use super::value::{Table, Value};
use crate::input::log::layout::{Column, Kind, LogLayout, Quantity};

/// Smallest and largest magnitude of a scale given by the user, in SI units per unit.
const SCALE_MAGNITUDES: (f64, f64) = (1e-15, 1e9);

/// The layout that the table describes; quantities that it leaves out keep their default.
pub(super) fn log_layout(table: &Table<'_>) -> Result<LogLayout, StageError> {
    let mut known: Vec<&str> = Quantity::ALL.iter().map(|q| q.key()).collect();
    known.push("ignore");
    table.only(&known)?;
    let mut layout = LogLayout::default();
    let mut mapped = Vec::new();
    for quantity in Quantity::ALL {
        let Some(value) = table.get(quantity.key()) else {
            continue;
        };
        layout.set(quantity, column(&value, quantity)?);
        mapped.push((quantity, value));
    }
    // Two keys for one column: at least one of them was mapped here, the other may be a default.
    for (quantity, value) in &mapped {
        let name = &layout.column(*quantity).name;
        let other = Quantity::ALL
            .into_iter()
            .find(|other| other != quantity && layout.column(*other).name == *name);
        if let Some(other) = other {
            return Err(value.absurd(ValueFault::ColumnTwice {
                column: name.clone(),
                other: other.key(),
            }));
        }
    }
    if let Some(value) = table.get("ignore") {
        for item in value.list()? {
            let name = named(&item)?;
            if let Some(quantity) = mapped
                .iter()
                .map(|(q, _)| *q)
                .find(|q| layout.column(*q).name == name)
            {
                return Err(item.absurd(ValueFault::ColumnTwice {
                    column: name,
                    other: quantity.key(),
                }));
            }
            layout.ignored.push(name);
        }
    }
    Ok(layout)
}

fn named(value: &Value<'_>) -> Result<String, StageError> {
    let name = value.text()?.trim();
    if name.is_empty() {
        return Err(value.absurd(ValueFault::NoName));
    }
    Ok(name.to_owned())
}

fn column(value: &Value<'_>, quantity: Quantity) -> Result<Column, StageError> {
    let kind = quantity.kind();
    if !value.is_table() {
        let name = named(value)?;
        let scale = match kind {
            Kind::Index | Kind::Code => 1.0,
            _ => kind
                .unit_of_name(&name)
                .ok_or_else(|| no_unit(value, kind, &name))?,
        };
        return Ok(Column { name, scale });
    }
    let table = value.table()?;
    table.only(&["column", "unit", "scale"])?;
    let name = named(&table.require("column", "the name in the log's header")?)?;
    let (unit, scale) = (table.get("unit"), table.get("scale"));
    let what = match kind {
        Kind::Index => Some("movement numbers"),
        Kind::Code => Some("codes"),
        _ => None,
    };
    if let (Some(what), Some(given)) = (what, unit.as_ref().or(scale.as_ref())) {
        return Err(given.absurd(ValueFault::NoScaleHere { what }));
    }
    let scale = match (unit, scale) {
        (Some(_), Some(scale)) => return Err(scale.absurd(ValueFault::UnitAndScale)),
        (Some(unit), None) => {
            let symbol = unit.text()?;
            kind.unit(symbol).ok_or_else(|| {
                unit.absurd(ValueFault::UnknownUnit {
                    unit: symbol.to_owned(),
                    known: kind.units(),
                })
            })?
        }
        (None, Some(scale)) => {
            let number = scale.number()?;
            let (low, high) = SCALE_MAGNITUDES;
            scale.within(number.abs(), low, high, kind.scale_unit())?;
            number * kind.per_si()
        }
        (None, None) if what.is_some() => 1.0,
        (None, None) => kind
            .unit_of_name(&name)
            .ok_or_else(|| no_unit(value, kind, &name))?,
    };
    Ok(Column { name, scale })
}

fn no_unit(value: &Value<'_>, kind: Kind, name: &str) -> StageError {
    value.absurd(ValueFault::NoUnit {
        column: name.to_owned(),
        known: kind.units(),
    })
}
