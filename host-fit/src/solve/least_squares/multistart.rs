//! The least-squares solver: several starts on few rows, then the finish on all.

use super::coordinates::{Boxed, Coordinates, Gains, parameters_of, point_of};
use super::descend::{Descent, DescentEnd, Sums, descend};
use super::moments::Moments;
use super::normal::{Column, Point, best_gain, cost};
use super::scatter::{Offset, Q, Ratios, U};
use crate::problem::model::SLOPES_MAX;
use crate::problem::parameters::{ETA, Parameters, SLOPES, THETA, search_box};
use crate::problem::zero_deviation::ZeroDeviation;
use crate::problem::{Group, Problem, TrainRow};
use crate::solve::{Projection, Solution, SolveError, SolverOptions};
use rand::rngs::ChaCha8Rng;
use rand::{RngExt, SeedableRng};
use rayon::prelude::*;
use std::time::Duration;

/// Starts besides the designed geometry.
const RANDOM_STARTS: usize = 7;
/// Rows on which starts are tried.
const START_ROWS: usize = 2000;
/// Tries to draw ratios whose phi stays away from zero over the log.
const DRAWS_MAX: usize = 200;
/// Smallest phi / eta of a random start: nearer to a pole the descent would start on a cliff.
const START_SENSITIVITY_MIN: f64 = 0.3;

/// Damped Gauss-Newton on the problem with everything linear projected out, from the designed
/// geometry and some random starts.
///
/// # Errors
/// See [`SolveError`].
pub fn solve(problem: &Problem, options: &SolverOptions) -> Result<Solution, SolveError> {
    let few = problem.thinned(START_ROWS);
    descend_from(&starts(&few, options.seed), (problem, &few), true, options)
}

/// Descends from each of the given parameters and finishes the best on all rows.
///
/// # Errors
/// See [`SolveError`].
pub fn solve_from(
    starts: &[Parameters],
    problem: &Problem,
    options: &SolverOptions,
) -> Result<Solution, SolveError> {
    let few = problem.thinned(START_ROWS);
    descend_from(starts, (problem, &few), true, options)
}

/// Descends on few rows, and on all of them from the best end; by moments if that is asked for, and the
/// log has such.
fn descend_from(
    starts: &[Parameters],
    (problem, few): (&Problem, &Problem),
    by_moments: bool,
    options: &SolverOptions,
) -> Result<Solution, SolveError> {
    let free = free_offsets(problem);
    let moments = |problem: &Problem| by_moments.then(|| Moments::new(problem)).flatten();
    let (of_all, of_few) = (moments(problem), moments(few));
    let few = Sums {
        problem: few,
        moments: of_few.as_ref(),
    };
    let few_offsets = free_offsets(few.problem);
    let boxed = Boxed {
        stage: problem.stage,
        model: problem.model,
    };
    // (12) fixes eta, so its gain is not an arbitrary matrix: only the parameters will do.
    let by_gains = options.projection == Projection::Linear && problem.model.fits_gain();
    let mut search = Search {
        sums: Sums {
            problem,
            moments: of_all.as_ref(),
        },
        offsets: &free,
        evaluations: 0,
    };
    let found = if by_gains {
        search.by_gains(few, &few_offsets, starts)?
    } else {
        search.by_parameters(&boxed, few, &few_offsets, starts)?
    };
    let mut descent = found.best;
    let mut parameters = parameters_of(&descent.point).ok_or(SolveError::NoPlanarMotion)?;
    // A solution outside its box is brought back, for the least cost on the box's edge.
    let clipped = boxed.clipped(&parameters);
    if by_gains && clipped != parameters {
        descent = search
            .finish(&boxed, boxed.unknowns(&clipped))
            .ok_or(SolveError::NoUsableStart)?;
    }
    if !by_gains || clipped != parameters {
        parameters = boxed.parameters(&descent.unknowns);
    }
    if options.projection == Projection::None && problem.model.has_zero_deviation {
        descent.unknowns = boxed.unknowns(&parameters);
        descent = search.with_clipped_offsets(&boxed, descent);
        parameters = boxed.parameters(&descent.unknowns);
    }
    if of_all
        .as_ref()
        .is_some_and(|moments| !moments.hold(&descent.point.ratios))
    {
        return descend_from(starts, (problem, few.problem), false, options);
    }
    let zeros = zero_deviations_by(search.sums, &parameters, &descent.point);
    Ok(Solution {
        delta_m: zeros.iter().map(|zero| zero.delta_m).collect(),
        parameters,
        cost: search.cost_with(&descent, &zeros),
        evaluations: search.evaluations,
        history: Vec::new(),
        elapsed: Duration::ZERO,
        stopped: format!(
            "{}; {} of {} starts agree",
            match descent.end {
                DescentEnd::Converged => "converged",
                DescentEnd::Stuck => "no shorter step lowers the cost",
                DescentEnd::StepLimit => "step limit",
            },
            found.agreeing,
            found.tried
        ),
        at_limit: boxed.at_limit(&parameters),
    })
}

