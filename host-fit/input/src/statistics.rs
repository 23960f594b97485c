//! Medians and quantiles, and what is no noise.

/// A value beyond this many standard deviations is no noise: noise is there once in 10^10 rows, but residuals have
/// longer tails.
pub const CLEAR: f64 = 6.5;

/// The number below which this share of the numbers lies; `None` without numbers. Rearranges them.
pub fn quantile(numbers: &mut [f64], share: f64) -> Option<f64> {
    let place = (share * numbers.len() as f64) as usize;
    let place = place.min(numbers.len().checked_sub(1)?);
    Some(*numbers.select_nth_unstable_by(place, f64::total_cmp).1)
}

/// The upper median; `None` without numbers. Rearranges them.
pub fn median(numbers: &mut [f64]) -> Option<f64> {
    quantile(numbers, 0.5)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_median_is_the_upper_middle_and_a_quantile_its_share() {
        assert_eq!(median(&mut []), None);
        assert_eq!(median(&mut [3.0, 1.0, 2.0]), Some(2.0));
        assert_eq!(median(&mut [4.0, 3.0, 1.0, 2.0]), Some(3.0));
        let mut numbers: Vec<f64> = (0..100).rev().map(f64::from).collect();
        assert_eq!(quantile(&mut numbers, 0.9), Some(90.0));
        assert_eq!(quantile(&mut numbers, 1.0), Some(99.0));
    }
}
