//! Errors of decoded poses against the reference: rms and peak by axis, and their noise.

use crate::input::dataset::Movement;

/// rms and peak of one axis, m or rad.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct AxisError {
    /// Root of the mean squared error over rows, m or rad.
    pub rms: f64,
    /// Largest magnitude, m or rad.
    pub peak: f64,
    /// The row of the peak.
    pub peak_row: usize,
}

/// Errors of X, Y, Rz.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PoseError {
    /// X (m), Y (m), Rz (rad).
    pub axes: [AxisError; 3],
    /// Rows that went in.
    pub rows: usize,
}

/// Sums up errors row by row, in the order they come.
#[derive(Clone, Copy, Debug, Default)]
pub struct ErrorSums {
    squares: [f64; 3],
    peaks: [f64; 3],
    peak_rows: [usize; 3],
    rows: usize,
}

impl ErrorSums {
    /// Takes the error of one row: m, m, rad; `row` is its number in the log.
    pub fn add(&mut self, row: usize, error: [f64; 3]) {
        for (axis, error) in error.into_iter().enumerate() {
            self.squares[axis] += error * error;
            if error.abs() > self.peaks[axis] {
                self.peaks[axis] = error.abs();
                self.peak_rows[axis] = row;
            }
        }
        self.rows += 1;
    }

    /// The figures; all zero without rows.
    pub fn finish(&self) -> PoseError {
        let n = self.rows.max(1) as f64;
        PoseError {
            axes: std::array::from_fn(|axis| AxisError {
                rms: (self.squares[axis] / n).sqrt(),
                peak: self.peaks[axis],
                peak_row: self.peak_rows[axis],
            }),
            rows: self.rows,
        }
    }
}

impl PoseError {
    /// The fitness: root of the mean over rows and axes of the squared error, um, um, urad.
    pub fn fitness(&self) -> f64 {
        let squares: f64 = self.axes.iter().map(|a| (a.rms * 1e6).powi(2)).sum();
        (squares / 3.0).sqrt()
    }
}

/// The noise of errors from row to row, m, m, rad: the rms of their second differences within the
/// movements over the root of 6, which neither an offset nor a slow error changes.
pub fn white_noise(errors: &[Option<[f64; 3]>], movements: &[Movement]) -> [f64; 3] {
    let mut squares = [0.0; 3];
    let mut count = 0.0;
    for movement in movements {
        for three in errors[movement.rows.clone()].windows(3) {
            let [Some(before), Some(here), Some(after)] = three else {
                continue;
            };
            for axis in 0..3 {
                squares[axis] += (before[axis] - 2.0 * here[axis] + after[axis]).powi(2);
            }
            count += 6.0;
        }
    }
    squares.map(|sum: f64| (sum / f64::max(count, 1.0)).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rms_and_peak_of_errors_worked_by_hand() {
        let mut sums = ErrorSums::default();
        sums.add(4, [3e-6, -1e-6, 0.0]);
        sums.add(7, [-4e-6, 1e-6, 6e-6]);
        let error = sums.finish();
        assert!((error.axes[0].rms - 12.5e-12f64.sqrt()).abs() < 1e-18);
        assert_eq!(error.axes[0].peak, 4e-6);
        assert_eq!(error.axes.map(|a| a.peak_row), [7, 4, 7]);
        assert!((error.axes[1].rms - 1e-6).abs() < 1e-18);
        assert_eq!(error.axes[2].peak, 6e-6);
        // (12.5 + 1 + 18) / 3
        assert!((error.fitness() - 10.5f64.sqrt()).abs() < 1e-12);
        assert_eq!(ErrorSums::default().finish(), PoseError::default());
    }
}
