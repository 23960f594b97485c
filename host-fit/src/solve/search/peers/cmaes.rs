//! CMA-ES, the (mu/mu_w, lambda) evolution strategy with covariance matrix adaptation, by N. Hansen's
//! tutorial (arXiv 1604.00772; its equation numbers below), made to stay inside the box.
//!
//! It searches the unit cube. A point outside is evaluated at the nearest point of the cube, and
//! its cost raised by the squared distance as a share, so that the search is drawn back. It
//! starts from the first given individual, or else from the middle of the box, with a step of
//! 0.3 of the range.
//!
//! Sums are written out or nalgebra's own loops: its products of large matrices choose their
//! instructions by the processor, and with them the last bits of a result.

use crate::input::stage::Range;
use crate::solve::search::cost::{CostFunction, Evaluator, clip, ranks_before};
use crate::solve::search::random::{Phase, RandomSource, RandomStreams};
use crate::solve::search::run::{Method, Start};
use nalgebra::{DMatrix, DVector, SymmetricEigen};

/// Standard deviation of the first draws, as a share of the range.
const FIRST_STEP: f64 = 0.3;
/// Standard deviation, as a share of the range, below which nothing more is found.
const LAST_STEP: f64 = 1e-14;
/// Individuals of a generation, at least.
const LAMBDA_MIN: usize = 4;

/// A search by CMA-ES.
#[derive(Clone, Debug)]
pub struct Covariance<S> {
    streams: S,
    lambda: usize,
    rates: Rates,
    mean: DVector<f64>,
    step: f64,
    covariance: DMatrix<f64>,
    /// Eigenvectors B and roots of the eigenvalues D of the covariance, as of some generations ago.
    axes: (DMatrix<f64>, DVector<f64>),
    /// The generation of which they are.
    axes_of: usize,
    step_path: DVector<f64>,
    path: DVector<f64>,
    best: (Vec<f64>, f64),
}

/// Weights and learning rates, by Table 1 of the tutorial.
#[derive(Clone, Debug)]
struct Rates {
    /// Of the ranks: the first half positive, with a sum of 1, the rest negative.
    weights: Vec<f64>,
    mu: usize,
    mu_eff: f64,
    c_sigma: f64,
    d_sigma: f64,
    c_c: f64,
    c_1: f64,
    c_mu: f64,
    /// Mean length of a standard normal vector.
    chi: f64,
}

impl Rates {
    fn new(dimensions: usize, lambda: usize) -> Self {
        let n = dimensions as f64;
        let mut weights: Vec<f64> = (1..=lambda)
            .map(|rank| libm::log((lambda as f64 + 1.0) / 2.0) - libm::log(rank as f64))
            .collect();
        let mu = lambda / 2;
        let (best, rest) = weights.split_at_mut(mu);
        let mu_eff = effective(best);
        let mu_eff_rest = effective(rest);
        let c_sigma = (mu_eff + 2.0) / (n + mu_eff + 5.0);
        let spread = ((mu_eff - 1.0) / (n + 1.0)).max(0.0).sqrt() - 1.0;
        let c_1 = 2.0 / ((n + 1.3) * (n + 1.3) + mu_eff);
        let c_mu = 2.0 * (mu_eff - 2.0 + 1.0 / mu_eff) / ((n + 2.0) * (n + 2.0) + mu_eff);
        let c_mu = c_mu.min(1.0 - c_1);
        let sum: f64 = best.iter().sum();
        best.iter_mut().for_each(|weight| *weight /= sum);
        let lost: f64 = rest.iter().sum();
        let most = (1.0 + c_1 / c_mu)
            .min(1.0 + 2.0 * mu_eff_rest / (mu_eff + 2.0))
            .min((1.0 - c_1 - c_mu) / (n * c_mu));
        rest.iter_mut().for_each(|weight| *weight *= most / -lost);
        Self {
            mu,
            mu_eff,
            c_sigma,
            d_sigma: 1.0 + 2.0 * spread.max(0.0) + c_sigma,
            c_c: (4.0 + mu_eff / n) / (n + 4.0 + 2.0 * mu_eff / n),
            c_1,
            c_mu,
            chi: n.sqrt() * (1.0 - 1.0 / (4.0 * n) + 1.0 / (21.0 * n * n)),
            weights,
        }
    }
}

/// How many equal weights would vary as little.
fn effective(weights: &[f64]) -> f64 {
    let (sum, squares) = weights.iter().fold((0.0, 0.0), |(sum, squares), weight| {
        (sum + weight, squares + weight * weight)
    });
    sum * sum / squares
}

/// A candidate before it is put into the cube.
#[derive(Clone, Debug, Default)]
struct Draw {
    /// Its distance from the mean over the step: y of (39).
    y: Vec<f64>,
    /// Squared length of the normal numbers that it was made of.
    length: f64,
    /// Squared distance from the cube.
    outside: f64,
}

impl<S: RandomStreams> Covariance<S> {
    /// Evaluates the start. `start.population` is lambda, at least four.
    pub fn new<F: CostFunction + ?Sized>(
        streams: S,
        evaluator: &mut Evaluator<'_, F>,
        start: &Start<'_>,
    ) -> Self {
        let bounds = evaluator.function.bounds();
        let n = bounds.len();
        let middle = || bounds.iter().map(|r| r.low + 0.5 * r.width()).collect();
        let given = start.individuals.first().filter(|x| x.len() == n);
        let mut first: Vec<f64> = given.cloned().unwrap_or_else(middle);
        clip(&mut first, bounds);
        let cost = evaluator.function.cost(&first);
        evaluator.evaluations += 1;
        evaluator.nan_costs += usize::from(cost.is_nan());
        let lambda = start.population.max(LAMBDA_MIN);
        Self {
            streams,
            lambda,
            rates: Rates::new(n, lambda),
            mean: DVector::from_iterator(n, first.iter().zip(bounds).map(to_unit)),
            step: FIRST_STEP,
            covariance: DMatrix::identity(n, n),
            axes: (DMatrix::identity(n, n), DVector::repeat(n, 1.0)),
            axes_of: 0,
            step_path: DVector::zeros(n),
            path: DVector::zeros(n),
            best: (first, cost),
        }
    }

