//! The axes of charts: linear, or logarithmic with marks at 1, 2 and 5 of each decade where there are few.

use plotters::coord::ranged1d::{KeyPointHint, NoDefaultFormatting, Ranged, ValueFormatter};
use plotters::coord::types::RangedCoordf64;
use std::ops::Range;

/// Decades up to which 2 and 5 are marked too.
const DECADES_MARKED: f64 = 2.5;

/// An axis between two ends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Axis {
    /// Ends as they are.
    Linear(f64, f64),
    /// Both ends above zero.
    Logarithmic(f64, f64),
}

impl Axis {
    /// The ends.
    pub(super) const fn ends(self) -> (f64, f64) {
        let (Self::Linear(low, high) | Self::Logarithmic(low, high)) = self;
        (low, high)
    }

    fn linear(self) -> RangedCoordf64 {
        let (low, high) = self.ends();
        match self {
            Self::Linear(..) => (low..high).into(),
            Self::Logarithmic(..) => (low.log10()..high.log10()).into(),
        }
    }
}

impl Ranged for Axis {
    type FormatOption = NoDefaultFormatting;
    type ValueType = f64;

    fn map(&self, value: &f64, limit: (i32, i32)) -> i32 {
        match self {
            Self::Linear(..) => self.linear().map(value, limit),
            Self::Logarithmic(low, _) => self.linear().map(&value.max(*low).log10(), limit),
        }
    }

    fn key_points<Hint: KeyPointHint>(&self, hint: Hint) -> Vec<f64> {
        let Self::Logarithmic(low, high) = *self else {
            return self.linear().key_points(hint);
        };
        let decades = high.log10() - low.log10();
        let digits: &[f64] = match decades {
            _ if decades <= 1.0 => &[1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0],
            _ if decades <= DECADES_MARKED => &[1.0, 2.0, 5.0],
            _ => &[1.0],
        };
        let powers = low.log10().floor() as i32..=high.log10().ceil() as i32;
        powers
            .flat_map(|power| digits.iter().map(move |digit| digit * 10f64.powi(power)))
            .filter(|mark| (low..=high).contains(mark))
            .collect()
    }

    fn range(&self) -> Range<f64> {
        let (low, high) = self.ends();
        low..high
    }
}

impl ValueFormatter<f64> for Axis {
    /// A number in few digits.
    fn format(x: &f64) -> String {
        let size = x.abs();
        let digits = match size {
            _ if size >= 100.0 => 0,
            _ if size >= 1.0 => 1,
            _ if size >= 0.01 => 3,
            _ if size < 1e-9 => return "0".to_owned(),
            _ => return format!("{x:.0e}"),
        };
        let text = format!("{x:.digits$}");
        if text.contains('.') {
            text.trim_end_matches('0').trim_end_matches('.').to_owned()
        } else {
            text
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use plotters::coord::ranged1d::BoldPoints;

    #[test]
    fn a_logarithmic_axis_has_marks_within_its_ends_and_maps_decades_evenly() {
        let axis = Axis::Logarithmic(0.3, 30.0);
        let marks = axis.key_points(BoldPoints(9));
        assert_eq!(marks, [0.5, 1.0, 2.0, 5.0, 10.0, 20.0]);
        assert_eq!(
            [0.3, 3.0, 30.0].map(|x| axis.map(&x, (0, 100))),
            [0, 50, 100]
        );
        let short = Axis::Logarithmic(0.049, 0.11).key_points(BoldPoints(9));
        assert_eq!(short, [0.05, 0.06, 0.08, 0.1]);
        // What lies below it, such as a zero, stands at its end.
        assert_eq!(axis.map(&0.0, (0, 100)), 0);
        assert_eq!(
            Axis::Logarithmic(0.1, 1e4).key_points(BoldPoints(9)).len(),
            6
        );
    }

    #[test]
    fn numbers_at_an_axis_are_short() {
        let numbers = [0.0, -500.0, 2.5, 0.05, 1e-4, 20.0].map(|x| Axis::format(&x));
        assert_eq!(numbers, ["0", "-500", "2.5", "0.05", "1e-4", "20"]);
    }
}
