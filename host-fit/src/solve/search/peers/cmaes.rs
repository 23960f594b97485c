//! CMA-ES by the `cmaes` crate, made to stay inside the box.
//!
//! The crate searches an unbounded space. Here it works on the unit cube: a point outside is
//! evaluated at the nearest point of the cube, and its cost raised by the squared distance as
//! a share, so that the search is drawn back. It starts from the first given individual, or
//! else from the middle of the box, with a step of 0.3 of the range.

use crate::input::stage::Range;
use crate::solve::search::cost::{CostFunction, Evaluator, clip, ranks_before};
use crate::solve::search::random::{Phase, RandomSource, RandomStreams};
use crate::solve::search::run::{Method, Start};
use ::cmaes::{CMAES, CMAESOptions, DVector};
use std::cell::RefCell;
use std::rc::Rc;

/// Standard deviation of the first draws, as a share of the range.
const FIRST_STEP: f64 = 0.3;
/// Stands for NaN, which the crate refuses.
const NO_COST: f64 = 1e300;

type Objective<'f> = Box<dyn FnMut(&DVector<f64>) -> f64 + 'f>;

/// What the objective notes, since the crate sees only scaled points and raised costs.
#[derive(Debug)]
struct Noted {
    best: Vec<f64>,
    cost: f64,
    evaluations: usize,
    nan_costs: usize,
}

/// A search by CMA-ES. Candidates are evaluated one at a time: the crate asks for them so.
pub struct Covariance<'f> {
    state: Option<CMAES<Objective<'f>>>,
    noted: Rc<RefCell<Noted>>,
    best: Vec<f64>,
    cost: f64,
}

impl<'f> Covariance<'f> {
    /// Evaluates the start. `start.population` is lambda, at least four.
    pub fn new<F: CostFunction + ?Sized, S: RandomStreams>(
        streams: S,
        evaluator: &mut Evaluator<'f, F>,
        start: &Start<'_>,
    ) -> Self {
        let function = evaluator.function;
        let bounds = function.bounds();
        let middle = || bounds.iter().map(|r| r.low + 0.5 * r.width()).collect();
        let given = start
            .individuals
            .first()
            .filter(|x| x.len() == bounds.len());
        let mut first: Vec<f64> = given.cloned().unwrap_or_else(middle);
        clip(&mut first, bounds);
        let scaled: Vec<f64> = first.iter().zip(bounds).map(to_unit).collect();
        let cost = function.cost(&first);
        evaluator.evaluations += 1;
        evaluator.nan_costs += usize::from(cost.is_nan());
        let noted = Rc::new(RefCell::new(Noted {
            best: first.clone(),
            cost,
            evaluations: 0,
            nan_costs: 0,
        }));
        // Seeds are whole numbers; 53 bits of the stream are as good as any.
        let seed = streams.stream(0, Phase::Start, 0).uniform() * 2f64.powi(53);
        let state = CMAESOptions::new(scaled, FIRST_STEP)
            .population_size(start.population.max(4))
            .seed(seed as u64)
            .parallel_update(false)
            .build(objective(function, Rc::clone(&noted)))
            .ok();
        Self {
            state,
            noted,
            best: first,
            cost,
        }
    }
}

/// A number of an individual as a share of its range.
fn to_unit((x, range): (&f64, &Range)) -> f64 {
    let share = (x - range.low) / range.width();
    if share.is_finite() { share } else { 0.0 }
}

fn objective<'f, F: CostFunction + ?Sized>(
    function: &'f F,
    noted: Rc<RefCell<Noted>>,
) -> Objective<'f> {
    let bounds = function.bounds();
    Box::new(move |scaled| {
        let mut outside = 0.0;
        let mut individual: Vec<f64> = Vec::with_capacity(bounds.len());
        for (share, range) in scaled.iter().zip(bounds) {
            let inside = share.clamp(0.0, 1.0);
            outside += (share - inside) * (share - inside);
            individual.push(range.low + inside * range.width());
        }
        clip(&mut individual, bounds);
        let cost = function.cost(&individual);
        let mut noted = noted.borrow_mut();
        noted.evaluations += 1;
        noted.nan_costs += usize::from(cost.is_nan());
        if ranks_before(cost, noted.cost) {
            noted.cost = cost;
            noted.best = individual;
        }
        let raised = cost + outside * cost.abs();
        if raised < NO_COST { raised } else { NO_COST }
    })
}

impl<F: CostFunction + ?Sized> Method<F> for Covariance<'_> {
    fn generation(&mut self, _: usize, evaluator: &mut Evaluator<'_, F>) -> bool {
        let ended = self
            .state
            .as_mut()
            .is_none_or(|state| state.next().is_some());
        let mut noted = self.noted.borrow_mut();
        evaluator.evaluations += core::mem::take(&mut noted.evaluations);
        evaluator.nan_costs += core::mem::take(&mut noted.nan_costs);
        self.best.clone_from(&noted.best);
        self.cost = noted.cost;
        !ended
    }

    fn best(&self) -> (&[f64], f64) {
        (&self.best, self.cost)
    }
}
