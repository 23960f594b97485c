//! Which mistake alone explains a log: each [`Hypothesis`] is undone and the log fitted again.
//!
//! Every mistake with order, sign or scale is a linear change of the Hall signals, of the reference
//! or of the vertical pose, and Model (31) with free parameters absorbs it: the residual stays that
//! of the sound log. What gives it away is where the parameters end up. So a hypothesis explains
//! the log if, undone, the fit within the search ranges of `stage.toml` is as good as the fit without
//! them, and the vertical terms put each probe where it stands: phi falls with the height at the
//! probe, a (Z + y Rx - x Ry), so that b/a = y and c/a = -x.

use super::finding::{Code, Finding, Severity};
use super::hypothesis::{Hypothesis, Scale, planar, scale, vertical};
use super::zeros;
use crate::input::dataset::{Dataset, Row};
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
/// Scales within this factor of the designed ones are no mistake but tolerances.
const FACTOR_MIN: f64 = 1.4;
/// Factors beyond this are a unit, not a scale.
const FACTOR_OF_UNITS: f64 = 30.0;

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

/// What keeps a log from being fitted as it is: the mistake that alone explains it, with severity
/// [`Severity::Refuse`], or that there is none that does.
pub fn causes(dataset: &Dataset, stage: &Stage) -> Vec<Finding> {
    let (zeros_free, unlimited) = (zeros_free(stage), unlimited(stage));
    let trials = Trials::new(dataset, stage, &zeros_free, &unlimited);
    let Some(plain) = trials.of(None) else {
        return Vec::new();
    };
    let mut findings: Vec<Finding> = zeros::clipped(dataset, stage, trials.problem(), &plain.free)
        .into_iter()
        .collect();
    if plain.fits() {
        return findings;
    }
    let mut hypotheses = planar(stage);
    if trials.has_codes {
        hypotheses.extend(vertical(stage));
    }
    hypotheses.extend(scales(dataset, stage, &plain.free));
    let mut explaining: Vec<(&Hypothesis, Trial)> = (hypotheses.iter())
        .filter_map(|hypothesis| Some((hypothesis, trials.of(Some(hypothesis))?)))
        .filter(|(_, trial)| trial.fits())
        .collect();
    // The same change under two names is one.
    explaining.dedup_by(|(later, _), (earlier, _)| later.is_same_change(earlier));
    findings.extend(match explaining.as_slice() {
        [] => unexplained(&plain),
        [(hypothesis, trial)] => Some(named(dataset, stage, hypothesis, &plain, trial)),
        several => Some(Finding {
            severity: Severity::Refuse,
            message: format!(
                "the log does not fit as it is ({:.2} um rms within the search ranges, {:.2} um without them), and fits if {}:                  it cannot tell which. {WIRES_AND_STAGE}",
                plain.within_um,
                plain.free_um,
                several
                    .iter()
                    .map(|(hypothesis, trial)| format!("{} ({:.2} um)", hypothesis.cure, trial.within_um))
                    .collect::<Vec<_>>()
                    .join(", or if ")
            ),
            ..finding(Code::TermsAtLimit)
        }),
    });
    findings
}

const WIRES_AND_STAGE: &str = "Check wiring, columns and stage.toml";

fn finding(code: Code) -> Finding {
    Finding {
        code,
        severity: Severity::Warn,
        message: String::new(),
        channel: None,
        movement: None,
        t_us: None,
        value: None,
        unit: None,
    }
}

fn named(
    dataset: &Dataset,
    stage: &Stage,
    hypothesis: &Hypothesis,
    plain: &Trial,
    trial: &Trial,
) -> Finding {
    let as_it_is = match plain.place_m {
        Some(place) if place > PLACE_MAX_M && plain.within_um <= WORSE_MAX * plain.free_um => {
            "as it is, the sensitivity does not follow the height at the probes".to_owned()
        }
        _ if plain.within_um.is_finite() => {
            format!("as it is, {:.2} um are left", plain.within_um)
        }
        _ => "as it is, not at all".to_owned(),
    };
    let span = if hypothesis.factor.is_some() {
        format!(
            "; the reference spans {}, the Hall signals {}, and {} is the range of service",
            length(span_m(dataset, |row| row.reference)),
            length(span_m(dataset, |row| row.signal_m)),
            length(
                2.0 * stage.motion.axes[0]
                    .service
                    .max(stage.motion.axes[1].service)
            ),
        )
    } else {
        String::new()
    };
    Finding {
        severity: Severity::Refuse,
        message: format!(
            "the log fits if {} ({:.2} um rms; {as_it_is}{span}): {}",
            hypothesis.cure, trial.within_um, hypothesis.remedy
        ),
        channel: hypothesis.channel.clone(),
        value: Some(hypothesis.factor.unwrap_or(trial.within_um)),
        unit: Some(if hypothesis.factor.is_some() {
            ""
        } else {
            "um"
        }),
        ..finding(hypothesis.code)
    }
}

/// A fit that needs more room than the search ranges give, for no reason that could be named.
fn unexplained(plain: &Trial) -> Option<Finding> {
    let message = if plain.within_um > WORSE_MAX * plain.free_um + WORSE_MAX_UM {
        format!(
            "within the search ranges of stage.toml the log fits to {:.2} um rms, without them to {:.2} um, and no single              mistake with channels, signs or scales explains it: check the designed values and the ranges in stage.toml",
            plain.within_um, plain.free_um
        )
    } else if plain.place_m.is_some_and(|place| place > PLACE_MAX_M) {
        "the sensitivity of a probe does not follow the height at the place where stage.toml has it, and no single mistake          with the capacitive sensors explains it: check their order, signs and places, and the coordinates of the probes"
            .to_owned()
    } else {
        return None;
    };
    Some(Finding {
        message,
        value: Some(plain.within_um),
        unit: Some("um"),
        ..finding(Code::TermsAtLimit)
    })
}

