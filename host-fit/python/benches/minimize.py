"""`hallstage.minimize` beside MEALPY's TLBO and SciPy's differential evolution.

    pip install ./host-fit/python -r host-fit/python/benches/requirements.txt
    python host-fit/python/benches/minimize.py

Sphere, Rosenbrock and Rastrigin in 30 dimensions, their minimum of 0 away from the middle of the box, 100,000
evaluations, medians of five seeds; evaluations a second are by time of the processor. All write their functions with
NumPy; "batch" gets a population at a time. MEALPY has no batches. SciPy's population is 60 (two for each unknown), all
others have 50.
"""

import statistics
import time
import warnings
from collections.abc import Callable
from typing import Any

import hallstage as hs
import numpy as np
from mealpy import FloatVar
from mealpy.human_based.TLO import OriginalTLO
from scipy.optimize import differential_evolution

DIMENSIONS = 30
EVALUATIONS = 100_000
POPULATION = 50
SEEDS = range(1, 6)
Function = Callable[[Any], Any]


def sphere(x: Any) -> Any:
    return ((x - 1.0) ** 2).sum(axis=0)


def rosenbrock(x: Any) -> Any:
    return (100.0 * (x[1:] - x[:-1] ** 2) ** 2 + (1.0 - x[:-1]) ** 2).sum(axis=0)


def rastrigin(x: Any) -> Any:
    y = x - 0.7
    return (10.0 + y**2 - 10.0 * np.cos(2.0 * np.pi * y)).sum(axis=0)


def ours(method: Any, vectorized: bool) -> Any:
    def search(fun: Function, bounds: Any, seed: int) -> tuple[float, int]:
        found = hs.minimize(
            fun, bounds, method=method, seed=seed, population=POPULATION, maxiter=EVALUATIONS, maxfev=EVALUATIONS,
            vectorized=vectorized,
        )  # fmt: skip
        return found.fun, found.nfev

    return search


def scipy(vectorized: bool) -> Any:
    def search(fun: Function, bounds: Any, seed: int) -> tuple[float, int]:
        found = differential_evolution(
            fun, bounds, rng=seed, popsize=2, maxiter=EVALUATIONS // 60 - 1, tol=0.0, polish=False,
            updating="deferred", vectorized=vectorized,
        )  # fmt: skip
        # SciPy counts a batch as one evaluation.
        return float(found.fun), int(found.nfev) * (60 if vectorized else 1)

    return search


def mealpy(fun: Function, bounds: Any, seed: int) -> tuple[float, int]:
    calls = 0

    def counted(x: Any) -> Any:
        nonlocal calls
        calls += 1
        return fun(x)

    low, high = np.transpose(bounds)
    problem = {"obj_func": counted, "bounds": FloatVar(lb=low, ub=high), "minmax": "min", "log_to": None}
    best = OriginalTLO(epoch=EVALUATIONS // (2 * POPULATION), pop_size=POPULATION).solve(problem, seed=seed)
    return float(best.target.fitness), calls


SEARCHES: list[tuple[str, str, Any]] = [
    ("hallstage shtlbo", "batch", ours("shtlbo", True)),
    ("hallstage shtlbo", "one", ours("shtlbo", False)),
    ("hallstage tlbo", "batch", ours("tlbo", True)),
    ("hallstage tlbo", "one", ours("tlbo", False)),
    ("MEALPY TLBO", "one", mealpy),
    ("SciPy differential_evolution", "batch", scipy(True)),
    ("SciPy differential_evolution", "one", scipy(False)),
]


def main() -> None:
    # SciPy warns that it does not use threads.
    warnings.simplefilter("ignore")
    print("| function | search | callback | evaluations | evaluations a second | final value |")
    print("|---|---|---|---|---|---|")
    for name, fun, half in [("sphere", sphere, 5.0), ("Rosenbrock", rosenbrock, 3.0), ("Rastrigin", rastrigin, 5.0)]:
        bounds = [(-half, half)] * DIMENSIONS
        for search, callback, run in SEARCHES:
            values, rates, counts = [], [], []
            for seed in SEEDS:
                started = time.process_time()
                value, count = run(fun, bounds, seed)
                rates.append(count / (time.process_time() - started))
                values.append(value)
                counts.append(count)
            median = statistics.median
            print(
                f"| {name} | {search} | {callback} | {median(counts):,} | {median(rates):,.0f} | {median(values):.2g} |",
                flush=True,
            )


if __name__ == "__main__":
    main()
