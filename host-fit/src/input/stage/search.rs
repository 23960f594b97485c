//! The table `[search]`: the ranges in which a fit may search.

use super::document::{Document, List};
use super::error::StageError;
use super::file::COORDINATE_MAX_M;
use super::{Range, SearchRanges};
use runtime::geometry::ProbeCoordinates;
use toml::Spanned;

/// Largest sensible sensitivity: a probe that reads 100 times its designed scale is another probe.
const ETA_MAX: f64 = 100.0;
/// Largest sensible misalignment: short of lying along the other axis.
const THETA_MAX_DEG: f64 = 80.0;
/// Largest sensible change of sensitivity per m or rad.
const SLOPE_MAX: f64 = 1e7;
/// Largest sensible zero deviation, m.
const DELTA_MAX_M: f64 = 0.01;
/// One degree, rad.
const DEGREE: f64 = core::f64::consts::PI / 180.0;

/// How `[search]` writes the ranges of one term of a model for the probes A, B, C.
#[derive(Clone, Copy)]
enum Shape {
    /// Three keys, one for each probe.
    Keys([&'static str; 3]),
    /// One range for all three, which must hold zero.
    Shared,
    /// A list of three ranges.
    List,
}

/// The terms that have ranges: key, shape, largest sensible magnitude, its unit in the file,
/// and that unit in SI units. A model with another term adds its line here.
const TERMS: [(&str, Shape, f64, &str, f64); 5] = [
    (
        "eta",
        Shape::Keys(["eta_a", "eta_b", "eta_c"]),
        ETA_MAX,
        "",
        1.0,
    ),
    ("theta_deg", Shape::Shared, THETA_MAX_DEG, "degrees", DEGREE),
    ("a_per_m", Shape::List, SLOPE_MAX, "1/m", 1.0),
    ("b_per_rad", Shape::List, SLOPE_MAX, "1/rad", 1.0),
    ("c_per_rad", Shape::List, SLOPE_MAX, "1/rad", 1.0),
];

/// [low, high] as it stands in the file.
type Ends = List<Spanned<f64>>;

/// The ranges of the table, which must hold the designed coordinates.
pub(super) fn ranges(
    document: &Document<'_>,
    designed: &ProbeCoordinates<f64>,
) -> Result<SearchRanges, StageError> {
    let mut known = vec![
        "h1x_m", "h1y_m", "h2x_m", "h2y_m", "h3x_m", "h3y_m", "delta_m",
    ];
    for (key, shape, ..) in &TERMS {
        match shape {
            Shape::Keys(keys) => known.extend(keys),
            Shape::Shared | Shape::List => known.push(key),
        }
    }
    document.only("search", &known)?;
    let one = |name, most, unit, designed| {
        range(
            document,
            &document.require("search", name)?,
            most,
            unit,
            designed,
        )
    };
    let h = |name, designed| one(name, COORDINATE_MAX_M, "m", Some(designed));
    let h_m = ProbeCoordinates {
        h1x_m: h("h1x_m", designed.h1x_m)?,
        h1y_m: h("h1y_m", designed.h1y_m)?,
        h2x_m: h("h2x_m", designed.h2x_m)?,
        h2y_m: h("h2y_m", designed.h2y_m)?,
        h3x_m: h("h3x_m", designed.h3x_m)?,
        h3y_m: h("h3y_m", designed.h3y_m)?,
    };
    let mut ranges = SearchRanges::new(h_m, one("delta_m", DELTA_MAX_M, "m", None)?);
    for (key, shape, most, unit, si) in TERMS {
        let of_probes = match shape {
            Shape::Keys(keys) => keys.map(|name| one(name, most, unit, None)),
            Shape::Shared => [0; 3].map(|_| one(key, most, unit, Some(0.0))),
            Shape::List => {
                let list: List<Ends> = document.require("search", key)?;
                let list: &[_; 3] = document.exactly(&list)?;
                list.each_ref()
                    .map(|ends| range(document, ends, most, unit, None))
            }
        };
        let [a, b, c] = of_probes;
        let in_si = |range: Range| Range {
            low: range.low * si,
            high: range.high * si,
        };
        ranges.set(key, [a?, b?, c?].map(in_si));
    }
    Ok(ranges)
}

/// The range, if its ends are in order and at most `most` in magnitude, and it holds the
/// designed value.
fn range(
    document: &Document<'_>,
    ends: &Ends,
    most: f64,
    unit: &'static str,
    designed: Option<f64>,
) -> Result<Range, StageError> {
    let [low, high] = document.exactly(ends)?;
    let low = document.within(low, -most, most, unit)?;
    let high = document.within(high, -most, most, unit)?;
    let refused = |problem| Err(document.refuse(ends.span(), problem));
    if low > high {
        let problem = format!("the range [{low}, {high}] is reversed; write the lower end first");
        return refused(problem);
    }
    let range = Range { low, high };
    match designed {
        Some(designed) if !range.contains(designed) => refused(format!(
            "the range [{low}, {high}] excludes the designed value {designed}; widen the range or \
             correct the designed value"
        )),
        _ => Ok(range),
    }
}
