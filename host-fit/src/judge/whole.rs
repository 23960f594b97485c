//! The errors of a parameter set over all rows of a long log, of which only sums are kept.

use crate::input::dataset::{LoggedFrame, Movement};
use crate::input::stage::Stage;
use crate::input::whole::Whole;
use crate::judge::Zeros;
use crate::judge::statistics::{AxisError, PoseError};
use crate::problem::parameters::Parameters;
use crate::problem::zero_deviation::ZeroDeviation;
use rayon::prelude::*;
use runtime::{AnyDecoder, ParameterSet, PlanarPose};
use std::ops::Range;

/// Errors over all rows of long logs.
#[derive(Clone, Debug, PartialEq)]
pub struct WholeJudgement {
    /// Over all decoded rows of all logs; the rows of the peaks are not known.
    pub errors: PoseError,
    /// The same for each log.
    pub logs: Vec<PoseError>,
    /// The zero deviation that was taken off each movement of the whole.
    pub zeros: Vec<ZeroDeviation>,
    /// Rows that the decoder could not decode.
    pub undecoded: usize,
    /// Root mean square of the reference: m, m, rad.
    pub motion: [f64; 3],
}

/// Sums over rows of one movement.
#[derive(Clone, Copy, Debug)]
struct Sums {
    rows: f64,
    undecoded: usize,
    error: [f64; 3],
    squares: [f64; 3],
    low: [f64; 3],
    high: [f64; 3],
    reference_squares: [f64; 3],
}

impl Sums {
    const NONE: Self = Self {
        rows: 0.0,
        undecoded: 0,
        error: [0.0; 3],
        squares: [0.0; 3],
        low: [f64::INFINITY; 3],
        high: [f64::NEG_INFINITY; 3],
        reference_squares: [0.0; 3],
    };

    fn take(&mut self, decoder: &AnyDecoder, frame: &LoggedFrame, reference: [f64; 3]) {
        for (sum, x) in self.reference_squares.iter_mut().zip(reference) {
            *sum += x * x;
        }
        let Some(pose) = frame.decode(decoder, &PlanarPose::ZERO).planar() else {
            self.undecoded += 1;
            return;
        };
        self.rows += 1.0;
        for (axis, pose) in pose.to_array().into_iter().enumerate() {
            let error = f64::from(pose) - reference[axis];
            self.error[axis] += error;
            self.squares[axis] += error * error;
            self.low[axis] = self.low[axis].min(error);
            self.high[axis] = self.high[axis].max(error);
        }
    }

    fn add(&mut self, more: &Self) {
        self.rows += more.rows;
        self.undecoded += more.undecoded;
        for axis in 0..3 {
            self.error[axis] += more.error[axis];
            self.squares[axis] += more.squares[axis];
            self.low[axis] = self.low[axis].min(more.low[axis]);
            self.high[axis] = self.high[axis].max(more.high[axis]);
            self.reference_squares[axis] += more.reference_squares[axis];
        }
    }

    /// The sums of the errors less a zero deviation (m, m, rad).
    fn less(self, zero: [f64; 3]) -> Self {
        let mut less = self;
        for (axis, zero) in zero.into_iter().enumerate() {
            let squares = self.squares[axis] - 2.0 * zero * self.error[axis];
            less.squares[axis] = (squares + self.rows * zero * zero).max(0.0);
            less.error[axis] -= self.rows * zero;
            less.low[axis] -= zero;
            less.high[axis] -= zero;
        }
        less
    }

    fn errors(&self) -> PoseError {
        let axis = |axis: usize| AxisError {
            rms: (self.squares[axis] / self.rows.max(1.0)).sqrt(),
            peak: self.high[axis].max(-self.low[axis]).max(0.0),
            peak_row: 0,
        };
        PoseError {
            axes: [axis(0), axis(1), axis(2)],
            rows: self.rows as usize,
        }
    }
}

impl WholeJudgement {
    /// Decodes every row; zero deviations are refitted unless there are to be none.
    pub fn new(set: &ParameterSet, whole: &Whole, stage: &Stage, zeros: Zeros<'_>) -> Self {
        let decoder = set.decoder();
        let parameters = Parameters::of_set(set);
        let pieces: Vec<Vec<(usize, Sums)>> = (whole.samples().ranges().into_par_iter())
            .map(|rows| pieces(whole, &decoder, rows))
            .collect();
        let mut movements = vec![Sums::NONE; whole.movements().len()];
        for (movement, sums) in pieces.iter().flatten() {
            movements[*movement].add(sums);
        }
        let mut logs = vec![Sums::NONE; whole.logs().len()];
        let mut taken_off = Vec::with_capacity(movements.len());
        for (movement, sums) in whole.movements().iter().zip(movements) {
            let zero = match zeros {
                Zeros::Refit if sums.rows > 0.0 => {
                    let mean = sums.error.map(|sum| sum / sums.rows);
                    ZeroDeviation::of_mean_error(&parameters, mean, &stage.search.delta_m)
                }
                _ => ZeroDeviation::NONE,
            };
            logs[movement.log].add(&sums.less(zero.pose));
            taken_off.push(zero);
        }
        let mut all = Sums::NONE;
        logs.iter().for_each(|log| all.add(log));
        let rows = all.rows + all.undecoded as f64;
        Self {
            errors: all.errors(),
            logs: logs.iter().map(Sums::errors).collect(),
            zeros: taken_off,
            undecoded: all.undecoded,
            motion: (all.reference_squares).map(|sum| (sum / rows.max(1.0)).sqrt()),
        }
    }
}

/// The sums of some rows by movement.
fn pieces(whole: &Whole, decoder: &AnyDecoder, rows: Range<usize>) -> Vec<(usize, Sums)> {
    let all = whole.movements();
    let first = all.partition_point(|movement| movement.rows.end <= rows.start);
    let here =
        |movement: &Movement| movement.rows.start.max(rows.start)..movement.rows.end.min(rows.end);
    (all[first..].iter().zip(first..))
        .take_while(|(movement, _)| movement.rows.start < rows.end)
        .map(|(movement, number)| {
            let mut sums = Sums::NONE;
            for row in whole.rows_of(number, here(movement)) {
                sums.take(decoder, &row.frame, row.reference);
            }
            (number, sums)
        })
        .collect()
}