    /// Moves mean, step and covariance towards the best draws, the best one first.
    fn adapt(&mut self, generation: usize, draws: &[&Draw]) {
        let (rates, n) = (&self.rates, self.mean.len());
        let mut y_mean = DVector::<f64>::zeros(n);
        for (weight, draw) in rates.weights[..rates.mu].iter().zip(draws) {
            for (to, y) in y_mean.iter_mut().zip(&draw.y) {
                *to += weight * y;
            }
        }
        self.mean.axpy(self.step, &y_mean, 1.0); // (42)
        let (axes, roots) = &self.axes;
        let mut whitened = axes.tr_mul(&y_mean);
        whitened.component_div_assign(roots);
        let keep = 1.0 - rates.c_sigma;
        let push = (rates.c_sigma * (2.0 - rates.c_sigma) * rates.mu_eff).sqrt();
        self.step_path.gemv(push, axes, &whitened, keep); // (43)
        let length = self.step_path.norm();
        self.step *= libm::exp(rates.c_sigma / rates.d_sigma * (length / rates.chi - 1.0)); // (44)
        // The path stops while the step grows fast: h_sigma.
        let settled = (1.0 - libm::pow(keep, 2.0 * (generation as f64 + 1.0))).sqrt();
        let slow = length / settled < (1.4 + 2.0 / (n as f64 + 1.0)) * rates.chi;
        let push = match slow {
            true => (rates.c_c * (2.0 - rates.c_c) * rates.mu_eff).sqrt(),
            false => 0.0,
        };
        self.path.axpy(push, &y_mean, 1.0 - rates.c_c); // (45)
        let lost = match slow {
            true => 0.0,
            false => rates.c_1 * rates.c_c * (2.0 - rates.c_c),
        };
        let sum: f64 = rates.weights.iter().sum();
        self.covariance *= 1.0 - rates.c_1 - rates.c_mu * sum + lost; // (47)
        self.covariance.ger(rates.c_1, &self.path, &self.path, 1.0);
        for (weight, draw) in rates.weights.iter().zip(draws) {
            // (46): a bad draw counts by its direction only.
            let weight = match *weight < 0.0 {
                true => weight * n as f64 / draw.length,
                false => *weight,
            };
            let y = DVector::from_column_slice(&draw.y);
            self.covariance.ger(rates.c_mu * weight, &y, &y, 1.0);
        }
        // Section B.2: the eigenvectors may be a little old.
        let old = (generation - self.axes_of) as f64 * 10.0 * n as f64;
        if old * (rates.c_1 + rates.c_mu) >= 1.0 {
            let eigen = SymmetricEigen::new(self.covariance.clone());
            let roots = eigen.eigenvalues.map(|value| value.max(0.0).sqrt());
            self.axes = (eigen.eigenvectors, roots);
            self.axes_of = generation;
        }
    }
}

/// A number of an individual as a share of its range.
fn to_unit((x, range): (&f64, &Range)) -> f64 {
    let share = (x - range.low) / range.width();
    if share.is_finite() { share } else { 0.0 }
}

impl<F: CostFunction + ?Sized, S: RandomStreams> Method<F> for Covariance<S> {
    fn generation(&mut self, generation: usize, evaluator: &mut Evaluator<'_, F>) -> bool {
        let (bounds, n) = (evaluator.function.bounds(), self.mean.len());
        let mut candidates = vec![0.0; self.lambda * n];
        let mut costs = vec![0.0; self.lambda];
        let mut draws = vec![Draw::default(); self.lambda];
        let (axes, roots) = &self.axes;
        evaluator.breed(&mut candidates, &mut costs, &mut draws, |k, place| {
            let mut z = DVector::zeros(n);
            let mut source = self.streams.stream(generation, Phase::Teacher, k);
            source.fill_normal(z.as_mut_slice());
            let length = z.norm_squared();
            z.component_mul_assign(roots);
            let mut y = DVector::zeros(n);
            y.gemv(1.0, axes, &z, 0.0); // (39)
            let mut outside = 0.0;
            for (i, (to, range)) in place.iter_mut().zip(bounds).enumerate() {
                let share = self.mean[i] + self.step * y[i];
                let inside = share.clamp(0.0, 1.0);
                outside += (share - inside) * (share - inside);
                *to = range.low + inside * range.width();
            }
            let y = y.as_slice().to_vec();
            Draw { y, length, outside }
        });
        for (individual, cost) in candidates.chunks_exact(n.max(1)).zip(&costs) {
            if ranks_before(*cost, self.best.1) {
                self.best = (individual.to_vec(), *cost);
            }
        }
        let raised = |k: usize| costs[k] + draws[k].outside * costs[k].abs();
        let mut ranks: Vec<usize> = (0..self.lambda).collect();
        ranks.sort_by(|&a, &b| raised(a).total_cmp(&raised(b)));
        // In the order of `total_cmp` a NaN with its sign bit set comes first.
        ranks.sort_by_key(|&k| costs[k].is_nan());
        let ranked: Vec<&Draw> = ranks.iter().map(|&k| &draws[k]).collect();
        self.adapt(generation, &ranked);
        let widest = self.step * self.axes.1.max();
        widest.is_finite() && widest > LAST_STEP
    }

    fn best(&self) -> (&[f64], f64) {
        (&self.best.0, self.best.1)
    }
}
