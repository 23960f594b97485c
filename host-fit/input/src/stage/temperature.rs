//! Reads the optional table `[temperature]`: the columns of a log that hold the temperatures of the
//! magnets' mount and of the stage body at the Hall elements, and what is known beforehand of the
//! coefficients k and h (see [`runtime::temperature`]).
//!
//! ```toml
//! [temperature]
//! mount = "mount_mc"
//! body = "body_mc"
//! unit = "mC"              # C, mC or K; or c_per_count and c_at_zero for codes
//! magnet = "NdFeB"         # NdFeB or SmCo, or k_per_k = [-1.2e-3, 3e-4]: mean, deviation
//! hall = "uncompensated"   # uncompensated, compensated or GaAs, or h_per_k = [0.0, 2e-4]
//! ```

use super::document::Document;
use super::error::StageError;

/// What the table says.
#[derive(Clone, Debug, PartialEq)]
pub struct TemperatureTable {
    /// Columns of mount and body.
    pub columns: [Option<String>; 2],
    /// m degC per unit of the columns, and m degC at zero.
    pub scale_mc: [f64; 2],
    /// k and h before a log is seen: mean and standard deviation, 1/K.
    pub prior_per_k: [[f64; 2]; 2],
}

impl Default for TemperatureTable {
    fn default() -> Self {
        Self {
            columns: [None, None],
            scale_mc: UNITS[0].1,
            prior_per_k: [MAGNETS[0].1, HALL_PARTS[0].1],
        }
    }
}

/// m degC per unit, and at zero.
const UNITS: [(&str, [f64; 2]); 3] = [
    ("C", [1e3, 0.0]),
    ("mC", [1.0, 0.0]),
    ("K", [1e3, -273_150.0]),
];
/// k: remanence, less what the gap grows, 1/K.
const MAGNETS: [(&str, [f64; 2]); 2] = [("NdFeB", [-1.2e-3, 3e-4]), ("SmCo", [-4e-4, 1e-4])];
/// h, 1/K. A compensated part gains what NdFeB loses.
const HALL_PARTS: [(&str, [f64; 2]); 3] = [
    ("uncompensated", [0.0, 2e-4]),
    ("compensated", [1.2e-3, 2e-4]),
    ("GaAs", [-6e-4, 2e-4]),
];
/// Coefficients that make sense, 1/K.
const COEFFICIENT_MAX: f64 = 0.01;

/// The table, or its defaults where it is missing.
pub(super) fn temperature(document: &Document<'_>) -> Result<TemperatureTable, StageError> {
    const TABLE: &str = "temperature";
    let mut out = TemperatureTable {
        columns: ["mount", "body"].map(|key| Some(document.get(TABLE, key)?.as_text()?.to_owned())),
        ..TemperatureTable::default()
    };
    let twice = |one: &str, other: &str| {
        let problem = format!("`{one}` and `{other}` are both given; keep one of them");
        Err(document.refuse(&document.require(TABLE, other)?, problem))
    };
    let unit = named(document, "unit", &UNITS)?;
    out.scale_mc = unit.unwrap_or(out.scale_mc);
    let per_count = document.number(TABLE, "c_per_count", (-10.0, 10.0), "degC per code")?;
    let at_zero = document.number(TABLE, "c_at_zero", (-300.0, 300.0), "degC")?;
    match (per_count, at_zero) {
        (None, None) => {}
        (Some(_), _) if unit.is_some() => return twice("unit", "c_per_count"),
        (Some(per_count), at_zero) if per_count != 0.0 => {
            out.scale_mc = [per_count * 1e3, at_zero.unwrap_or(0.0) * 1e3];
        }
        (per_count, _) => {
            let key = per_count.map_or("c_at_zero", |_| "c_per_count");
            let problem = "codes need `c_per_count`, in degC per code and not 0";
            return Err(document.refuse(&document.require(TABLE, key)?, problem));
        }
    }
    let classes: [(_, &[_], _); 2] = [
        ("magnet", &MAGNETS, "k_per_k"),
        ("hall", &HALL_PARTS, "h_per_k"),
    ];
    for (prior, (class, known, numbers)) in out.prior_per_k.iter_mut().zip(classes) {
        let by_class = named(document, class, known)?;
        *prior = by_class.unwrap_or(*prior);
        if let Some(list) = document.get(TABLE, numbers) {
            if by_class.is_some() {
                return twice(class, numbers);
            }
            for (k, (out, number)) in prior.iter_mut().zip(list.items()).enumerate() {
                let least = [-COEFFICIENT_MAX, 1e-9][k];
                *out = document.within(&number, (least, COEFFICIENT_MAX), "1/K")?;
            }
        }
    }
    Ok(out)
}

/// What such a name stands for.
fn named(
    document: &Document<'_>,
    key: &str,
    known: &[(&str, [f64; 2])],
) -> Result<Option<[f64; 2]>, StageError> {
    let Some(value) = document.get("temperature", key) else {
        return Ok(None);
    };
    let name = value.as_text().unwrap_or_default();
    if let Some((_, numbers)) = known.iter().find(|(known, _)| *known == name) {
        return Ok(Some(*numbers));
    }
    let names: Vec<&str> = known.iter().map(|(name, _)| *name).collect();
    let problem = format!("\"{name}\" is not known; use one of {}", names.join(", "));
    Err(document.refuse(&value, problem))
}
