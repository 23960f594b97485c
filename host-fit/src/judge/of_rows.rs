//! Every row of long logs decoded once: sums by movement, with and without the rows that are far
//! off; the spread of the errors from second to second; how far the stage goes.

use super::error;
use super::left_out::{Block, LeftOut};
use super::whole::{Judge, Sums, WholeJudgement};
use super::{Decoded, Zeros};
use crate::input::dataset::{Dataset, Row};
use crate::input::stage::Stage;
use crate::input::whole::Whole;
use crate::input::whole::excerpt::Run;
use rayon::prelude::*;
use runtime::{AnyDecoder, ParameterSet};

/// A row is left out if its error is this many times as far from the median of its run as that of any
/// row that the fit kept.
const BEYOND: f64 = 1.5;
/// Runs that are decoded one after the other.
const TOGETHER: usize = 16;
/// Fewer rows say nothing of a spread.
const SPREAD_ROWS_MIN: f64 = 10.0;

/// No row is far off.
pub const NO_LIMIT: [f64; 3] = [f64::INFINITY; 3];

/// Errors over the rows of a run, m, m, rad: mean and rms about it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spread {
    /// Mean.
    pub mean: [f64; 3],
    /// rms less the mean.
    pub rms: [f64; 3],
}

/// Sums over the rows of one movement.
#[derive(Clone, Copy)]
struct OfMovement {
    all: Sums,
    kept: Sums,
}

impl OfMovement {
    const NONE: Self = Self {
        all: Sums::NONE,
        kept: Sums::NONE,
    };

    fn add(&mut self, more: &Self) {
        self.all.add(&more.all);
        self.kept.add(&more.kept);
    }
}

/// What a parameter set leaves of all rows of long logs.
pub struct OfRows {
    movements: Vec<OfMovement>,
    /// Of each of [`Whole::runs`]; `None` of a few rows.
    pub spreads: Vec<Option<Spread>>,
    /// The rows that are far off.
    pub left_out: LeftOut,
    /// How far the stage goes from zero over the rows that are not, m, m, rad: in each run the second
    /// farthest, by reference and by decoded pose, whichever is nearer, for a beam may slip.
    pub planar: [f64; 3],
    /// The same of Z, Rx, Ry: m, rad, rad.
    pub vertical: [f64; 3],
}

/// What is known of a row.
struct Seen {
    error: Option<[f64; 3]>,
    row: Row,
}

/// Some runs.
#[derive(Default)]
struct Part {
    movements: Vec<(usize, OfMovement)>,
    spreads: Vec<Option<Spread>>,
    blocks: Vec<Block>,
    reach: [f64; 6],
}

impl OfRows {
    /// Decodes every row; those whose error is farther than `limit` (m, m, rad) from the median of
    /// their run are far off.
    pub fn new(set: &ParameterSet, whole: &Whole, limit: [f64; 3]) -> Self {
        let decoder = set.decoder();
        let parts: Vec<Part> = (whole.runs().par_chunks(TOGETHER))
            .map(|runs| Part::of(&decoder, whole, runs, limit))
            .collect();
        let mut movements = vec![OfMovement::NONE; whole.movements().len()];
        let mut reach = [0.0f64; 6];
        for part in &parts {
            for (movement, sums) in &part.movements {
                movements[*movement].add(sums);
            }
            for (most, here) in reach.iter_mut().zip(part.reach) {
                *most = most.max(here);
            }
        }
        let spreads = parts.iter().flat_map(|part| part.spreads.iter().copied());
        let [x, y, rz, z, rx, ry] = reach;
        Self {
            spreads: spreads.collect(),
            left_out: LeftOut::of_blocks(parts.into_iter().flat_map(|part| part.blocks)),
            movements,
            planar: [x, y, rz],
            vertical: [z, rx, ry],
        }
    }

    /// The figures over all rows, and over those that are not far off.
    pub fn judgements(
        &self,
        set: &ParameterSet,
        whole: &Whole,
        stage: &Stage,
        zeros: Zeros<'_>,
    ) -> [WholeJudgement; 2] {
        let of: [fn(&OfMovement) -> &Sums; 2] = [|sums| &sums.all, |sums| &sums.kept];
        of.map(|of| {
            let mut judge = Judge::new(set, stage, whole.logs().len());
            for (movement, sums) in whole.movements().iter().zip(&self.movements) {
                judge.take_movement(movement.log, of(sums));
            }
            judge.judgement(zeros)
        })
    }
}

