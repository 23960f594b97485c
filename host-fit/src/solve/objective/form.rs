//! The three forms behind one type.

use super::delta::DeltaCost;
use super::full::FullCost;
use super::linear::LinearCost;
use crate::problem::Problem;
use crate::problem::parameters::Parameters;
use crate::solve::Projection;
use crate::solve::least_squares::coordinates::point_of;
use crate::solve::least_squares::multistart::zero_deviations;
use crate::solve::search::cost::CostFunction;

/// The fitness of a problem in one of its forms.
#[derive(Clone, Debug)]
pub enum Form<'a> {
    /// The paper's unknowns.
    Full(FullCost<'a>),
    /// Zero deviations in closed form.
    Delta(DeltaCost<'a>),
    /// Gain and offsets in closed form.
    Linear(LinearCost<'a>),
}

impl<'a> Form<'a> {
    /// The form of a problem that a projection asks for; `None` where it has no unknowns left
    /// to search for: `linear` of a model without slopes.
    pub fn new(problem: &'a Problem<'a>, projection: Projection) -> Option<Self> {
        match projection {
            Projection::None => Some(Self::Full(FullCost::new(problem))),
            Projection::Delta => Some(Self::Delta(DeltaCost::new(problem))),
            Projection::Linear => LinearCost::new(problem).map(Self::Linear),
        }
    }

    /// The form as a cost function of its unknowns.
    pub fn cost_function(&self) -> &dyn CostFunction {
        match self {
            Self::Full(cost) => cost,
            Self::Delta(cost) => cost,
            Self::Linear(cost) => cost,
        }
    }

    /// The parameters of an individual; `None` where its best gain is singular.
    pub fn parameters(&self, individual: &[f64]) -> Option<Parameters> {
        match self {
            Self::Full(cost) => Some(cost.parameters(individual)),
            Self::Delta(cost) => Some(cost.parameters(individual)),
            Self::Linear(cost) => cost.parameters(individual),
        }
    }

    /// The zero deviations that an individual holds, m for each movement of the log; `None` in
    /// the forms that solve for them.
    pub fn own_delta_m(&self, individual: &[f64]) -> Option<Vec<[f64; 3]>> {
        match self {
            Self::Full(cost) => Some(cost.delta_m(individual)),
            Self::Delta(_) | Self::Linear(_) => None,
        }
    }

    /// An individual with these parameters, for a warm start; the full form's zero deviations
    /// are the best for them.
    pub fn individual(&self, parameters: &Parameters, problem: &Problem<'_>) -> Vec<f64> {
        match self {
            Self::Full(cost) => cost.individual(parameters, &best_delta_m(problem, parameters)),
            Self::Delta(cost) => cost.individual(parameters),
            Self::Linear(cost) => cost.individual(parameters),
        }
    }

    /// The first individuals of a search, as far as the form has a better idea than uniform
    /// draws from the box: only `linear` has one.
    pub fn first_population(&self, count: usize, seed: u64) -> Vec<Vec<f64>> {
        match self {
            Self::Full(_) | Self::Delta(_) => Vec::new(),
            Self::Linear(cost) => cost.first_population(count, seed),
        }
    }
}

/// The best zero deviation of each movement of the log within its range, m; zero for movements
/// without rows and where the parameters have no pose.
pub fn best_delta_m(problem: &Problem<'_>, parameters: &Parameters) -> Vec<[f64; 3]> {
    let Some(point) = point_of(parameters) else {
        return vec![[0.0; 3]; problem.movements];
    };
    let zeros = zero_deviations(problem, parameters, &point);
    zeros.iter().map(|zero| zero.delta_m).collect()
}
