//! Reads the optional table `[log]`: the column and the unit of each quantity.
//!
//! Each key is a quantity of [`Quantity`]; its value is the column's name, or a table:
//!
//! ```toml
//! [log]
//! movement = "run"
//! hall_b = "ADC 2"
//! ifm_x = "stage_x_um"                             # the unit is read from the name
//! ifm_y1 = { column = "Y left", unit = "um" }
//! ifm_y2 = { column = "Y right", scale = -6.25e-10 }  # m per unit of the column
//! hall_a = { column = "ADC 1", unit = "V" }         # with `volts_per_count` in [hall]
//! ignore = ["temperature", "operator"]             # columns to leave out
//! ```

use super::document::{Document, Value};
use super::error::StageError;
use crate::log::layout::{Column, LogLayout, Quantity, UnitFault};
use crate::log::units;

/// Smallest and largest magnitude of a scale given by the user, in SI units per unit.
const SCALE_MAGNITUDES: (f64, f64) = (1e-15, 1e9);

/// Voltages of one code that make sense, V: a converter of 24 bits over 0.1 V, one of 8 bits over
/// 1 kV.
const VOLTS_PER_COUNT: (f64, f64) = (1e-9, 10.0);

/// The layout that the table describes; quantities that it leaves out keep their default, as all
/// do without the table.
pub(super) fn log_layout(
    document: &Document<'_>,
    servo_period_s: f64,
) -> Result<LogLayout, StageError> {
    let volts = |table| document.number(table, "volts_per_count", VOLTS_PER_COUNT, "V per code");
    let mut layout = LogLayout::default();
    layout.row_us = servo_period_s * 1e6;
    layout.hall_volts_per_count = volts("hall")?;
    layout.capacitive_volts_per_count = volts("capacitive")?;
    let mut mapped: Vec<(Quantity, Value<'_>)> = Vec::new();
    for quantity in Quantity::ALL {
        if let Some((value, column)) = column(document, &layout, quantity)? {
            layout.set(quantity, column);
            mapped.push((quantity, value));
        }
    }
    let twice = |value: &Value<'_>, column: &str, other: Quantity| {
        let other = other.key();
        let problem = format!(
            "the column \"{column}\" is named twice (also by `{other}`); give each column one use"
        );
        document.refuse(value, problem)
    };
    // Two keys for one column: at least one of them was mapped here, the other may be a default.
    for (quantity, value) in &mapped {
        let name = &layout.column(*quantity).name;
        let mut others = Quantity::ALL.into_iter().filter(|other| other != quantity);
        if let Some(other) = others.find(|other| layout.column(*other).name == *name) {
            return Err(twice(value, name, other));
        }
    }
    let ignored = document.get("log", "ignore");
    for item in ignored.iter().flat_map(Value::items) {
        let name = named(document, &item)?;
        let used = mapped.iter().find(|(q, _)| layout.column(*q).name == name);
        if let Some((quantity, _)) = used {
            return Err(twice(&item, &name, *quantity));
        }
        layout.ignored.push(name);
    }
    for key in ["mount", "body"] {
        let column = document.get("temperature", key);
        let name = column.and_then(|column| Some(column.as_text()?.to_owned()));
        layout.ignored.extend(name);
    }
    Ok(layout)
}

fn named(document: &Document<'_>, name: &Value<'_>) -> Result<String, StageError> {
    match name.as_text().unwrap_or_default().trim() {
        "" => Err(document.refuse(
            name,
            "the column name is empty; give the name that stands in the log's header",
        )),
        name => Ok(name.to_owned()),
    }
}

/// The column that the table names for a quantity, if it does, and where the name stands.
fn column<'d>(
    document: &'d Document<'_>,
    layout: &LogLayout,
    quantity: Quantity,
) -> Result<Option<(Value<'d>, Column)>, StageError> {
    let (key, kind) = (quantity.key(), quantity.dimension());
    let table = format!("log.{key}");
    let column = match document.get("log", key) {
        None => return Ok(None),
        Some(name) if name.as_text().is_some() => name,
        Some(_) => document.require(&table, "column")?,
    };
    let unit = document.get(&table, "unit");
    let scale = document.get(&table, "scale");
    let name = named(document, &column)?;
    let known = kind.units();
    let si = kind.si();
    let scale_of_unit = |symbol: &str, value: &Value<'_>| {
        let problem = |fault| match fault {
            UnitFault::NoVoltsPerCount => format!(
                "the column is a voltage; give the converter's `volts_per_count` (V) in [{}]",
                quantity.table()
            ),
            UnitFault::Unknown if si.is_some() => {
                format!("unknown unit; use one of {known}, or give `scale`")
            }
            UnitFault::Unknown => {
                format!("this column holds numbers without a unit, or one of {known}; correct it")
            }
        };
        let scale = layout.scale(quantity, symbol);
        scale.map_err(|fault| document.refuse(value, problem(fault)))
    };
    let scale = match (unit, scale) {
        (Some(_), Some(scale)) => {
            let problem = "`unit` and `scale` are both given; keep one of them";
            return Err(document.refuse(&scale, problem));
        }
        (None, Some(scale)) => {
            let Some((unit, per_si)) = si else {
                let problem = "this column holds numbers without a unit; give only its name";
                return Err(document.refuse(&scale, problem));
            };
            let (low, high) = SCALE_MAGNITUDES;
            let given = document.within(&scale, (-high, high), unit)?;
            if given.abs() < low {
                let problem =
                    format!("{given} {unit} is outside {low:e} to {high:e} {unit}; check it");
                return Err(document.refuse(&scale, problem));
            }
            given * per_si
        }
        (Some(unit), None) => scale_of_unit(unit.as_text().unwrap_or_default(), &unit)?,
        (None, None) if kind.unit_in_name(&name).is_some() => {
            scale_of_unit(units::split(&name).1.unwrap_or(&name), &column)?
        }
        (None, None) if si.is_some() => {
            let example = format!("{{ column = \"{name}\", unit = \"...\" }}");
            let problem = format!("its unit is unknown; write {example} with one of {known}");
            return Err(document.refuse(&column, problem));
        }
        (None, None) => 1.0,
    };
    Ok(Some((column, Column { name, scale })))
}
