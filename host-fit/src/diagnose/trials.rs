//! How well a log fits with a mistake undone: within the search ranges, and with free parameters.

use super::hypothesis::Hypothesis;
use crate::input::dataset::Dataset;
use crate::input::stage::{Range, Stage};
use crate::problem::Problem;
use crate::problem::model::Model;
use crate::problem::parameters::Parameters;
use crate::solve::least_squares::multistart::{middle_of_the_box, solve_from};
use crate::solve::{Projection, SolverOptions};
use runtime::ModelKind;

/// Rows that a hypothesis is tested on.
const ROWS: usize = 4000;
/// The fit within the search ranges may be worse than the free one by this factor ...
const WORSE_MAX: f64 = 1.3;
/// ... and this much, um.
const WORSE_MAX_UM: f64 = 0.05;
/// A named cause leaves less than this part of the motion unexplained.
const UNEXPLAINED_MAX: f64 = 0.1;
/// A probe's sensitivity shows where it stands if the vertical motion changes it by this much.
const CHANGE_MIN: f64 = 0.01;
/// How far outside the search range of its coordinates the vertical terms may put a probe, m.
const PLACE_MAX_M: f64 = 0.1;
/// Vertical motion below this (m or rad) shows no change of the sensitivity.
const VERTICAL_MIN: f64 = 20e-6;
/// How well the log fits, as it is or with a hypothesis undone.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Trial {
    /// rms over X, Y, Rz within the search ranges: um, um, urad.
    pub within_um: f64,
    /// The same with all parameters free.
    pub free_um: f64,
    /// The free parameters.
    pub free: Parameters,
    /// How far the vertical terms put a probe outside the search range of its place, m; infinite where
    /// the sensitivity rises with height against the search range. `None` where they show nothing.
    pub place_m: Option<f64>,
    /// Root mean square of the reference, each movement's mean taken off: um, um, urad.
    pub motion_um: f64,
}

impl Trial {
    /// Whether the search ranges hold the parameters.
    pub fn is_within(&self) -> bool {
        self.within_um <= WORSE_MAX * self.free_um + WORSE_MAX_UM
    }

    /// Whether the sensitivities follow the height at the probes.
    pub fn is_in_place(&self) -> bool {
        self.place_m.is_none_or(|place| place <= PLACE_MAX_M)
    }

    /// Whether the parameters are those of a stage like the designed one, and describe the log.
    pub fn fits(&self) -> bool {
        self.is_within() && self.is_in_place() && self.within_um <= UNEXPLAINED_MAX * self.motion_um
    }
}

/// A log with its stage, ready to be tried.
pub struct Trials<'a> {
    stage: &'a Stage,
    within: Problem<'a>,
    unlimited: &'a Stage,
    vertical_span: [f64; 3],
    has_codes: bool,
}

impl<'a> Trials<'a> {
    /// Of some rows of a dataset, evenly from each movement. `zeros_free` and `unlimited` are made of
    /// the stage by the functions of these names.
    pub fn new(
        dataset: &Dataset,
        stage: &'a Stage,
        zeros_free: &'a Stage,
        unlimited: &'a Stage,
    ) -> Self {
        let vertical_span = [0, 1, 2].map(|axis| {
            let values = || dataset.rows.iter().map(|row| row.vertical[axis]);
            let low = values().fold(f64::INFINITY, f64::min);
            0.5 * (values().fold(f64::NEG_INFINITY, f64::max) - low)
        });
        let moves = vertical_span.iter().all(|span| *span > VERTICAL_MIN);
        let model = Model::of(if moves {
            ModelKind::M31
        } else {
            ModelKind::M30
        });
        Self {
            stage,
            within: Problem::thinned_of(dataset, ROWS, zeros_free, model),
            unlimited,
            vertical_span,
            has_codes: dataset
                .rows
                .iter()
                .all(|row| row.frame.capacitive().is_some()),
        }
    }

