//! The searches of the library on a Python function.

use crate::arrays::{reals, slice, table};
use crate::error::wrong;
use host_fit::calibration::words::search_stopped;
use host_fit::input::stage::Range;
use host_fit::input::watch::Watch;
use host_fit::solver::solve::search::cost::{CostFunction, Individual};
use host_fit::solver::solve::search::kind::SearchKind;
use host_fit::solver::solve::search::run::SearchOptions;
use numpy::{PyArray1, PyArray2, PyArrayMethods};
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, Ordering};

/// A Python function over a box.
struct Function<'a> {
    bounds: Vec<Range>,
    fun: &'a Py<PyAny>,
    vectorized: bool,
    /// The exception that it raised.
    error: OnceLock<PyErr>,
    /// Whether there is one: the interrupt of the search.
    has_failed: AtomicBool,
}

impl Function<'_> {
    fn value(&self, python: Python<'_>, individual: &[f64]) -> PyResult<f64> {
        let x = PyArray1::from_slice(python, individual);
        let value = self.fun.bind(python).call1((x,))?;
        value.extract().map_err(|_| {
            let what = "fun: it must return one real number (set vectorized=True if it takes many places at once)";
            not_what(&value, what)
        })
    }

    fn values(&self, python: Python<'_>, individuals: &mut [Individual]) -> PyResult<()> {
        let x = PyArray2::zeros(python, [self.bounds.len(), individuals.len()], true);
        {
            // A column for each individual, one after the other in memory.
            let mut x = x.try_readwrite()?;
            let columns = x.as_slice_mut()?.chunks_exact_mut(self.bounds.len());
            for (column, individual) in columns.zip(&*individuals) {
                column.copy_from_slice(&individual.place);
            }
        }
        let values = self.fun.bind(python).call1((x,))?;
        let read = reals("fun", &values).ok();
        let read = read
            .filter(|read| matches!(read.as_slice(), Ok(all) if all.len() == individuals.len()));
        let Some(read) = read else {
            let n = individuals.len();
            let what = format!(
                "fun: it must return {n} real numbers, shape ({n},), one for each column of x (vectorized=True)"
            );
            return Err(not_what(&values, &what));
        };
        for (individual, value) in individuals.iter_mut().zip(slice(read.as_slice())?) {
            individual.cost = *value;
        }
        Ok(())
    }
}

/// The error for a value of a wrong type or shape.
fn not_what(value: &Bound<'_, PyAny>, what: &str) -> PyErr {
    let shape = value
        .getattr("shape")
        .map_or(String::new(), |shape| format!(" of shape {shape}"));
    let name = value.get_type().name();
    let name = name.map_or("another object".to_owned(), |name| name.to_string());
    PyTypeError::new_err(format!("{what}; it returned {name}{shape}"))
}

impl CostFunction for Function<'_> {
    fn bounds(&self) -> &[Range] {
        &self.bounds
    }

    fn cost(&self, individual: &[f64]) -> f64 {
        let mut one = [Individual {
            place: individual.to_vec(),
            cost: f64::NAN,
        }];
        self.costs(&mut one);
        one[0].cost
    }

    /// On the caller's thread: Python runs one thread. The first exception ends the search.
    fn costs(&self, individuals: &mut [Individual]) {
        for individual in &mut *individuals {
            individual.cost = f64::NAN;
        }
        let done = Python::attach(|python| {
            python.check_signals()?;
            if self.vectorized {
                return self.values(python, individuals);
            }
            for individual in individuals {
                individual.cost = self.value(python, &individual.place)?;
                python.check_signals()?;
            }
            Ok(())
        });
        if let Err(error) = done {
            self.has_failed.store(true, Ordering::Relaxed);
            // The search ends after the first exception.
            let _ = self.error.set(error);
        }
    }
}

