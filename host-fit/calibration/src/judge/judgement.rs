//! The one judge of parameters: it takes rows as they come, movement after movement, and keeps sums.

use super::Zeros;
use super::left_out::{LeftOut, RowPlace};
use super::statistics::{ErrorSums, PoseError};
use hallstage_input::dataset::{Movement, Row};
use hallstage_input::stage::Stage;
use hallstage_input::statistics::median;
use hallstage_solver::problem::parameters::Parameters;
use hallstage_solver::problem::zero_deviation::ZeroDeviation;

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
    /// The rows that are far off.
    pub left_out: LeftOut,
    /// How far the stage goes from zero over the other decoded rows: X, Y, Rz, m, m, rad.
    pub planar: [f64; 3],
    /// The same of Z, Rx, Ry: m, rad, rad.
    pub vertical: [f64; 3],
}

impl Judgement {
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

/// A row that waits until its run is over.
#[derive(Clone, Copy, Debug)]
struct Seen {
    place: RowPlace,
    error: Option<[f64; 3]>,
    planar: [f64; 3],
    vertical: [f64; 3],
}

/// A movement that is over, or under way.
#[derive(Clone, Debug)]
struct OfMovement {
    movement: Movement,
    sums: ErrorSums,
    vertical: [f64; 3],
}

/// Rows of a run, whose median shows which are far off: a second at 2 ms.
const RUN: usize = 500;

/// Judges a parameter set on rows as they come, movement after movement.
#[derive(Clone, Debug)]
pub struct Judge<'s> {
    parameters: Parameters,
    stage: &'s Stage,
    logs: usize,
    /// How far a row may be from the median of its run, m, m, rad.
    limit: [f64; 3],
    rows: usize,
    run: Vec<Seen>,
    movements: Vec<OfMovement>,
    left_out: LeftOut,
    planar: [f64; 3],
    vertical: [f64; 3],
}

impl<'s> Judge<'s> {
    /// Of so many logs; no row is far off.
    pub fn new(parameters: &Parameters, stage: &'s Stage, logs: usize) -> Self {
        Self {
            parameters: *parameters,
            stage,
            logs,
            limit: [f64::INFINITY; 3],
            rows: 0,
            run: Vec::with_capacity(RUN),
            movements: Vec::new(),
            left_out: LeftOut::default(),
            planar: [0.0; 3],
            vertical: [0.0; 3],
        }
    }

    /// Rows are far off whose error is farther than this from the median of their run, m, m, rad.
    #[must_use]
    pub fn with_limit(self, limit: [f64; 3]) -> Self {
        Self { limit, ..self }
    }

    /// Takes the next row: the number of its log, that of its movement, whether this begins with it,
    /// and what [`error`](super::error) says of it.
    pub fn take(
        &mut self,
        (log, index, begins): (usize, i64, bool),
        row: &Row,
        error: Option<[f64; 3]>,
    ) {
        if begins || self.run.len() == RUN {
            self.end_run();
        }
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
        let row_number = self.rows;
        self.rows += 1;
        if let Some(last) = self.movements.last_mut() {
            last.movement.rows.end = self.rows;
            last.sums.take(row_number, error);
            for (sum, x) in last.vertical.iter_mut().zip(row.vertical) {
                *sum += x;
            }
        }
        self.run.push(Seen {
            place: RowPlace {
                log,
                movement: index,
                t_us: row.t_us,
            },
            error,
            planar: row.reference,
            vertical: row.vertical,
        });
    }

    /// Separates the rows of a run that are far off.
    fn end_run(&mut self) {
        let far = far_off(&self.run, self.limit);
        for seen in &self.run {
            let Some(error) = seen.error else {
                continue;
            };
            let is_far = far(error);
            self.left_out.take(seen.place, is_far);
            if is_far {
                continue;
            }
            for axis in 0..3 {
                self.planar[axis] = self.planar[axis].max(seen.planar[axis].abs());
                self.vertical[axis] = self.vertical[axis].max(seen.vertical[axis].abs());
            }
        }
        self.run.clear();
    }

    /// The figures of all rows.
    pub fn judgement(mut self, zeros: Zeros<'_>) -> Judgement {
        self.end_run();
        let mut total = ErrorSums::NONE;
        let mut logs = vec![ErrorSums::NONE; self.logs];
        let mut taken_off = Vec::with_capacity(self.movements.len());
        let mut by_movement = Vec::with_capacity(self.movements.len());
        for (number, of) in self.movements.iter().enumerate() {
            let zero = match zeros {
                Zeros::None => ZeroDeviation::NONE,
                Zeros::Refit => of.sums.mean().map_or(ZeroDeviation::NONE, |mean| {
                    ZeroDeviation::of_mean_error(&self.parameters, mean, &self.stage.search.delta_m)
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
        let of_log = |sums: &ErrorSums| LogJudgement {
            rows: sums.rows + sums.undecoded,
            errors: sums.errors(),
        };
        let setting = |of: &OfMovement| of.vertical.map(|sum| sum / of.movement.rows.len() as f64);
        Judgement {
            errors: total.errors(),
            logs: logs.iter().map(of_log).collect(),
            settings: self.movements.iter().map(setting).collect(),
            by_movement,
            movements: self.movements.into_iter().map(|of| of.movement).collect(),
            zeros: taken_off,
            undecoded: total.undecoded,
            left_out: self.left_out,
            planar: self.planar,
            vertical: self.vertical,
        }
    }
}

/// Whether an error is farther than `limit` from the median of the errors of a run.
fn far_off(run: &[Seen], limit: [f64; 3]) -> impl Fn([f64; 3]) -> bool + use<> {
    let errors = || run.iter().filter_map(|seen| seen.error);
    let width = |axis: usize| {
        let of_axis = || errors().map(|error| error[axis]);
        of_axis().fold(f64::NEG_INFINITY, f64::max) - of_axis().fold(f64::INFINITY, f64::min)
    };
    // None can be so far from the median where all are so close to each other.
    let is_close = limit == [f64::INFINITY; 3] || (0..3).all(|axis| width(axis) <= limit[axis]);
    let middle = (!is_close).then(|| medians(errors));
    move |error| {
        middle.is_some_and(|middle| {
            (0..3).any(|axis| (error[axis] - middle[axis]).abs() > limit[axis])
        })
    }
}

/// The upper median of some errors in each axis, 0 of none.
pub(crate) fn medians<I: Iterator<Item = [f64; 3]>>(errors: impl Fn() -> I) -> [f64; 3] {
    [0, 1, 2].map(|axis| {
        let mut of_axis: Vec<f64> = errors().map(|error| error[axis]).collect();
        median(&mut of_axis).unwrap_or(0.0)
    })
}
