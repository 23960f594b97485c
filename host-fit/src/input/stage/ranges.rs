//! Reads the table `[search]`: the ranges in which a fit may search.

use super::error::{StageError, ValueFault};
use super::file::COORDINATE_MAX_M;
use super::value::{Table, Value};
use super::{Range, SearchRanges};
use runtime::geometry::ProbeCoordinates;

/// Largest sensible sensitivity: a probe that reads 100 times its designed scale is another probe.
const ETA_MAX: f64 = 100.0;
/// Largest sensible misalignment: short of lying along the other axis.
const THETA_MAX_DEG: f64 = 80.0;
/// Largest sensible change of sensitivity per m or rad.
const SLOPE_MAX: f64 = 1e7;
/// Largest sensible zero deviation, m.
const DELTA_MAX_M: f64 = 0.01;

/// A range [low, high] whose ends are at most `most` in magnitude.
fn range(value: &Value<'_>, most: f64, unit: &'static str) -> Result<Range, StageError> {
    let [first, second] = value.items::<2>("a range [low, high]")?;
    let end = |v: &Value<'_>| v.within(v.number()?, -most, most, unit);
    let (low, high) = (end(&first)?, end(&second)?);
    if low > high {
        return Err(value.absurd(ValueFault::Reversed { low, high }));
    }
    Ok(Range { low, high })
}

/// Refuses a range without `designed`.
fn holding(value: &Value<'_>, range: Range, designed: f64) -> Result<Range, StageError> {
    if range.contains(designed) {
        Ok(range)
    } else {
        Err(value.absurd(ValueFault::ExcludesDesigned {
            low: range.low,
            high: range.high,
            designed,
        }))
    }
}

/// The ranges of the table `[search]`, which must hold the designed coordinates and theta = 0.
pub(super) fn search_ranges(
    search: &Table<'_>,
    designed: &ProbeCoordinates<f64>,
) -> Result<SearchRanges, StageError> {
    search.only(&[
        "h1x_m",
        "h1y_m",
        "h2x_m",
        "h2y_m",
        "h3x_m",
        "h3y_m",
        "eta_a",
        "eta_b",
        "eta_c",
        "theta_deg",
        "a_per_m",
        "b_per_rad",
        "c_per_rad",
        "delta_m",
    ])?;
    let h = |key, designed| {
        let value = search.require(key, "range [low, high] of the coordinate, m")?;
        holding(&value, range(&value, COORDINATE_MAX_M, "m")?, designed)
    };
    let single = |key, most, unit| range(&search.require(key, "range [low, high]")?, most, unit);
    let three = |key, unit| -> Result<[Range; 3], StageError> {
        let value = search.require(key, "three ranges [[low, high], ...] for A, B, C")?;
        let [a, b, c] = value.items::<3>("a list of three ranges [low, high]")?;
        let one = |v| range(v, SLOPE_MAX, unit);
        Ok([one(&a)?, one(&b)?, one(&c)?])
    };
    let theta = search.require(
        "theta_deg",
        "range [low, high] of the misalignment, degrees",
    )?;
    let theta_deg = holding(&theta, range(&theta, THETA_MAX_DEG, "degrees")?, 0.0)?;
    Ok(SearchRanges {
        h_m: ProbeCoordinates {
            h1x_m: h("h1x_m", designed.h1x_m)?,
            h1y_m: h("h1y_m", designed.h1y_m)?,
            h2x_m: h("h2x_m", designed.h2x_m)?,
            h2y_m: h("h2y_m", designed.h2y_m)?,
            h3x_m: h("h3x_m", designed.h3x_m)?,
            h3y_m: h("h3y_m", designed.h3y_m)?,
        },
        eta: [
            single("eta_a", ETA_MAX, "")?,
            single("eta_b", ETA_MAX, "")?,
            single("eta_c", ETA_MAX, "")?,
        ],
        theta_rad: Range {
            low: theta_deg.low.to_radians(),
            high: theta_deg.high.to_radians(),
        },
        a_per_m: three("a_per_m", "1/m")?,
        b_per_rad: three("b_per_rad", "1/rad")?,
        c_per_rad: three("c_per_rad", "1/rad")?,
        delta_m: single("delta_m", DELTA_MAX_M, "m")?,
    })
}