/// Searches for the minimum of a function over a box, by the paper's algorithm or one of its relatives.
///
/// Parameters
/// ----------
/// fun : callable
///     The function. `fun(x)` gets an array of shape (N,) and returns a number; with `vectorized` it gets
///     shape (N, S), a column for each place, and returns shape (S,). NaN ranks worst. An exception of
///     `fun` ends the search and reaches the caller.
/// bounds : array_like, shape (N, 2)
///     Lower and upper end of each unknown, finite. A place outside is moved to the nearer end.
/// method : str
///     "shtlbo" (equations 23, 24, 27-29 of the paper), "tlbo" (16-18), "gbtlbo" (19, 20), "mutation" (21, 22),
///     "hybrid" (23, 24), "success-ratio" (23-25).
/// seed : int
///     Seed of all random numbers, from 0 to 2**64 - 1: the same seed gives the same result.
/// population : int
///     Individuals, from 2 to 100,000; the paper has 100.
/// maxiter : int
///     Generations after the first population. Each evaluates two candidates for every individual.
/// maxfev : int, optional
///     Most evaluations. The search ends after the generation that reaches this number.
/// x0 : array_like, shape (N,), optional
///     A first individual; all others are drawn from the box.
/// vectorized : bool
///     Whether `fun` takes many places at once.
///
/// Returns
/// -------
/// OptimizeResult
///     x, fun, nfev, nit, success, message.
///
/// Raises
/// ------
/// ValueError, TypeError
///     An argument, named in the message, has the wrong type, shape or range.
#[pyfunction]
#[pyo3(signature = (fun, bounds, *, method="shtlbo", seed=1, population=50, maxiter=1000, maxfev=None, x0=None, vectorized=false))]
#[expect(clippy::too_many_arguments, reason = "they have names in Python")]
pub fn minimize<'py>(
    python: Python<'py>,
    fun: Py<PyAny>,
    bounds: &Bound<'_, PyAny>,
    method: &str,
    #[pyo3(from_py_with = read_seed)] seed: u64,
    #[pyo3(from_py_with = read_population)] population: u64,
    #[pyo3(from_py_with = read_maxiter)] maxiter: u64,
    maxfev: Option<&Bound<'_, PyAny>>,
    x0: Option<&Bound<'_, PyAny>>,
    vectorized: bool,
) -> PyResult<Bound<'py, PyAny>> {
    if !fun.bind(python).is_callable() {
        return Err(PyTypeError::new_err("fun: it must be callable"));
    }
    let bounds = ranges(bounds)?;
    let all = SearchKind::ALL;
    let kind = all.into_iter().find(|kind| kind.name() == method);
    let kind = kind.ok_or_else(|| {
        let names = all.map(SearchKind::name).join(", ");
        wrong("method", format!("{method:?} is none of {names}"))
    })?;
    let maxfev = maxfev.map(|given| whole("maxfev", given, 1, STEPS_MAX));
    let maxfev = maxfev.transpose()?;
    let first = x0.map(|x0| individual(x0, bounds.len())).transpose()?;
    let function = Function {
        bounds,
        fun: &fun,
        vectorized,
        error: OnceLock::new(),
        has_failed: AtomicBool::new(false),
    };
    let options = SearchOptions {
        first: first.as_slice(),
        evaluations: maxfev.map(|count| count as usize),
        watch: Watch {
            stop: &function.has_failed,
            ..Watch::NONE
        },
        ..SearchOptions::new(seed, population as usize, maxiter as usize)
    };
    let found = kind.minimize(&function, &options);
    if let Some(error) = function.error.into_inner() {
        return Err(error);
    }
    let mut message = search_stopped(found.reason).to_owned();
    if found.nan_costs > 0 {
        message += &format!(
            "; {} of {} values were NaN",
            found.nan_costs, found.evaluations
        );
    }
    let success = found.cost.is_finite();
    let x = PyArray1::from_vec(python, found.best);
    let class = python
        .import("hallstage._results")?
        .getattr("OptimizeResult")?;
    let (generations, evaluations) = (found.history.len() - 1, found.evaluations);
    class.call1((message, success, found.cost, x, generations, evaluations))
}

/// Maximum number of individuals: more than any search needs.
const POPULATION_MAX: u64 = 100_000;
/// Maximum number of generations and evaluations: more than a lifetime allows.
const STEPS_MAX: u64 = 1 << 40;

/// A whole number in a range.
pub fn whole(argument: &str, given: &Bound<'_, PyAny>, low: u64, high: u64) -> PyResult<u64> {
    let number = given.extract().ok();
    let number = number.filter(|number| (low..=high).contains(number));
    number.ok_or_else(|| {
        let problem = format!("a whole number from {low} to {high} is needed, not {given}");
        wrong(argument, problem)
    })
}

fn read_seed(given: &Bound<'_, PyAny>) -> PyResult<u64> {
    whole("seed", given, 0, u64::MAX)
}

fn read_population(given: &Bound<'_, PyAny>) -> PyResult<u64> {
    whole("population", given, 2, POPULATION_MAX)
}

fn read_maxiter(given: &Bound<'_, PyAny>) -> PyResult<u64> {
    whole("maxiter", given, 0, STEPS_MAX)
}

/// One finite number for each of `unknowns`.
fn individual(x0: &Bound<'_, PyAny>, unknowns: usize) -> PyResult<Vec<f64>> {
    let read = reals("x0", x0)?;
    let x0 = slice(read.as_slice())?;
    match x0.len() == unknowns && x0.iter().all(|x| x.is_finite()) {
        true => Ok(x0.to_vec()),
        false => {
            let problem = "finite numbers are needed, one for each row of bounds";
            Err(wrong("x0", problem))
        }
    }
}

/// The box.
fn ranges(bounds: &Bound<'_, PyAny>) -> PyResult<Vec<Range>> {
    let read = table("bounds", bounds, 2)?;
    let (rows, _) = slice(read.as_slice())?.as_chunks::<2>();
    let ranges = rows.iter().map(|&[low, high]| Range { low, high });
    let ranges: Vec<Range> = ranges.collect();
    let sound =
        |range: &Range| range.low.is_finite() && range.high.is_finite() && range.low <= range.high;
    match ranges.iter().position(|range| !sound(range)) {
        None => Ok(ranges),
        Some(k) => {
            let Range { low, high } = ranges[k];
            let problem = format!(
                "row {k} is ({low}, {high}): finite numbers are needed, the lower one first"
            );
            Err(wrong("bounds", problem))
        }
    }
}
