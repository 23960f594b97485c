//! CMA-ES, the (mu/mu_w, lambda) evolution strategy with covariance matrix adaptation, by N. Hansen's
//! tutorial (arXiv 1604.00772; its equation numbers below), made to stay inside the box.
//!
//! It searches the unit cube. A point outside is evaluated at the nearest point of the cube, and
//! its cost raised by the squared distance as a share, so that the search is drawn back. It
//! starts from the first individual given, or else from the middle of the box, with a step of 0.3
//! of the range.
//!
//! Sums are written out or nalgebra's own loops: its products of large matrices choose their
//! instructions by the processor, and with them the last bits of a result.

use crate::solve::search::population::{Breeding, Individual, Parents, improve};
use crate::solve::search::random::RandomSource;
use crate::solve::search::run::Start;
use hallstage_input::stage::Range;
use nalgebra::{DMatrix, DVector, SymmetricEigen};

/// Standard deviation of the first draws, as a share of the range.
const FIRST_STEP: f64 = 0.3;
/// Standard deviation, as a share of the range, below which nothing more is found.
const LAST_STEP: f64 = 1e-14;

/// A search by CMA-ES.
#[derive(Clone, Debug)]
pub struct Covariance {
    rates: Rates,
    mean: DVector<f64>,
    step: f64,
    covariance: DMatrix<f64>,
    /// Eigenvectors B and roots of the eigenvalues D of the covariance, as of some generations ago.
    axes: (DMatrix<f64>, DVector<f64>),
    /// The generation of which they are.
    axes_of: usize,
    /// The generation that was adapted to last.
    generation: usize,
    step_path: DVector<f64>,
    path: DVector<f64>,
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
pub struct Draw {
    /// Its distance from the mean over the step: y of (39).
    y: DVector<f64>,
    /// Squared length of the normal numbers that it was made of.
    length: f64,
    /// Squared distance from the cube.
    outside: f64,
}

impl Covariance {
    /// Before its first generation in the box.
    pub fn new(bounds: &[Range], start: &Start<'_>) -> Self {
        let n = bounds.len();
        let given = start.individuals.first().filter(|x| x.len() == n);
        let share = |i: usize| {
            let (range, given) = (bounds[i], given?[i]);
            Some((range.clip(given) - range.low) / range.width()).filter(|share| share.is_finite())
        };
        Self {
            rates: Rates::new(n, start.population.max(Self::SIZE_MIN)),
            mean: DVector::from_fn(n, |i, _| share(i).unwrap_or(0.5)),
            step: FIRST_STEP,
            covariance: DMatrix::identity(n, n),
            axes: (DMatrix::identity(n, n), DVector::repeat(n, 1.0)),
            axes_of: 0,
            generation: 0,
            step_path: DVector::zeros(n),
            path: DVector::zeros(n),
        }
    }

    /// Moves mean, step and covariance towards the best draws, the best one first.
    fn adapt(&mut self, draws: &[&Draw]) {
        self.generation += 1;
        let (rates, n) = (&self.rates, self.mean.len());
        let mut y_mean = DVector::<f64>::zeros(n);
        for (weight, draw) in rates.weights[..rates.mu].iter().zip(draws) {
            y_mean.axpy(*weight, &draw.y, 1.0);
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
        let settled = (1.0 - libm::pow(keep, 2.0 * (self.generation as f64 + 1.0))).sqrt();
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
            self.covariance
                .ger(rates.c_mu * weight, &draw.y, &draw.y, 1.0);
        }
        // Section B.2: the eigenvectors may be a little old.
        let old = (self.generation - self.axes_of) as f64 * 10.0 * n as f64;
        if old * (rates.c_1 + rates.c_mu) >= 1.0 {
            let eigen = SymmetricEigen::new(self.covariance.clone());
            let roots = eigen.eigenvalues.map(|value| value.max(0.0).sqrt());
            self.axes = (eigen.eigenvectors, roots);
            self.axes_of = self.generation;
        }
    }
}

impl Breeding for Covariance {
    type Note = Draw;

    const SIZE_MIN: usize = 4;

    fn make(&self, parents: Parents<'_>, random: &mut impl RandomSource, new: &mut [f64]) -> Draw {
        let (axes, roots) = &self.axes;
        let mut z = DVector::zeros(new.len());
        random.fill_normal(z.as_mut_slice());
        let length = z.norm_squared();
        z.component_mul_assign(roots);
        let mut y = DVector::zeros(new.len());
        y.gemv(1.0, axes, &z, 0.0); // (39)
        let mut outside = 0.0;
        for (i, (to, range)) in new.iter_mut().zip(parents.bounds).enumerate() {
            let share = self.mean[i] + self.step * y[i];
            let inside = share.clamp(0.0, 1.0);
            outside += (share - inside) * (share - inside);
            *to = range.low + inside * range.width();
        }
        Draw { y, length, outside }
    }

    fn select(
        &mut self,
        population: &mut [Individual],
        candidates: &mut [Individual],
        draws: &[Draw],
        _: &[Range],
    ) {
        let raised = |k: usize| candidates[k].cost + draws[k].outside * candidates[k].cost.abs();
        let mut ranks: Vec<usize> = (0..candidates.len()).collect();
        ranks.sort_by(|&a, &b| raised(a).total_cmp(&raised(b)));
        // In the order of `total_cmp` a NaN with its sign bit set comes first.
        ranks.sort_by_key(|&k| candidates[k].cost.is_nan());
        let ranked: Vec<&Draw> = ranks.iter().map(|&k| &draws[k]).collect();
        self.adapt(&ranked);
        improve(population, candidates);
    }

    fn end(&mut self, _: usize) -> bool {
        let widest = self.step * self.axes.1.max();
        widest.is_finite() && widest > LAST_STEP
    }
}