/// The scales that the free parameters, which absorb them, show to be wrong.
fn scales(dataset: &Dataset, stage: &Stage, free: &Parameters) -> Vec<Hypothesis> {
    let mut out = Vec::new();
    let eta = free.eta().map(f64::abs);
    if let Some(ranges) = stage.search.of("eta") {
        let ratio = |k: usize| eta[k] / (0.5 * (ranges[k].low + ranges[k].high));
        let product = ratio(0) * ratio(1) * ratio(2);
        let too_large = rounded(product.cbrt());
        if is_scale(too_large) {
            let off = |span_m: f64| {
                let range = stage.motion.axes[0]
                    .service
                    .max(stage.motion.axes[1].service);
                (span_m / (2.0 * range)).ln().abs()
            };
            let reference = off(span_m(dataset, |row| row.reference));
            let is_unit = !(1.0 / FACTOR_OF_UNITS..FACTOR_OF_UNITS).contains(&too_large);
            if is_unit && reference > off(span_m(dataset, |row| row.signal_m)) {
                out.push(scale(Scale::Reference, too_large));
            } else {
                out.push(scale(Scale::Hall, 1.0 / too_large));
            }
        }
    }
    let arms = free.geometry().lever_arm_m;
    let designed = Parameters::designed(stage).geometry().lever_arm_m;
    let squares: f64 = designed.iter().map(|arm| arm * arm).sum();
    let product: f64 = arms.iter().zip(designed).map(|(arm, d)| arm * d).sum();
    let too_large = rounded(product / squares);
    if is_scale(too_large) {
        out.push(scale(Scale::Baseline, too_large));
    }
    out
}

fn is_scale(factor: f64) -> bool {
    factor.is_normal() && factor > 0.0 && !(1.0 / FACTOR_MIN..FACTOR_MIN).contains(&factor)
}

/// The power of ten, two or a half that lies within a third of the factor, else the factor itself.
fn rounded(factor: f64) -> f64 {
    let powers = (-12..=12).map(|power| 10f64.powi(power));
    let near = |round: &f64| (0.75..1.33).contains(&(factor / round));
    powers.chain([0.5, 2.0]).find(near).unwrap_or(factor)
}

/// The largest span of X and Y, or of the three probes, within a movement, m.
fn span_m(dataset: &Dataset, of: impl Fn(&Row) -> [f64; 3]) -> f64 {
    let mut span = 0.0f64;
    for movement in &dataset.movements {
        for axis in 0..2 {
            let values = || {
                dataset.rows[movement.rows.clone()]
                    .iter()
                    .map(|row| of(row)[axis])
            };
            let low = values().fold(f64::INFINITY, f64::min);
            let high = values().fold(f64::NEG_INFINITY, f64::max);
            span = span.max(high - low);
        }
    }
    span
}

/// A length in words, in the unit that suits it.
fn length(m: f64) -> String {
    match m {
        m if m < 1e-3 => format!("{:.1} um", m * 1e6),
        m if m < 1.0 => format!("{:.1} mm", m * 1e3),
        m => format!("{m:.1} m"),
    }
}

impl Trial {
    /// Whether the parameters are those of a stage like the designed one.
    pub fn fits(&self) -> bool {
        self.within_um <= WORSE_MAX * self.free_um + WORSE_MAX_UM
            && self.place_m.is_none_or(|place| place <= PLACE_MAX_M)
            && self.within_um <= UNEXPLAINED_MAX * self.motion_um
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
        let mut vertical_span = [0.0f64; 3];
        for axis in 0..3 {
            let values = || dataset.rows.iter().map(|row| row.vertical[axis]);
            let (low, high) = values().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| {
                (l.min(x), h.max(x))
            });
            vertical_span[axis] = 0.5 * (high - low);
        }
        let moves = vertical_span.iter().all(|span| *span > VERTICAL_MIN);
        let model = Model::of(if moves {
            ModelKind::M31
        } else {
            ModelKind::M30
        });
        let all: Vec<usize> = (0..dataset.rows.len()).collect();
        Self {
            stage,
            within: Problem::new(dataset, &all, zeros_free, model).thinned(ROWS),
            unlimited,
            vertical_span,
            has_codes: dataset
                .rows
                .iter()
                .all(|row| row.frame.capacitive().is_some()),
        }
    }

    /// The rows that are fitted, as they are.
    pub const fn problem(&self) -> &Problem<'a> {
        &self.within
    }

    /// How well the log fits with a mistake undone, or as it is. `None` where it cannot be fitted
    /// at all.
    pub fn of(&self, hypothesis: Option<&Hypothesis>) -> Option<Trial> {
        let within = match hypothesis {
            Some(hypothesis) => hypothesis.applied(&self.within),
            None => self.within.clone(),
        };
        let options = SolverOptions::new(Projection::Linear, 1);
        let starts = [middle_of_the_box(&within)];
        let rms = |cost: f64| within.fitness(cost);
        let limited = solve_from(&starts, &within, &options);
        let free = Problem {
            stage: self.unlimited,
            rows: within.rows.clone(),
            groups: within.groups.clone(),
            ..within
        };
        let free = solve_from(&starts, &free, &options).ok()?;
        Some(Trial {
            within_um: limited.map_or(f64::INFINITY, |solution| rms(solution.cost)),
            free_um: rms(free.cost),
            place_m: self.place_m(&free.parameters),
            free: free.parameters,
            motion_um: motion_um(&within),
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
