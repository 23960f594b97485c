//! Errors of decoded poses against the reference: rms and peak by axis, and their noise.

use hallstage_input::dataset::Movement;
use hallstage_solver::statistics::SecondDifferences;

/// rms and peak of one axis, m or rad.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct AxisError {
    /// Root of the mean squared error over rows, m or rad.
    pub rms: f64,
    /// Largest magnitude, m or rad.
    pub peak: f64,
}

/// Errors of X, Y, Rz.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PoseError {
    /// X (m), Y (m), Rz (rad).
    pub axes: [AxisError; 3],
    /// Rows that went in.
    pub rows: usize,
}

/// Sums up errors row by row, m, m, rad.
#[derive(Clone, Copy, Debug)]
pub struct ErrorSums {
    /// Rows with an error.
    pub rows: usize,
    /// Rows without, which the decoder refused.
    pub undecoded: usize,
    error: [f64; 3],
    squares: [f64; 3],
    low: [f64; 3],
    high: [f64; 3],
}

impl ErrorSums {
    /// The sums over no rows.
    pub const NONE: Self = Self {
        rows: 0,
        undecoded: 0,
        error: [0.0; 3],
        squares: [0.0; 3],
        low: [f64::INFINITY; 3],
        high: [f64::NEG_INFINITY; 3],
    };

    /// Takes the error of the next row.
    pub fn take(&mut self, error: Option<[f64; 3]>) {
        let Some(error) = error else {
            self.undecoded += 1;
            return;
        };
        self.rows += 1;
        for (axis, error) in error.into_iter().enumerate() {
            self.error[axis] += error;
            self.squares[axis] += error * error;
            self.low[axis] = self.low[axis].min(error);
            self.high[axis] = self.high[axis].max(error);
        }
    }

    /// Adds the sums of the rows that follow.
    pub fn add(&mut self, more: &Self) {
        self.rows += more.rows;
        self.undecoded += more.undecoded;
        for axis in 0..3 {
            self.error[axis] += more.error[axis];
            self.squares[axis] += more.squares[axis];
            self.low[axis] = self.low[axis].min(more.low[axis]);
            self.high[axis] = self.high[axis].max(more.high[axis]);
        }
    }

    /// Mean of the errors, m, m, rad; `None` without decoded rows.
    pub fn mean(&self) -> Option<[f64; 3]> {
        (self.rows > 0).then(|| self.error.map(|sum| sum / self.rows as f64))
    }

    /// The sums of the errors less a zero deviation (m, m, rad).
    pub fn less(&self, zero: [f64; 3]) -> Self {
        let mut less = *self;
        let rows = self.rows as f64;
        for (axis, zero) in zero.into_iter().enumerate() {
            let squares = self.squares[axis] - 2.0 * zero * self.error[axis];
            less.squares[axis] = (squares + rows * zero * zero).max(0.0);
            less.error[axis] -= rows * zero;
            less.low[axis] -= zero;
            less.high[axis] -= zero;
        }
        less
    }

    /// The figures; all zero without rows.
    pub fn errors(&self) -> PoseError {
        let axis = |axis: usize| AxisError {
            rms: (self.squares[axis] / self.rows.max(1) as f64).sqrt(),
            peak: self.high[axis].max(-self.low[axis]).max(0.0),
        };
        PoseError {
            axes: [0, 1, 2].map(axis),
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

/// The noise of errors from row to row within the movements, m, m, rad.
pub fn white_noise(errors: &[Option<[f64; 3]>], movements: &[Movement]) -> [f64; 3] {
    let mut noise = SecondDifferences::default();
    for movement in movements {
        for three in errors[movement.rows.clone()].windows(3) {
            let [Some(before), Some(here), Some(after)] = three else {
                continue;
            };
            noise.add(*before, *here, *after);
        }
    }
    noise.deviations()
}

/// rms of errors of X, Y, Rz over their noise from row to row within the movements.
pub fn over_noise(errors: &[Option<[f64; 3]>], movements: &[Movement]) -> [f64; 3] {
    let mut sums = ErrorSums::NONE;
    errors.iter().for_each(|error| sums.take(*error));
    let (axes, noise) = (sums.errors().axes, white_noise(errors, movements));
    [0, 1, 2].map(|axis| axes[axis].rms / noise[axis])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rms_and_peak_of_errors_worked_by_hand() {
        let mut sums = ErrorSums::NONE;
        sums.take(Some([3e-6, -1e-6, 0.0]));
        sums.take(None);
        sums.take(Some([-4e-6, 1e-6, 6e-6]));
        assert_eq!((sums.rows, sums.undecoded), (2, 1));
        let error = sums.errors();
        assert!((error.axes[0].rms - 12.5e-12f64.sqrt()).abs() < 1e-18);
        assert_eq!(error.axes[0].peak, 4e-6);
        assert!((error.axes[1].rms - 1e-6).abs() < 1e-18);
        assert_eq!(error.axes[2].peak, 6e-6);
        // (12.5 + 1 + 18) / 3
        assert!((error.fitness() - 10.5f64.sqrt()).abs() < 1e-12);
        assert_eq!(ErrorSums::NONE.errors(), PoseError::default());
    }
}
