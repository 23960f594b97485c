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

use super::document::Document;
use super::error::StageError;
use crate::log::layout::{Column, LogLayout, Quantity, UnitFault};
use crate::log::units;
use std::ops::Range;
use toml::Spanned;

/// Smallest and largest magnitude of a scale given by the user, in SI units per unit.
const SCALE_MAGNITUDES: (f64, f64) = (1e-15, 1e9);

/// Voltages of one code that make sense, V: a converter of 24 bits over 0.1 V, one of 8 bits over
/// 1 kV.
const VOLTS_PER_COUNT: (f64, f64) = (1e-9, 10.0);

/// The layout that the table describes; quantities that it leaves out keep their default, as all
/// do without the table.
pub(super) fn log_layout(document: &Document<'_>) -> Result<LogLayout, StageError> {
    let volts = |table| document.number(table, "volts_per_count", VOLTS_PER_COUNT, "V per code");
    let mut layout = LogLayout::default();
    layout.hall_volts_per_count = volts("hall")?;
    layout.capacitive_volts_per_count = volts("capacitive")?;
    let mut mapped: Vec<(Quantity, Range<usize>)> = Vec::new();
    for quantity in Quantity::ALL {
        if let Some((span, column)) = column(document, &layout, quantity)? {
            layout.set(quantity, column);
            mapped.push((quantity, span));
        }
    }
    let twice = |span: &Range<usize>, column: &str, other: Quantity| {
        let other = other.key();
        let problem = format!(
            "the column \"{column}\" is named twice (also by `{other}`); give each column one use"
        );
        document.refuse(span.clone(), problem)
    };
    // Two keys for one column: at least one of them was mapped here, the other may be a default.
    for (quantity, span) in &mapped {
        let name = &layout.column(*quantity).name;
        let mut others = Quantity::ALL.into_iter().filter(|other| other != quantity);
        if let Some(other) = others.find(|other| layout.column(*other).name == *name) {
            return Err(twice(span, name, other));
        }
    }
    let ignored: Vec<Spanned<String>> = document.read("log", "ignore")?.unwrap_or_default();
    for item in &ignored {
        let name = named(document, item)?;
        let used = mapped.iter().find(|(q, _)| layout.column(*q).name == name);
        if let Some((quantity, _)) = used {
            return Err(twice(&item.span(), &name, *quantity));
        }
        layout.ignored.push(name);
    }
    for key in ["mount", "body"] {
        layout.ignored.extend(document.read("temperature", key)?);
    }
    Ok(layout)
}

fn named(document: &Document<'_>, name: &Spanned<String>) -> Result<String, StageError> {
    match name.get_ref().trim() {
        "" => Err(document.refuse(
            name.span(),
            "the column name is empty; give the name that stands in the log's header",
        )),
        name => Ok(name.to_owned()),
    }
}

/// The column that the table names for a quantity, if it does, and where the name stands.
fn column(
    document: &Document<'_>,
    layout: &LogLayout,
    quantity: Quantity,
) -> Result<Option<(Range<usize>, Column)>, StageError> {
    let (key, kind) = (quantity.key(), quantity.kind());
    let table = format!("log.{key}");
    let (column, unit, scale): (_, Option<Spanned<String>>, Option<Spanned<f64>>) =
        if document.is_text("log", key)? {
            (document.require("log", key)?, None, None)
        } else if document.span("log", key).is_empty() {
            return Ok(None);
        } else {
            (
                document.require(&table, "column")?,
                document.read(&table, "unit")?,
                document.read(&table, "scale")?,
            )
        };
    let name = named(document, &column)?;
    let known = kind.units();
    let si = kind.si();
    let of_unit = |symbol: &str, span| {
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
        scale.map_err(|fault| document.refuse(span, problem(fault)))
    };
    let scale = match (unit, scale) {
        (Some(_), Some(scale)) => {
            let problem = "`unit` and `scale` are both given; keep one of them";
            return Err(document.refuse(scale.span(), problem));
        }
        (None, Some(scale)) => {
            let Some((unit, per_si)) = si else {
                let problem = "this column holds numbers without a unit; give only its name";
                return Err(document.refuse(scale.span(), problem));
            };
            let (low, high) = SCALE_MAGNITUDES;
            let magnitude = Spanned::new(scale.span(), scale.get_ref().abs());
            document.within(&magnitude, low, high, unit)?;
            scale.into_inner() * per_si
        }
        (Some(unit), None) => of_unit(unit.get_ref(), unit.span())?,
        (None, None) if kind.unit_in_name(&name).is_some() => {
            of_unit(units::split(&name).1.unwrap_or(&name), column.span())?
        }
        (None, None) if si.is_some() => {
            let example = format!("{{ column = \"{name}\", unit = \"...\" }}");
            let problem = format!("its unit is unknown; write {example} with one of {known}");
            return Err(document.refuse(column.span(), problem));
        }
        (None, None) => 1.0,
    };
    Ok(Some((column.span(), Column { name, scale })))
}
