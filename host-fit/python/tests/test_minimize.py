"""The paper's algorithm and its relatives on functions of Python."""

import signal
from typing import Any

import hallstage as hs
import numpy as np
import pytest
from numpy.typing import NDArray

METHODS = ["shtlbo", "tlbo", "gbtlbo", "mutation", "hybrid", "success-ratio"]
BOX = [(-5.0, 5.0)] * 6
Array = NDArray[np.float64]


def sphere(x: Array) -> Any:
    return ((x - 1.0) ** 2).sum(axis=0)


@pytest.mark.parametrize("method", METHODS)
def test_a_vectorized_function_takes_the_same_path_as_a_scalar_one(method: Any) -> None:
    one = hs.minimize(sphere, BOX, method=method, population=20, maxiter=40)
    many = hs.minimize(sphere, BOX, method=method, population=20, maxiter=40, vectorized=True)
    assert one.x.tobytes() == many.x.tobytes()
    assert (one.fun, one.nfev, one.nit, one.message) == (many.fun, many.nfev, many.nit, many.message)
    assert one.fun == sphere(one.x) and one.success
    assert one.fun < 1.0


def test_shtlbo_finds_the_minimum_with_the_papers_budget() -> None:
    found = hs.minimize(sphere, BOX, population=100, maxiter=100, vectorized=True)
    assert (found.nfev, found.nit) == (20_100, 100)
    np.testing.assert_allclose(found.x, 1.0, atol=1e-6)
    assert found.message == "all generations were run"


def test_the_seed_decides() -> None:
    first, again, other = (hs.minimize(sphere, BOX, seed=seed, maxiter=5).x.tobytes() for seed in (7, 7, 8))
    assert first == again != other


def test_every_place_lies_within_the_bounds_and_is_counted() -> None:
    seen: list[Array] = []

    def far_away(x: Array) -> float:
        seen.append(x)
        return float(((x - 100.0) ** 2).sum())

    low, high = np.array([-1.0, 2.0, 0.0]), np.array([1.0, 3.0, 0.0])
    found = hs.minimize(far_away, np.column_stack([low, high]), maxiter=50, maxfev=900)
    places = np.array(seen)
    assert found.nfev == len(places) >= 900
    assert found.message == "the budget of evaluations was used"
    assert (places >= low).all() and (places <= high).all()
    np.testing.assert_allclose(found.x, high, atol=1e-6)


def test_nan_ranks_worst_and_is_counted() -> None:
    def with_hole(x: Array) -> Any:
        return np.where(x[0] < 0.0, np.nan, sphere(x))

    found = hs.minimize(with_hole, BOX, maxiter=50, vectorized=True)
    assert found.success and found.x[0] >= 0.0 and found.fun < 0.1
    assert "were NaN" in found.message
    lost = hs.minimize(lambda x: np.nan, BOX, maxiter=2)
    assert not lost.success and np.isnan(lost.fun)


def test_a_first_individual_is_evaluated_first() -> None:
    seen: list[Array] = []

    def watched(x: Array) -> float:
        seen.append(x)
        return 0.0

    hs.minimize(watched, BOX, x0=range(6), maxiter=0)
    assert seen[0].tolist() == [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]


@pytest.mark.parametrize("vectorized", [False, True])
def test_what_the_function_raises_reaches_the_caller_at_once(vectorized: bool) -> None:
    calls = 0

    def broken(x: Array) -> Any:
        nonlocal calls
        calls += 1
        if calls == 3:
            raise ZeroDivisionError("third call")
        return np.zeros(x.shape[1:])

    with pytest.raises(ZeroDivisionError, match="third call"):
        hs.minimize(broken, BOX, vectorized=vectorized)
    assert calls == 3


def test_ctrl_c_ends_the_search() -> None:
    calls = 0

    def interrupted(x: Array) -> Any:
        nonlocal calls
        calls += 1
        if calls == 5:
            signal.raise_signal(signal.SIGINT)
        return sphere(x)

    with pytest.raises(KeyboardInterrupt):
        hs.minimize(interrupted, BOX)
    assert calls <= 6


def test_what_the_function_returns_must_be_numbers() -> None:
    with pytest.raises(TypeError, match=r"fun: .* one real number .*str"):
        hs.minimize(lambda x: "x", BOX)
    with pytest.raises(TypeError, match=r"fun: .*vectorized.*of shape \(6,\)"):
        hs.minimize(lambda x: x, BOX)
    with pytest.raises(TypeError, match=r"fun: .* 50 real numbers, shape \(50,\).*float"):
        hs.minimize(lambda x: 1.0, BOX, vectorized=True)
    with pytest.raises(TypeError, match=r"fun: .*of shape \(6, 50\)"):
        hs.minimize(lambda x: x, BOX, vectorized=True)


@pytest.mark.parametrize(
    ("argument", "value", "says"),
    [
        ("fun", 3, "callable"),
        ("bounds", [], r"\(n, 2\)"),
        ("bounds", [(0, 1, 2)], r"\(n, 2\)"),
        ("bounds", "ab", r"\(n, 2\)"),
        ("bounds", [(0, 1j)], "dtype complex128"),
        ("bounds", [(0, 1), (1, 0)], r"row 1 is \(1, 0\)"),
        ("bounds", [(0, np.nan)], "finite"),
        ("method", "simplex", "shtlbo, tlbo"),
        ("seed", -1, "from 0 to"),
        ("seed", 1.5, "whole number"),
        ("population", 1, "from 2 to"),
        ("maxiter", -3, "from 0 to"),
        ("maxfev", 0, "from 1 to"),
        ("x0", [1.0], "finite numbers are needed, one for each"),
        ("x0", [np.inf] * 6, "finite numbers are needed, one for each"),
    ],
)
def test_a_wrong_argument_is_named(argument: str, value: Any, says: str) -> None:
    arguments: dict[str, Any] = {"fun": sphere, "bounds": BOX, argument: value}
    with pytest.raises((ValueError, TypeError), match=f"^{argument}: .*{says}"):
        hs.minimize(**arguments)


def test_the_result_prints_as_scipys_does() -> None:
    text = repr(hs.minimize(sphere, BOX, maxiter=1))
    names = [line.split(":")[0].strip() for line in text.splitlines() if ":" in line]
    assert names == ["message", "success", "fun", "x", "nit", "nfev"]