/// The best of several starts, finished on all rows.
struct Found {
    best: Descent,
    agreeing: usize,
    tried: usize,
}

struct Search<'p, 'a> {
    sums: Sums<'p, 'a>,
    offsets: &'p [Offset],
    evaluations: u64,
}

impl Search<'_, '_> {
    fn finish(&mut self, coordinates: &impl Coordinates, from: Column) -> Option<Descent> {
        let descent = descend(self.sums, self.offsets, coordinates, from)?;
        self.evaluations += descent.evaluations;
        Some(descent)
    }

    fn by_gains(
        &mut self,
        few: Sums,
        few_offsets: &[Offset],
        starts: &[Parameters],
    ) -> Result<Found, SolveError> {
        let coordinates = Gains {
            model: self.sums.problem.model,
        };
        let from = |start: &Parameters| {
            let ratios = point_of(start)?.ratios;
            let gain = best_gain(&few.scatter(&ratios, few_offsets)?)?;
            let from = Gains::unknowns(&Point { gain, ratios });
            Some(descend(few, few_offsets, &coordinates, from))
        };
        let found: Vec<Option<Descent>> = starts.par_iter().filter_map(from).collect();
        let spanned = !found.is_empty();
        let tried: Vec<Descent> = found.into_iter().flatten().collect();
        if !spanned {
            return Err(SolveError::NoPlanarMotion);
        }
        self.best_of(tried, &coordinates)
    }

    fn by_parameters(
        &mut self,
        boxed: &Boxed,
        few: Sums,
        few_offsets: &[Offset],
        starts: &[Parameters],
    ) -> Result<Found, SolveError> {
        let from = |start: &Parameters| {
            let from = boxed.unknowns(&boxed.clipped(start));
            descend(few, few_offsets, boxed, from)
        };
        let tried = starts.par_iter().filter_map(from).collect();
        self.best_of(tried, boxed)
    }

    fn best_of(
        &mut self,
        tried: Vec<Descent>,
        coordinates: &impl Coordinates,
    ) -> Result<Found, SolveError> {
        self.evaluations += tried.iter().map(|d| d.evaluations).sum::<u64>();
        let lowest = tried
            .iter()
            .min_by(|a, b| a.cost.total_cmp(&b.cost))
            .ok_or(SolveError::NoUsableStart)?;
        let agreeing = tried
            .iter()
            .filter(|d| d.cost <= lowest.cost * (1.0 + 1e-6))
            .count();
        let best = self
            .finish(coordinates, lowest.unknowns)
            .ok_or(SolveError::NoUsableStart)?;
        Ok(Found {
            best,
            agreeing,
            tried: tried.len(),
        })
    }

    /// The cost with the zero deviations that are reported: where some were clipped it is more
    /// than that of the free offsets.
    fn cost_with(&mut self, descent: &Descent, zeros: &[ZeroDeviation]) -> f64 {
        if zeros.iter().all(|zero| !zero.clipped) {
            return descent.cost;
        }
        let problem = self.sums.problem;
        let of = |group: &Group| Offset::Fixed(zeros[group.movement].pose.map(|x| x * 1e6));
        let offsets: Vec<Offset> = problem.groups.iter().map(of).collect();
        self.evaluations += 1;
        let scatter = self.sums.scatter(&descent.point.ratios, &offsets);
        scatter.map_or(descent.cost, |scatter| {
            cost(&scatter, &descent.point.gain, problem.weights)
        })
    }

    /// Zero deviations as unknowns within their range: those that would leave it are fixed at
    /// its end and the rest fitted again, until none changes. Each of the three of a movement is
    /// clipped by itself, which is near the best within the range but not it, and no descent: so
    /// the best of these fits is kept, the first one included.
    fn with_clipped_offsets(&mut self, boxed: &Boxed, mut descent: Descent) -> Descent {
        let mut offsets = self.offsets.to_vec();
        let mut best: Option<(f64, Descent)> = None;
        for _ in 0..20 {
            let parameters = boxed.parameters(&descent.unknowns);
            let zeros = zero_deviations_by(self.sums, &parameters, &descent.point);
            let cost = self.cost_with(&descent, &zeros);
            if best.as_ref().is_none_or(|(least, _)| cost < *least) {
                best = Some((cost, descent.clone()));
            }
            let mut changed = false;
            for (offset, group) in offsets.iter_mut().zip(&self.sums.problem.groups) {
                let zero = &zeros[group.movement];
                if zero.clipped {
                    let fixed = Offset::Fixed(zero.pose.map(|x| x * 1e6));
                    changed |= *offset != fixed;
                    *offset = fixed;
                }
            }
            if !changed {
                break;
            }
            let Some(next) = descend(self.sums, &offsets, boxed, descent.unknowns) else {
                break;
            };
            self.evaluations += next.evaluations;
            descent = next;
        }
        best.map_or(descent, |(_, best)| best)
    }
}

