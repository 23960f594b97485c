//! Judges parameters: takes row after row, movement after movement, and keeps sums.

use super::Zeros;
use super::statistics::{ErrorSums, PoseError};
use hallstage_input::dataset::{Movement, Row};
use hallstage_input::stage::Stage;
use hallstage_solver::estimator::paper::Parameters;
use hallstage_solver::estimator::zero_deviation::ZeroDeviation;
use runtime::parameters::FitRecord;

/// The figures of one parameter set on the rows of one or more logs.
#[derive(Clone, Debug, PartialEq)]
pub struct Judgement {
    /// Errors over all decoded rows.
    pub errors: PoseError,
    /// Each log.
    pub logs: Vec<LogJudgement>,
    /// The movements, with their rows among those that were judged.
    pub movements: Vec<Movement>,
    /// The zero deviation that was taken off each movement.
    pub zeros: Vec<ZeroDeviation>,
    /// The errors of each movement.
    pub by_movement: Vec<PoseError>,
    /// Mean Z, Rx, Ry of each movement, m, rad, rad.
    pub settings: Vec<[f64; 3]>,
    /// Rows that the decoder could not decode (bad codes); they count in no error.
    pub undecoded: usize,
}

impl Judgement {
    /// The record of the errors in the blob of a fit that used `train_rows` rows.
    pub fn record(&self, train_rows: u32) -> FitRecord {
        let axes = self.errors.axes;
        FitRecord {
            rows: u32::try_from(self.rows()).unwrap_or(u32::MAX),
            train_rows,
            rms: axes.map(|axis| axis.rms as f32),
            peak: axes.map(|axis| axis.peak as f32),
            forced: false,
        }
    }

    /// Rows of all logs, those included that could not be decoded.
    pub const fn rows(&self) -> usize {
        self.errors.rows + self.undecoded
    }
}

/// Errors over all rows of one log.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LogJudgement {
    /// Its rows, those included that could not be decoded.
    pub rows: usize,
    /// Over its decoded rows.
    pub errors: PoseError,
}

/// A movement that is over, or under way.
#[derive(Clone, Debug)]
struct OfMovement {
    movement: Movement,
    sums: ErrorSums,
    vertical: [f64; 3],
}

/// Judges a parameter set on rows as they come, movement after movement.
#[derive(Clone, Debug)]
pub struct Judge<'s> {
    parameters: Parameters,
    stage: &'s Stage,
    logs: usize,
    rows: usize,
    movements: Vec<OfMovement>,
}

impl<'s> Judge<'s> {
    /// A judge of a number of logs.
    pub fn new(parameters: &Parameters, stage: &'s Stage, logs: usize) -> Self {
        Self {
            parameters: *parameters,
            stage,
            logs,
            rows: 0,
            movements: Vec::new(),
        }
    }

    /// Takes the next row: number of its log, number of its movement, whether it begins the movement, and its
    /// [`error`](super::error).
    pub fn take(
        &mut self,
        (log, index, begins): (usize, i64, bool),
        row: &Row,
        error: Option<[f64; 3]>,
    ) {
        if begins || self.movements.is_empty() {
            self.movements.push(OfMovement {
                movement: Movement {
                    log,
                    index,
                    rows: self.rows..self.rows,
                },
                sums: ErrorSums::NONE,
                vertical: [0.0; 3],
            });
        }
        self.rows += 1;
        if let Some(last) = self.movements.last_mut() {
            last.movement.rows.end = self.rows;
            last.sums.take(error);
            for (sum, x) in last.vertical.iter_mut().zip(row.vertical) {
                *sum += x;
            }
        }
    }

    /// The figures of all rows.
    pub fn judgement(self, zeros: Zeros<'_>) -> Judgement {
        let mut total = ErrorSums::NONE;
        let mut logs = vec![ErrorSums::NONE; self.logs];
        let mut taken_off = Vec::with_capacity(self.movements.len());
        let mut by_movement = Vec::with_capacity(self.movements.len());
        for (number, of) in self.movements.iter().enumerate() {
            let zero = match zeros {
                Zeros::None => ZeroDeviation::NONE,
                Zeros::Refit => of.sums.mean().map_or(ZeroDeviation::NONE, |mean| {
                    ZeroDeviation::from_mean_error(
                        &self.parameters,
                        mean,
                        &self.stage.search.delta_m,
                    )
                }),
                Zeros::Given(deltas) => deltas.get(number).map_or(ZeroDeviation::NONE, |&delta| {
                    ZeroDeviation::given(&self.parameters, delta)
                }),
            };
            taken_off.push(zero);
            let sums = of.sums.less(zero.pose);
            by_movement.push(sums.errors());
            if let Some(log) = logs.get_mut(of.movement.log) {
                log.add(&sums);
            }
            total.add(&sums);
        }
        let log_judgement = |sums: &ErrorSums| LogJudgement {
            rows: sums.rows + sums.undecoded,
            errors: sums.errors(),
        };
        let setting = |of: &OfMovement| of.vertical.map(|sum| sum / of.movement.rows.len() as f64);
        Judgement {
            errors: total.errors(),
            logs: logs.iter().map(log_judgement).collect(),
            settings: self.movements.iter().map(setting).collect(),
            by_movement,
            movements: self.movements.into_iter().map(|of| of.movement).collect(),
            zeros: taken_off,
            undecoded: total.undecoded,
        }
    }
}