    /// Whether the log holds capacitive codes, which may be exchanged or turned.
    pub const fn has_codes(&self) -> bool {
        self.has_codes
    }

    /// The rows that are fitted, as they are.
    pub const fn problem(&self) -> &Problem<'a> {
        &self.within
    }

    /// How well the log fits with a mistake undone, or as it is. `None` where it cannot be fitted
    /// at all, or with the mistake undone not so that this could be named.
    pub fn of(&self, hypothesis: Option<&Hypothesis>) -> Option<Trial> {
        let within = match hypothesis {
            Some(hypothesis) => hypothesis.applied(&self.within),
            None => self.within.clone(),
        };
        let options = SolverOptions::new(Projection::Linear, 1);
        let starts = [middle_of_the_box(&within)];
        let rms = |cost: f64| within.fitness(cost);
        let limited = solve_from(&starts, &within, &options);
        let within_um = limited.map_or(f64::INFINITY, |solution| rms(solution.cost));
        let motion_um = motion_um(&within);
        if hypothesis.is_some() && within_um > UNEXPLAINED_MAX * motion_um {
            return None;
        }
        let free = Problem {
            stage: self.unlimited,
            rows: within.rows.clone(),
            groups: within.groups.clone(),
            ..within
        };
        let free = solve_from(&starts, &free, &options).ok()?;
        Some(Trial {
            within_um,
            free_um: rms(free.cost),
            place_m: self.place_m(&free.parameters),
            free: free.parameters,
            motion_um,
        })
    }

    fn place_m(&self, parameters: &Parameters) -> Option<f64> {
        let sensitivity = parameters.sensitivity();
        let places = (0..3).filter_map(|probe| {
            let s = &sensitivity[probe];
            let [z, rx, ry] = self.vertical_span;
            let change =
                (s.per_z_m * z).abs() + (s.per_rx_rad * rx).abs() + (s.per_ry_rad * ry).abs();
            if change < CHANGE_MIN * s.eta.abs() {
                return None;
            }
            let a = s.per_z_m;
            let falls = self.stage.search.of("a_per_m").is_none_or(|ranges| {
                let Range { low, high } = ranges[probe];
                !(high <= 0.0 && a * s.eta.signum() > 0.0 || low >= 0.0 && a * s.eta.signum() < 0.0)
            });
            if !falls {
                return Some(f64::INFINITY);
            }
            let [x, y] = [-s.per_ry_rad / a, s.per_rx_rad / a];
            let [in_x, in_y] = place_ranges(self.stage)[probe];
            Some(outside(x, in_x).hypot(outside(y, in_y)))
        });
        places.max_by(f64::total_cmp)
    }
}

/// The search ranges of x and y of the probes A, B, C, m.
fn place_ranges(stage: &Stage) -> [[Range; 2]; 3] {
    let h = &stage.search.h_m;
    let left = Range {
        low: -h.h2x_m.high,
        high: -h.h2x_m.low,
    };
    [[h.h1x_m, h.h1y_m], [left, h.h2y_m], [h.h3x_m, h.h3y_m]]
}

fn outside(value: f64, range: Range) -> f64 {
    (value - range.clip(value)).abs()
}

/// Root mean square of the reference, each movement's mean taken off: um, um, urad.
fn motion_um(problem: &Problem) -> f64 {
    let mut sum = 0.0;
    for group in &problem.groups {
        let rows = &problem.rows[group.rows.clone()];
        for axis in 0..3 {
            let mean = rows.iter().map(|r| r.reference_um[axis]).sum::<f64>() / rows.len() as f64;
            let squares = rows.iter().map(|r| (r.reference_um[axis] - mean).powi(2));
            sum += squares.sum::<f64>();
        }
    }
    problem.fitness(sum)
}

