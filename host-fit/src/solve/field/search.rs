//! The field model as the paper's search sees it: nine unknowns, the rest in closed form.
//!
//! Given a/eta, b/eta, c/eta of the probes, Model (31) follows in closed form ([`LinearCost`]).
//! At its poses the terms beyond it are linear, and so are small changes of lever arm, angle and
//! eta: one step of least squares with the prior, each probe for itself, with one offset for each
//! movement. The fitness is the rms of what is left of the Hall signals, um, the prior's
//! share included.

use super::blocks::FieldRow;
use super::parameters::FieldParameters;
use super::probe::{Probe, probes};
use super::terms::{ETA, LEVER_ARM, PER_PROBE, SLOPES, TERMS, THETA};
use crate::input::stage::Range;
use crate::problem::Problem;
use crate::problem::parameters::Parameters;
use crate::solve::objective::linear::LinearCost;
use crate::solve::search::cost::CostFunction;
use nalgebra::{Cholesky, SMatrix, SVector};

/// Parameters of a probe that a step changes: all but a, b, c, which keep their ratios to eta.
const STEP: usize = PER_PROBE - 3;
/// Place of eta among them.
const ETA_STEP: usize = ETA;

/// The fitness of the nine ratios.
#[derive(Clone, Debug)]
pub struct FieldCost<'a> {
    problem: &'a Problem<'a>,
    model_31: LinearCost<'a>,
    rows: Vec<FieldRow>,
    /// White noise of A, B, C, against which the prior weighs, mm.
    white_mm: [f64; 3],
}

/// Curvature and descent of a probe's step, and the squares before it.
struct Sums {
    curvature: SMatrix<f64, STEP, STEP>,
    descent: SVector<f64, STEP>,
    squares: f64,
}

impl<'a> FieldCost<'a> {
    /// The cost of the rows of a problem of Model (31), which are `rows` in its order; `None` as for
    /// [`LinearCost::new`].
    pub fn new(problem: &'a Problem<'a>, rows: Vec<FieldRow>, white_mm: [f64; 3]) -> Option<Self> {
        Some(Self {
            model_31: LinearCost::new(problem)?,
            problem,
            rows,
            white_mm,
        })
    }

    /// The first `count` individuals of a search: [`LinearCost::first_population`].
    pub fn first_population(&self, count: usize, seed: u64) -> Vec<Vec<f64>> {
        self.model_31.first_population(count, seed)
    }

    /// The fitness of the ratios of these parameters, um.
    pub fn fitness(&self, parameters: &Parameters) -> f64 {
        self.cost(&self.model_31.individual(parameters))
    }

    /// The parameters of an individual; `None` where they cannot be told.
    pub fn parameters(&self, individual: &[f64]) -> Option<FieldParameters> {
        Some(self.best(individual)?.0)
    }

    /// The best parameters for an individual and their sum of squares, mm^2.
    fn best(&self, individual: &[f64]) -> Option<(FieldParameters, f64)> {
        if self.model_31.cost(individual).is_nan() {
            return None;
        }
        let start = self.model_31.parameters(individual)?;
        let mut best = FieldParameters::of_model_31(&start, self.problem.stage);
        let mut squares = 0.0;
        for (k, probe) in probes(&best).iter().enumerate() {
            let sums = self.sums(probe, k, &best.probes[k]);
            let step = Cholesky::new(sums.curvature)?.solve(&sums.descent);
            squares += sums.squares - sums.descent.dot(&step);
            apply(&mut best.probes[k], &step);
        }
        Some((best, squares))
    }

    fn sums(&self, probe: &Probe, k: usize, values: &[f64; PER_PROBE]) -> Sums {
        let mut sums = Sums {
            curvature: SMatrix::zeros(),
            descent: SVector::zeros(),
            squares: 0.0,
        };
        let mut columns = Vec::with_capacity(self.rows.len());
        for group in &self.problem.groups {
            columns.clear();
            // An offset of the movement adds phi times a constant: it is projected out.
            let (mut by_offset, mut of_rest, mut offsets) = (SVector::zeros(), 0.0, 0.0);
            for row in &self.rows[group.rows.clone()] {
                let planar_mm = row.planar_mm(0.0, [0.0; 3]);
                let reading = probe.read(planar_mm, row.vertical);
                let by = step_columns(&reading.by_parameter, values);
                let rest = row.signal_mm[k] - reading.signal_mm;
                let phi = values[ETA]
                    + (0..3).fold(0.0, |sum, j| sum + values[SLOPES + j] * row.vertical[j]);
                by_offset += by * phi;
                of_rest += rest * phi;
                offsets += phi * phi;
                columns.push((by, rest, phi));
            }
            for (by, rest, phi) in &columns {
                let by = by - by_offset * (phi / offsets);
                let rest = rest - of_rest * (phi / offsets);
                sums.curvature.syger(1.0, &by, &by, 1.0);
                sums.descent += by * rest;
                sums.squares += rest * rest;
            }
        }
        for (place, term) in TERMS.iter().enumerate().skip(SLOPES + 3) {
            if let Some(deviation) = term.prior {
                let weight = self.white_mm[k] / deviation;
                sums.curvature[(place - 3, place - 3)] += weight * weight;
            }
        }
        sums.curvature.fill_upper_triangle_with_lower_triangle();
        sums
    }
}

