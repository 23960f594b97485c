import os
from collections.abc import Callable, Sequence
from typing import Any, Literal, final

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = ["OptimizeResult", "main_of", "minimize", "write_demo"]

_Method = Literal[
    "shtlbo", "tlbo", "gbtlbo", "mutation", "hybrid", "success-ratio", "de", "pso", "ga", "cmaes", "random"
]

@final
class OptimizeResult:
    @property
    def x(self) -> NDArray[np.float64]: ...
    @property
    def fun(self) -> float: ...
    @property
    def nfev(self) -> int: ...
    @property
    def nit(self) -> int: ...
    @property
    def success(self) -> bool: ...
    @property
    def message(self) -> str: ...

def main_of(arguments: Sequence[str]) -> int: ...
def minimize(
    fun: Callable[[NDArray[np.float64]], Any],
    bounds: ArrayLike,
    *,
    method: _Method = "shtlbo",
    seed: int = 1,
    population: int = 50,
    maxiter: int = 1000,
    maxfev: int | None = None,
    x0: ArrayLike | None = None,
    vectorized: bool = False,
) -> OptimizeResult: ...
def write_demo(folder: str | os.PathLike[str]) -> None: ...
