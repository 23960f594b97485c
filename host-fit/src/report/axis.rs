//! The axes of charts.

use super::text::trimmed;

/// An axis between two ends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Axis(pub f64, pub f64);

impl Axis {
    /// Where a value stands: 0 at the first end, 1 at the last.
    pub(super) fn place(self, value: f64) -> f64 {
        (value - self.0) / (self.1 - self.0)
    }

    /// The values that are marked: about `count`, at round numbers.
    pub(super) fn marks(self, count: f64) -> Vec<f64> {
        let Self(low, high) = self;
        if high <= low {
            return Vec::new();
        }
        let least = (high - low) / count;
        let power = 10f64.powf(least.log10().floor());
        let steps = [1.0, 2.0, 5.0, 10.0].map(|digit| digit * power);
        let step = steps.into_iter().find(|step| *step >= least);
        let step = step.unwrap_or(10.0 * power);
        let marks = (low / step).ceil() as i64..=(high / step).floor() as i64;
        marks.map(|k| k as f64 * step).collect()
    }
}

/// A number at an axis with this step, in few digits.
pub(super) fn short(x: f64, step: f64) -> String {
    match step {
        _ if x.abs() < 0.5 * step => "0".to_owned(),
        ..1e-3 => format!("{x:.0e}"),
        _ => trimmed(x, (-step.log10().floor()).max(0.0) as usize),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_axis_has_even_marks_at_round_numbers() {
        let marks = Axis(-23.0, 23.0).marks(5.0);
        assert_eq!(marks, [-20.0, -10.0, 0.0, 10.0, 20.0]);
        assert_eq!(Axis(0.0, 30.0).marks(6.0).last(), Some(&30.0));
    }

    #[test]
    fn numbers_at_an_axis_are_short() {
        let numbers = [
            (0.0, 1.0),
            (-500.0, 250.0),
            (2.5, 0.5),
            (20.02, 0.02),
            (1e-4, 1e-4),
        ];
        let numbers = numbers.map(|(x, step)| short(x, step));
        assert_eq!(numbers, ["0", "-500", "2.5", "20.02", "1e-4"]);
    }
}
