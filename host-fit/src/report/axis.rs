//! The axes of charts: linear, or logarithmic with marks at 1, 2 and 5 of each decade where there are few.

/// An axis between two ends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Axis {
    /// Even distances.
    Linear(f64, f64),
    /// Both ends above zero, even decades.
    Logarithmic(f64, f64),
}

impl Axis {
    /// Where a value stands: 0 at the first end, 1 at the last.
    pub(super) fn place(self, value: f64) -> f64 {
        match self {
            Self::Linear(low, high) => (value - low) / (high - low),
            // What lies below the axis, such as a zero, stands at its end.
            Self::Logarithmic(low, high) => (value.max(low) / low).ln() / (high / low).ln(),
        }
    }

    /// The values that are marked: about `count` on a linear axis.
    pub(super) fn marks(self, count: f64) -> Vec<f64> {
        match self {
            Self::Linear(low, high) if high <= low => Vec::new(),
            Self::Linear(low, high) => {
                let least = (high - low) / count;
                let power = 10f64.powf(least.log10().floor());
                let steps = [1.0, 2.0, 5.0, 10.0].map(|digit| digit * power);
                let step = steps.into_iter().find(|step| *step >= least);
                let step = step.unwrap_or(10.0 * power);
                let marks = (low / step).ceil() as i64..=(high / step).floor() as i64;
                marks.map(|k| k as f64 * step).collect()
            }
            Self::Logarithmic(low, high) => {
                let digits: &[f64] = match high.log10() - low.log10() {
                    ..=1.0 => &[1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0],
                    ..=2.5 => &[1.0, 2.0, 5.0],
                    _ => &[1.0],
                };
                let powers = low.log10().floor() as i32..=high.log10().ceil() as i32;
                powers
                    .flat_map(|power| digits.iter().map(move |digit| digit * 10f64.powi(power)))
                    .filter(|mark| (low..=high).contains(mark))
                    .collect()
            }
        }
    }
}

/// A number at an axis, in few digits.
pub(super) fn short(x: f64) -> String {
    let digits = match x.abs() {
        100.0.. => 0,
        1.0.. => 1,
        0.01.. => 3,
        ..1e-9 => return "0".to_owned(),
        _ => return format!("{x:.0e}"),
    };
    let text = format!("{x:.digits$}");
    match text.contains('.') {
        true => text.trim_end_matches('0').trim_end_matches('.').to_owned(),
        false => text,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_logarithmic_axis_has_marks_within_its_ends_and_maps_decades_evenly() {
        let axis = Axis::Logarithmic(0.3, 30.0);
        assert_eq!(axis.marks(5.0), [0.5, 1.0, 2.0, 5.0, 10.0, 20.0]);
        for (value, place) in [(0.3, 0.0), (3.0, 0.5), (30.0, 1.0), (0.0, 0.0)] {
            assert!((axis.place(value) - place).abs() < 1e-12, "{value}");
        }
        let short = Axis::Logarithmic(0.049, 0.11).marks(5.0);
        assert_eq!(short, [0.05, 0.06, 0.08, 0.1]);
        assert_eq!(Axis::Logarithmic(0.1, 1e4).marks(5.0).len(), 6);
    }

    #[test]
    fn a_linear_axis_has_even_marks_at_round_numbers() {
        let marks = Axis::Linear(-23.0, 23.0).marks(5.0);
        assert_eq!(marks, [-20.0, -10.0, 0.0, 10.0, 20.0]);
        assert_eq!(Axis::Linear(0.0, 30.0).marks(6.0).last(), Some(&30.0));
    }

    #[test]
    fn numbers_at_an_axis_are_short() {
        let numbers = [0.0, -500.0, 2.5, 0.05, 1e-4, 20.0].map(short);
        assert_eq!(numbers, ["0", "-500", "2.5", "0.05", "1e-4", "20"]);
    }
}
