//! Keeps a search away from the poles of 1/phi.
//!
//! The boxes of Table 5 are wide: phi = eta + a Z + b Rx + c Ry passes through zero inside them
//! (|b| near 1,740 /rad at a tilt of 500 urad), and beyond a pole a probe would read backwards
//! at one end of the log. Such parameters are worthless, and each pole parts the box into
//! basins where a search gets stuck. So the forms `delta` and `linear` keep to
//! the side where the stage is: every row must have phi / eta above [`SHARE_MIN`], else the cost
//! is NaN; and the range of each slope is cut where it alone would break that rule. The form
//! `none` is the paper's and has neither.

use crate::estimator::rows::FieldRow;
use hallstage_input::stage::Range;

/// Smallest phi / eta of any row: at a twentieth, noise is already twenty times larger.
pub const SHARE_MIN: f64 = 0.05;

/// Lowest and highest Z, Rx, Ry over some rows, zero included: m, rad, rad.
pub fn slope_extent(rows: &[FieldRow]) -> [Range; 3] {
    [0, 1, 2].map(|k| Range::around(rows.iter().map(|row| row.vertical[k]).chain([0.0])))
}

/// The part of `slopes` (a, b or c) where `eta` + slope v is above [`SHARE_MIN`] times eta over the extent, with the
/// other slopes zero. A range without such a part is returned unchanged.
pub fn cut(slopes: Range, eta: f64, extent: Range) -> Range {
    // eta (1 - SHARE_MIN) + slope v > 0 at both ends of the extent.
    let room = (1.0 - SHARE_MIN) * eta.abs();
    // An extent that ends at zero (all rows on one side) bounds nothing on that side.
    let end = |v: f64| (v != 0.0).then(|| -room / v);
    let low = end(extent.high).map_or(slopes.low, |end| slopes.low.max(end));
    let high = end(extent.low).map_or(slopes.high, |end| slopes.high.min(end));
    if low < high {
        Range { low, high }
    } else {
        slopes
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn range(low: f64, high: f64) -> Range {
        Range { low, high }
    }

    #[test]
    fn slopes_are_cut_where_the_share_would_be_a_twentieth() {
        let both = range(-5000.0, 5000.0);
        // 0.8 - 0.95 * 0.8 at either end: 0.76 / 250 um, 0.76 / 500 um.
        let cut_both = cut(both, 0.8, range(-5e-4, 2.5e-4));
        assert!((cut_both.low + 3040.0).abs() < 1e-9 && (cut_both.high - 1520.0).abs() < 1e-9);
        assert_eq!(
            cut(range(-10.0, 20.0), 0.8, range(-5e-4, 2.5e-4)),
            range(-10.0, 20.0)
        );
    }

    #[test]
    fn a_log_on_one_side_of_zero_cuts_one_side_of_the_slopes() {
        let both = range(-5000.0, 5000.0);
        let above = cut(both, 0.8, range(0.0, 2.5e-4));
        assert!((above.low + 3040.0).abs() < 1e-9 && above.high == 5000.0);
        let below = cut(both, 0.8, range(-2.5e-4, 0.0));
        assert!(below.low == -5000.0 && (below.high - 3040.0).abs() < 1e-9);
        assert_eq!(cut(both, 0.8, range(0.0, 0.0)), both);
    }
}
