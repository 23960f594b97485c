//! The table `[search]`: the search ranges, which also bound the expected parameters of a fit.
//! Every key is optional: the defaults follow from the design.

use super::document::{Document, Value};
use super::error::StageError;
use super::file::COORDINATE_MAX_M;
use super::{Input, Probe, Range, SearchRanges, Uncertainty, paper_signs};

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

/// How far a probe may stand from its designed place along X and Y, m.
const PLACE_M: f64 = 0.1;
/// Usual misalignment at most.
const THETA_DEG: f64 = 8.0;
/// Usual change of a sensitivity with height, 1/m: the field falls as the gap grows.
const FALL_PER_M: Range = Range::new(-5000.0, 0.0);
/// Usual zero deviation at most, m.
const DELTA_M: f64 = 1e-4;

/// The ranges of the table, which must hold the designed coordinates. A key that it leaves out has
/// its default.
pub(super) fn ranges(
    document: &Document<'_>,
    designed: &[Probe; 3],
    uncertainty: &Uncertainty,
) -> Result<SearchRanges, StageError> {
    let one = |name, most, unit, designed, default| -> Result<Range, StageError> {
        let ends = document.get("search", name);
        ends.map_or(Ok(default), |ends| {
            range(document, &ends, most, unit, designed)
        })
    };
    let h = |name, at| one(name, COORDINATE_MAX_M, "m", Some(at), about(at, PLACE_M));
    let [h1, h2, h3] = paper_signs(designed.map(|probe| probe.place_m));
    let h_m = [
        [h("h1x_m", h1[0])?, h("h1y_m", h1[1])?],
        [h("h2x_m", h2[0])?, h("h2y_m", h2[1])?],
        [h("h3x_m", h3[0])?, h("h3y_m", h3[1])?],
    ];
    let delta_m = one("delta_m", DELTA_MAX_M, "m", None, about(0.0, DELTA_M))?;
    let mut ranges = SearchRanges::new(paper_signs(h_m), delta_m);
    let usual = about(1.0, 2.0 * uncertainty.known(Input::Sensitivity));
    let eta = |name| one(name, ETA_MAX, "", None, usual);
    ranges.set("eta", [eta("eta_a")?, eta("eta_b")?, eta("eta_c")?]);
    let default = about(0.0, THETA_DEG);
    let theta = one("theta_deg", THETA_MAX_DEG, "degrees", Some(0.0), default)?;
    let theta = Range::new(theta.low * DEGREE, theta.high * DEGREE);
    ranges.set("theta_deg", [theta; 3]);
    let three = |key, unit, default: [Range; 3]| -> Result<[Range; 3], StageError> {
        let mut ranges = default;
        let list = document.get("search", key);
        let list = list.iter().flat_map(Value::items);
        for (out, ends) in ranges.iter_mut().zip(list) {
            *out = range(document, &ends, SLOPE_MAX, unit, None)?;
        }
        Ok(ranges)
    };
    let a = three("a_per_m", "1/m", [FALL_PER_M; 3])?;
    ranges.set("a_per_m", a);
    // phi follows the height at the probe: b = a y, c = -a x.
    let by =
        |at: fn(&Probe) -> f64| [0, 1, 2].map(|k| product(a[k], about(at(&designed[k]), PLACE_M)));
    let b = three("b_per_rad", "1/rad", by(|probe| probe.place_m[1]))?;
    let c = three("c_per_rad", "1/rad", by(|probe| -probe.place_m[0]))?;
    ranges.set("b_per_rad", b);
    ranges.set("c_per_rad", c);
    Ok(ranges)
}

/// The range of `room` to both sides of a value.
const fn about(value: f64, room: f64) -> Range {
    Range::new(value - room, value + room)
}

/// The range of the products of two ranges.
fn product(a: Range, b: Range) -> Range {
    let ends = [
        a.low * b.low,
        a.low * b.high,
        a.high * b.low,
        a.high * b.high,
    ];
    Range::around(ends)
}

/// The range, if its ends are in order and at most `most` in magnitude, and it holds the
/// designed value.
fn range(
    document: &Document<'_>,
    ends: &Value<'_>,
    most: f64,
    unit: &'static str,
    designed: Option<f64>,
) -> Result<Range, StageError> {
    let mut both = [0.0; 2];
    for (out, end) in both.iter_mut().zip(ends.items()) {
        *out = document.within(&end, (-most, most), unit)?;
    }
    let [low, high] = both;
    let refused = |problem| Err(document.refuse(ends, problem));
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