/// Derivatives by what a step changes: lever arm, theta, eta with its slopes, then E and p.
fn step_columns(by: &[f64; PER_PROBE], values: &[f64; PER_PROBE]) -> SVector<f64, STEP> {
    let mut out = SVector::<f64, STEP>::zeros();
    out[LEVER_ARM] = by[LEVER_ARM];
    out[THETA] = by[THETA];
    let slopes = (SLOPES..SLOPES + 3).fold(0.0, |sum, j| sum + by[j] * values[j]);
    out[ETA_STEP] = by[ETA] + slopes / values[ETA];
    out.as_mut_slice()[ETA_STEP + 1..].copy_from_slice(&by[SLOPES + 3..]);
    out
}

/// Adds a step to a probe's parameters.
fn apply(values: &mut [f64; PER_PROBE], step: &SVector<f64, STEP>) {
    values[LEVER_ARM] += step[LEVER_ARM];
    values[THETA] += step[THETA];
    let scale = 1.0 + step[ETA_STEP] / values[ETA];
    for value in &mut values[ETA..SLOPES + 3] {
        *value *= scale;
    }
    for (value, change) in values[SLOPES + 3..]
        .iter_mut()
        .zip(&step.as_slice()[ETA_STEP + 1..])
    {
        *value += change;
    }
}

impl CostFunction for FieldCost<'_> {
    fn bounds(&self) -> &[Range] {
        self.model_31.bounds()
    }

    fn cost(&self, individual: &[f64]) -> f64 {
        let best = self.best(individual);
        best.map_or(f64::NAN, |(_, squares)| {
            1e3 * (squares.max(0.0) / (3.0 * self.rows.len() as f64)).sqrt()
        })
    }

    fn evaluation_ns(&self) -> f64 {
        1000.0 * self.rows.len() as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::problem::model::Model;
    use crate::solve::field::blocks::Rows;
    use crate::solve::field::sample::{Run, parameters, stage};
    use crate::solve::search::kind::{SearchKind, Settings};
    use crate::solve::search::run::{Start, StopCriteria};
    use runtime::ModelKind;

    /// SHTLBO comes to the truth as near as the noise lets it.
    #[test]
    fn the_paper_s_search_finds_the_field_model_through_nine_ratios() {
        let (stage, truth) = (stage(), parameters());
        let dataset = Run::EIGHT_SECONDS.dataset(&truth);
        let rows: Vec<usize> = (0..dataset.rows.len()).step_by(40).collect();
        let problem = Problem::new(&dataset, &rows, &stage, Model::of(ModelKind::M31));
        let field_rows = Rows::new(&dataset, &rows).rows;
        let cost = FieldCost::new(&problem, field_rows, [5e-4; 3]).expect("slopes");
        let at_truth = cost.fitness(&truth.model_31());
        assert!((0.4..0.55).contains(&at_truth), "{at_truth}");
        let mut other = cost.model_31.individual(&truth.model_31());
        other[4] *= 1.05;
        let far = cost.cost(&other);
        assert!(far > 1.01 * at_truth, "{far} {at_truth}");
        let settings = Settings {
            seed: 1,
            start: Start {
                population: 16,
                individuals: &cost.first_population(16, 1),
            },
            ..Settings::default()
        };
        let criteria = StopCriteria {
            evaluations: Some(2400),
            ..StopCriteria::default()
        };
        let found = SearchKind::Shtlbo.minimize(&cost, &settings, &criteria);
        assert!(found.cost < 1.01 * at_truth, "{} {at_truth}", found.cost);
        let found = cost.parameters(&found.best).expect("parameters");
        for (k, (found, truth)) in found.probes.iter().zip(truth.probes).enumerate() {
            assert!((found[ETA] / truth[ETA] - 1.0).abs() < 3e-3, "{k}");
            assert!((found[THETA] - truth[THETA]).abs() < 3e-3, "{k}");
        }
    }
}