/// The stage with ranges that hold every parameter.
pub fn unlimited(stage: &Stage) -> Stage {
    let wide = |half: f64| Range {
        low: -half,
        high: half,
    };
    let mut free = zeros_free(stage);
    let h = &mut free.search.h_m;
    for range in [
        &mut h.h1x_m,
        &mut h.h1y_m,
        &mut h.h2x_m,
        &mut h.h2y_m,
        &mut h.h3x_m,
        &mut h.h3y_m,
    ] {
        *range = wide(1e6);
    }
    for (key, half) in [
        ("eta", 1e9),
        ("theta_deg", 2.0),
        ("a_per_m", 1e9),
        ("b_per_rad", 1e9),
        ("c_per_rad", 1e9),
    ] {
        free.search.set(key, [wide(half); 3]);
    }
    free
}

/// The stage with zero deviations of any size.
pub fn zeros_free(stage: &Stage) -> Stage {
    let mut free = stage.clone();
    free.search.delta_m = Range {
        low: f64::NEG_INFINITY,
        high: f64::INFINITY,
    };
    free
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::hypothesis::{planar, vertical};
    use crate::input::shipped::STAGE_TOML;
    use crate::problem::model::SLOPES_MAX;
    use crate::problem::parameters::Parameters;
    use crate::problem::synthetic::Protocol;

    /// A log of Model (31) itself, of a stage as designed whose sensitivity follows the height at
    /// each probe, as `undo` would have to be applied to it.
    fn trials_of(undo: Option<&Hypothesis>) -> Vec<(String, Trial)> {
        let stage = Stage::from_toml(STAGE_TOML, "stage.toml".as_ref()).expect("sound");
        let (zeros_free, unlimited) = (zeros_free(&stage), unlimited(&stage));
        let h = &stage.designed;
        let places = [[h.h1x_m, h.h1y_m], [-h.h2x_m, h.h2y_m], [h.h3x_m, h.h3y_m]];
        let slopes = places.map(|[x, y]| {
            let mut slopes = [0.0; SLOPES_MAX];
            slopes[..3].copy_from_slice(&[-130.0, -130.0 * y, 130.0 * x]);
            slopes
        });
        let geometry = h.geometry([0.01, -0.02, 0.015]);
        let truth = Parameters::new(&geometry, [0.86, 0.74, 0.83], slopes);
        let dataset = Protocol::exact(truth, 8).dataset(&stage);
        let mut trials = Trials::new(&dataset, &stage, &zeros_free, &unlimited);
        if let Some(hypothesis) = undo {
            trials.within = hypothesis.applied(&trials.within);
        }
        let hypotheses = planar(&stage).into_iter().chain(vertical(&stage));
        let of = |hypothesis: Hypothesis| {
            let trial = trials.of(Some(&hypothesis))?;
            Some((hypothesis.cure, trial))
        };
        let plain = trials.of(None).map(|trial| (String::new(), trial));
        plain.into_iter().chain(hypotheses.filter_map(of)).collect()
    }

    /// Exchanges and turned signs undo themselves, so each is its own mistake.
    #[test]
    fn a_mistake_is_explained_by_itself_alone() {
        let stage = Stage::from_toml(STAGE_TOML, "stage.toml".as_ref()).expect("sound");
        let explaining = |undo: Option<&Hypothesis>| {
            let fitting = trials_of(undo)
                .into_iter()
                .filter(|(_, trial)| trial.fits());
            fitting.map(|(cure, _)| cure).collect::<Vec<_>>()
        };
        assert_eq!(explaining(None), [""]);
        let mistakes = [
            "Hall A and B are exchanged",
            "the sign of beam X is turned",
            "capacitive 2 and 3 are exchanged",
            "the signs of all capacitive channels are turned",
        ];
        let all: Vec<_> = planar(&stage).into_iter().chain(vertical(&stage)).collect();
        for cure in mistakes {
            let mistake = all.iter().find(|mistake| mistake.cure == cure);
            assert_eq!(explaining(Some(mistake.expect("a mistake"))), [cure]);
        }
    }
}