impl Part {
    fn of(decoder: &AnyDecoder, whole: &Whole, runs: &[Run], limit: [f64; 3]) -> Self {
        let mut part = Self::default();
        let mut seen: Vec<Seen> = Vec::new();
        let mut scratch = Vec::new();
        for run in runs {
            seen.clear();
            (whole.rows_of(run.movement, run.rows.clone())).for_each(|row| {
                let error = error(decoder, &row.frame, row.reference);
                seen.push(Seen { error, row });
            });
            let mut sums = OfMovement::NONE;
            for Seen { error, row } in &seen {
                sums.all.take(*error, row.reference);
            }
            part.spreads.push(spread(&sums.all));
            let middle = match sums.all.widths() {
                // None can be so far from the median.
                widths if (0..3).all(|axis| widths[axis] <= limit[axis]) => None,
                _ => {
                    let errors = || seen.iter().filter_map(|seen| seen.error);
                    Some(medians(&mut scratch, errors))
                }
            };
            let is_far = |error: [f64; 3]| {
                middle.is_some_and(|middle| {
                    (0..3).any(|axis| (error[axis] - middle[axis]).abs() > limit[axis])
                })
            };
            let mut block = Block::default();
            let mut reach = [[0.0f64; 2]; 6];
            for (number, seen) in run.rows.clone().zip(&seen) {
                let Some(error) = seen.error else {
                    continue;
                };
                let is_far = is_far(error);
                block.take(number, is_far);
                if !is_far {
                    take_farthest(&mut reach, &seen.row, error);
                }
                if middle.is_some() && !is_far {
                    sums.kept.take(Some(error), seen.row.reference);
                }
            }
            if middle.is_none() {
                sums.kept = sums.all;
            }
            part.blocks.push(block);
            for (most, [_, second]) in part.reach.iter_mut().zip(reach) {
                *most = most.max(second);
            }
            match part.movements.last_mut() {
                Some((movement, before)) if *movement == run.movement => before.add(&sums),
                _ => part.movements.push((run.movement, sums)),
            }
        }
        part
    }
}

/// Keeps the farthest and the second farthest of each axis.
fn take_farthest(reach: &mut [[f64; 2]; 6], row: &Row, error: [f64; 3]) {
    let planar = |axis: usize| {
        let reference = row.reference[axis];
        reference.abs().min((reference + error[axis]).abs())
    };
    let vertical = row.vertical.map(f64::abs);
    let here = [0, 1, 2].map(planar).into_iter().chain(vertical);
    for ([first, second], here) in reach.iter_mut().zip(here) {
        *second = second.max(first.min(here));
        *first = first.max(here);
    }
}

fn spread(sums: &Sums) -> Option<Spread> {
    let (mean, rms) = sums.mean_and_rms();
    (sums.rows() >= SPREAD_ROWS_MIN).then_some(Spread { mean, rms })
}

/// The upper median of some errors in each axis, 0 of none.
fn medians<I: Iterator<Item = [f64; 3]>>(
    scratch: &mut Vec<f64>,
    errors: impl Fn() -> I,
) -> [f64; 3] {
    [0, 1, 2].map(|axis| {
        scratch.clear();
        scratch.extend(errors().map(|error| error[axis]));
        let middle = scratch.len() / 2;
        match scratch.is_empty() {
            true => 0.0,
            false => *scratch.select_nth_unstable_by(middle, f64::total_cmp).1,
        }
    })
}

/// How far a row may be from the median of its run, m, m, rad, by the rows of an excerpt that the
/// fit kept: all but `outliers`, ascending.
pub fn limit(decoded: &Decoded, excerpt: &Dataset, outliers: &[usize]) -> [f64; 3] {
    let mut outliers = outliers.iter().peekable();
    let mut scratch = Vec::new();
    let mut farthest = [0.0f64; 3];
    for movement in &excerpt.movements {
        let kept: Vec<[f64; 3]> = (movement.rows.clone())
            .filter(|row| outliers.next_if_eq(&row).is_none())
            .filter_map(|row| decoded.errors[row])
            .collect();
        let middle = medians(&mut scratch, || kept.iter().copied());
        for error in &kept {
            for axis in 0..3 {
                farthest[axis] = farthest[axis].max((error[axis] - middle[axis]).abs());
            }
        }
    }
    farthest.map(|far| BEYOND * far)
}