/// The offsets that the model leaves free: one for each movement, or none at all.
fn free_offsets(problem: &Problem) -> Vec<Offset> {
    let offset = if problem.model.has_zero_deviation {
        Offset::Free
    } else {
        Offset::Fixed([0.0; 3])
    };
    vec![offset; problem.groups.len()]
}

/// The zero deviation of every movement of the log at a solution; none where the model has none
/// or the movement no row.
pub fn zero_deviations(
    problem: &Problem,
    parameters: &Parameters,
    point: &Point,
) -> Vec<ZeroDeviation> {
    let moments = None;
    zero_deviations_by(Sums { problem, moments }, parameters, point)
}

fn zero_deviations_by(sums: Sums, parameters: &Parameters, point: &Point) -> Vec<ZeroDeviation> {
    let problem = sums.problem;
    let mut zeros = vec![ZeroDeviation::NONE; problem.movements];
    if !problem.model.has_zero_deviation {
        return zeros;
    }
    for (number, group) in problem.groups.iter().enumerate() {
        let mean: Option<[f64; U]> = match sums.moments {
            Some(moments) => moments.mean(number, &point.ratios),
            None => super::scatter::mean(&problem.rows[group.rows.clone()], &point.ratios)
                .map(|mean| std::array::from_fn(|k| mean[k])),
        };
        let Some(mean) = mean else {
            continue;
        };
        let error = std::array::from_fn(|axis| {
            let decoded: f64 = (0..3).map(|k| point.gain[(axis, k)] * mean[k]).sum();
            (decoded - mean[Q + axis]) * 1e-6
        });
        zeros[group.movement] =
            ZeroDeviation::of_mean_error(parameters, error, &problem.stage.search.delta_m);
    }
    zeros
}

/// The designed geometry with sensitivities from the middle of their ranges.
pub fn middle_of_the_box(problem: &Problem) -> Parameters {
    let mut middle = Parameters::designed(problem.stage);
    if problem.model.fits_gain() {
        let ranges = search_box(problem.stage, problem.model, [0.0; 3]);
        let etas = middle.values[ETA..SLOPES].iter_mut();
        for (eta, range) in etas.zip(&ranges[ETA..SLOPES]) {
            *eta = 0.5 * (range.low + range.high);
        }
    }
    middle
}

/// [`middle_of_the_box`], then random points of the search box whose phi stays away from zero over
/// the whole log.
fn starts(problem: &Problem, seed: u64) -> Vec<Parameters> {
    let stage = problem.stage;
    let middle = middle_of_the_box(problem);
    let mut starts = vec![middle];
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    for _ in 0..DRAWS_MAX {
        if starts.len() > RANDOM_STARTS {
            break;
        }
        let mut start = middle;
        let p = &mut start.values;
        // Near a pole most of the box of Table 5 is useless, so draws are shrunk towards zero.
        let shrink: f64 = random.random();
        let ranges = search_box(stage, problem.model, [0.0; 3]);
        for id in problem.model.parameters().skip(THETA) {
            let draw: f64 = random.random();
            if id.index < problem.model.free_count() {
                let value = ranges[id.index].low + draw * ranges[id.index].width();
                p[id.index] = if id.is_slope() { value * shrink } else { value };
            }
        }
        let ranges = search_box(stage, problem.model, [p[3], p[4], p[5]]);
        for k in 0..THETA {
            p[k] = ranges[k].low + random.random::<f64>() * ranges[k].width();
        }
        let far = point_of(&start).is_some_and(|point| is_far_from_poles(problem, &point.ratios));
        if far {
            starts.push(start);
        }
    }
    starts
}

/// Whether phi / eta stays above [`START_SENSITIVITY_MIN`] over all rows.
fn is_far_from_poles(problem: &Problem, ratios: &Ratios) -> bool {
    let share = |r: &[f64; SLOPES_MAX], row: &TrainRow| {
        1.0 + r.iter().zip(row.slopes).map(|(r, v)| r * v).sum::<f64>()
    };
    let is_far = |row: &TrainRow| {
        let mut shares = ratios.iter().map(|r| share(r, row));
        shares.all(|share| share > START_SENSITIVITY_MIN)
    };
    problem.rows.iter().all(is_far)
}
