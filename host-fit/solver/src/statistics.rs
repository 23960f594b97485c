//! Noise from magnitudes and from second differences.

use hallstage_input::statistics::median;

/// Standard deviation of normal numbers of mean zero, from their median magnitude: a minority of outliers does
/// not change it. 0 without numbers.
pub fn robust_deviation(numbers: impl Iterator<Item = f64>) -> f64 {
    let mut magnitudes: Vec<f64> = numbers.map(f64::abs).collect();
    1.4826 * median(&mut magnitudes).unwrap_or(0.0)
}

/// White noise from the numbers of every three rows that follow each other. The variance of their second
/// differences is six times the variance of the noise, and slow motion hardly changes them. Jumps and steps
/// do not count.
pub fn white_noise(threes: impl Iterator<Item = [f64; 3]>) -> f64 {
    let second = threes.map(|[before, here, after]| (before - 2.0 * here) + after);
    robust_deviation(second) / 6f64.sqrt()
}

/// White noise of three numbers that come row by row: the root mean square of their second differences over
/// the root of 6. Neither an offset nor a slow change alters it.
#[derive(Clone, Copy, Debug, Default)]
pub struct SecondDifferences {
    squares: [f64; 3],
    count: usize,
}

impl SecondDifferences {
    /// Takes three rows that follow each other.
    pub fn add(&mut self, before: [f64; 3], here: [f64; 3], after: [f64; 3]) {
        for (k, squares) in self.squares.iter_mut().enumerate() {
            let second = (before[k] - 2.0 * here[k]) + after[k];
            *squares += second * second;
        }
        self.count += 1;
    }

    /// The standard deviations; zero without rows.
    pub fn deviations(&self) -> [f64; 3] {
        let count = 6.0 * self.count.max(1) as f64;
        self.squares.map(|sum| (sum / count).sqrt())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn white_noise_is_robust_and_sees_no_ramp() {
        let row = |row: i32| match row {
            500.. => 1e6 * f64::from(row),
            _ => 0.1 * f64::from(row) + f64::from(row % 2),
        };
        let noise = |rows: i32| white_noise((0..rows).map(|k| [0, 1, 2].map(|d| row(k + d))));
        assert_eq!(noise(0), 0.0);
        let expected = 1.4826 * 2.0 / 6f64.sqrt();
        assert!((noise(700) - expected).abs() < 1e-9, "{}", noise(700));
    }

    #[test]
    fn second_differences_see_noise_and_no_ramp() {
        let mut differences = SecondDifferences::default();
        for row in 0..1000 {
            let at = |row: i32| [5.0 + 0.1 * f64::from(row), f64::from(row % 2), 0.0];
            differences.add(at(row), at(row + 1), at(row + 2));
        }
        let [ramp, alternating, none] = differences.deviations();
        assert!(ramp < 1e-12 && none == 0.0);
        assert!((alternating - 2.0 / 6f64.sqrt()).abs() < 1e-12);
    }
}
