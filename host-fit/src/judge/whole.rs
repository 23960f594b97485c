//! The errors of a parameter set over all rows of a long log, of which only sums are kept.

use crate::input::stage::Stage;
use crate::judge::Zeros;
use crate::judge::statistics::{AxisError, PoseError};
use crate::problem::parameters::Parameters;
use crate::problem::zero_deviation::ZeroDeviation;
use runtime::ParameterSet;

/// Errors over all rows of long logs.
#[derive(Clone, Debug, PartialEq)]
pub struct WholeJudgement {
    /// Over all decoded rows of all logs; the rows of the peaks are not known.
    pub errors: PoseError,
    /// Each log.
    pub logs: Vec<LogJudgement>,
    /// The zero deviation that was taken off each movement.
    pub zeros: Vec<ZeroDeviation>,
    /// Rows that the decoder could not decode.
    pub undecoded: usize,
    /// Root mean square of the reference: m, m, rad.
    pub motion: [f64; 3],
}

/// Errors over all rows of one log.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LogJudgement {
    /// Its rows, those included that could not be decoded.
    pub rows: usize,
    /// Over its decoded rows.
    pub errors: PoseError,
}

/// Sums over rows of one movement.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sums {
    rows: f64,
    undecoded: usize,
    error: [f64; 3],
    squares: [f64; 3],
    low: [f64; 3],
    high: [f64; 3],
    reference_squares: [f64; 3],
}

impl Sums {
    pub(super) const NONE: Self = Self {
        rows: 0.0,
        undecoded: 0,
        error: [0.0; 3],
        squares: [0.0; 3],
        low: [f64::INFINITY; 3],
        high: [f64::NEG_INFINITY; 3],
        reference_squares: [0.0; 3],
    };

    pub(super) fn take(&mut self, error: Option<[f64; 3]>, reference: [f64; 3]) {
        for (sum, x) in self.reference_squares.iter_mut().zip(reference) {
            *sum += x * x;
        }
        let Some(error) = error else {
            self.undecoded += 1;
            return;
        };
        self.rows += 1.0;
        for (axis, error) in error.into_iter().enumerate() {
            self.error[axis] += error;
            self.squares[axis] += error * error;
            self.low[axis] = self.low[axis].min(error);
            self.high[axis] = self.high[axis].max(error);
        }
    }

    /// Rows that were decoded.
    pub(super) const fn rows(&self) -> f64 {
        self.rows
    }

    /// From the lowest to the highest error of each axis, m, m, rad; negative without rows.
    pub(super) fn widths(&self) -> [f64; 3] {
        [0, 1, 2].map(|axis| self.high[axis] - self.low[axis])
    }

    /// Mean of the errors and rms about it, m, m, rad.
    pub(super) fn mean_and_rms(&self) -> ([f64; 3], [f64; 3]) {
        let mean = self.error.map(|sum| sum / self.rows);
        let variance = |axis: usize| self.squares[axis] / self.rows - mean[axis] * mean[axis];
        (mean, [0, 1, 2].map(|axis| variance(axis).max(0.0).sqrt()))
    }

    pub(super) fn add(&mut self, more: &Self) {
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

    const fn all_rows(&self) -> usize {
        self.rows as usize + self.undecoded
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

/// Sums over the movements of one log.
#[derive(Clone, Copy, Debug)]
struct LogSums {
    /// No zero deviation taken off.
    plain: Sums,
    /// Those of the movements refitted.
    refitted: Sums,
}

impl LogSums {
    const NONE: Self = Self {
        plain: Sums::NONE,
        refitted: Sums::NONE,
    };
}

/// Judges a parameter set on rows as they come, movement after movement.
#[derive(Clone, Debug)]
pub struct Judge<'s> {
    parameters: Parameters,
    stage: &'s Stage,
    /// The movement that is not over, and its log.
    movement: (usize, Sums),
    logs: Vec<LogSums>,
    /// Of each movement that is over.
    zeros: Vec<ZeroDeviation>,
}

impl<'s> Judge<'s> {
    /// Of so many logs.
    pub fn new(set: &ParameterSet, stage: &'s Stage, logs: usize) -> Self {
        Self {
            parameters: Parameters::of_set(set),
            stage,
            movement: (0, Sums::NONE),
            logs: vec![LogSums::NONE; logs],
            zeros: Vec::new(),
        }
    }

    /// Takes the next row: the number of its log, whether a movement begins with it, what
    /// [`error`](super::error) says of it, and its reference, m, m, rad.
    pub fn take(&mut self, log: usize, begins: bool, error: Option<[f64; 3]>, reference: [f64; 3]) {
        if begins {
            self.end_movement();
        }
        self.movement.0 = log;
        self.movement.1.take(error, reference);
    }

    fn end_movement(&mut self) {
        let (log, sums) = std::mem::replace(&mut self.movement, (0, Sums::NONE));
        if sums.rows > 0.0 || sums.undecoded > 0 {
            self.take_movement(log, &sums);
        }
    }

    /// Takes a whole movement of a log.
    pub(super) fn take_movement(&mut self, log: usize, sums: &Sums) {
        let zero = match sums.rows > 0.0 {
            true => {
                let mean = sums.error.map(|sum| sum / sums.rows);
                ZeroDeviation::of_mean_error(&self.parameters, mean, &self.stage.search.delta_m)
            }
            false => ZeroDeviation::NONE,
        };
        let log = &mut self.logs[log];
        log.plain.add(sums);
        log.refitted.add(&sums.less(zero.pose));
        self.zeros.push(zero);
    }

    /// The figures of the rows so far; zero deviations are refitted unless there are to be none.
    pub fn judgement(&self, zeros: Zeros<'_>) -> WholeJudgement {
        let mut all = self.clone();
        all.end_movement();
        let refits = zeros != Zeros::None;
        let mut total = Sums::NONE;
        let mut of_log = |log: &LogSums| {
            let sums = if refits { &log.refitted } else { &log.plain };
            total.add(sums);
            LogJudgement {
                rows: sums.all_rows(),
                errors: sums.errors(),
            }
        };
        let logs = all.logs.iter().map(&mut of_log).collect();
        let rows = total.all_rows() as f64;
        if !refits {
            all.zeros.fill(ZeroDeviation::NONE);
        }
        WholeJudgement {
            errors: total.errors(),
            logs,
            undecoded: total.undecoded,
            zeros: all.zeros,
            motion: (total.reference_squares).map(|sum| (sum / rows.max(1.0)).sqrt()),
        }
    }
}

impl WholeJudgement {
    /// Rows of all logs, those included that could not be decoded.
    pub const fn rows(&self) -> usize {
        self.errors.rows + self.undecoded
    }
}
