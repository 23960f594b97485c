import os
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Literal, final

import numpy as np
import pandas  # type: ignore[import-untyped,unused-ignore]
from numpy.typing import ArrayLike, NDArray
from typing_extensions import disjoint_base

from ._results import Finding, Findings, OptimizeResult, Parameter, Residuals

_Path = str | os.PathLike[str]
_Model = Literal["auto", "12", "15", "30", "31", "field"]

__all__ = [
    "Calibration",
    "Decoder",
    "Evaluation",
    "Log",
    "Plan",
    "SimulatedLog",
    "Stage",
    "check",
    "fit",
    "main_of",
    "minimize",
    "plan",
    "read_log",
    "simulate",
    "status_names",
    "write_demo",
]

_Method = Literal["shtlbo", "tlbo", "gbtlbo", "mutation", "hybrid", "success-ratio"]

def main_of(arguments: Sequence[str]) -> int: ...
def write_demo(folder: _Path) -> None: ...
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
def status_names() -> dict[int, str]: ...
def read_log(
    paths: _Path | Sequence[_Path],
    stage: Stage,
    *,
    bad_rows: Literal["refuse", "skip"] = "refuse",
) -> Log: ...
def plan(stage: Stage, *, seconds: float = 20.0) -> Plan: ...
def simulate(
    stage: Stage,
    run: Plan | Literal["paper", "combined", "service", "day", "fast"] | ArrayLike,
    *,
    seed: int = 1,
    hour: float | None = None,
) -> SimulatedLog: ...
def check(log: Log) -> Findings: ...
def fit(
    log: Log,
    *,
    model: _Model = "auto",
    solver: str = "lm",
    project: Literal["none", "delta", "linear"] = "linear",
    loss: Literal["cauchy", "huber", "none"] | None = None,
    train: int | None = None,
    draw: Literal["stratified", "plain"] = "stratified",
    population: int | None = None,
    generations: int | None = None,
    seed: int = 1,
    serial: str = "",
    created: str = "",
    limit: str | None = None,
    force: bool = False,
) -> Calibration: ...
@final
class Stage:
    def __new__(cls, **tables: Mapping[str, Any]) -> Stage: ...
    @staticmethod
    def load(path: _Path) -> Stage: ...
    @property
    def servo_period_s(self) -> float: ...
    @property
    def hall_m_per_count(self) -> float: ...
    @property
    def hall_places_m(self) -> list[list[float]]: ...
    @property
    def y_baseline_m(self) -> float: ...
    def __eq__(self, other: object, /) -> bool: ...
    def __ne__(self, other: object, /) -> bool: ...

@disjoint_base
class Log:
    @staticmethod
    def from_arrays(
        stage: Stage,
        *,
        t_us: ArrayLike,
        hall: ArrayLike,
        caps: ArrayLike | None = None,
        z: ArrayLike | None = None,
        rx: ArrayLike | None = None,
        ry: ArrayLike | None = None,
        x: ArrayLike | None = None,
        y1: ArrayLike | None = None,
        y2: ArrayLike | None = None,
        y: ArrayLike | None = None,
        rz: ArrayLike | None = None,
        movement: ArrayLike | None = None,
        mount: ArrayLike | None = None,
        body: ArrayLike | None = None,
        units: Literal["m", "mm", "um", "nm", "pm"] = "m",
        angles: Literal["rad", "mrad", "urad", "nrad", "deg"] = "rad",
        name: str = "arrays",
        bad_rows: Literal["refuse", "skip"] = "refuse",
    ) -> Log: ...
    def __len__(self) -> int: ...
    @property
    def rows_read(self) -> int: ...
    @property
    def stage(self) -> Stage: ...
    @property
    def warnings(self) -> list[str]: ...
    @property
    def channels(self) -> list[dict[str, Any]]: ...
    @property
    def t_us(self) -> NDArray[np.int64]: ...
    @property
    def movement(self) -> NDArray[np.int64]: ...
    @property
    def hall(self) -> NDArray[np.int32]: ...
    @property
    def caps(self) -> NDArray[np.int32] | None: ...
    @property
    def reference(self) -> NDArray[np.float64]: ...
    @property
    def vertical(self) -> NDArray[np.float64]: ...
    @property
    def mount(self) -> NDArray[np.float64]: ...
    @property
    def body(self) -> NDArray[np.float64]: ...
    @property
    def df(self) -> pandas.DataFrame: ...

@final
class Calibration:
    @staticmethod
    def open(path: _Path, stage: Stage) -> Calibration: ...
    def save(self, path: _Path) -> None: ...
    def decoder(self) -> Decoder: ...
    def residuals(self) -> Residuals: ...
    def evaluate(
        self,
        log: Log,
        *,
        delta: Literal["fit", "zero"] | None = None,
        limit: float | None = None,
    ) -> Evaluation: ...
    def recalibrate(
        self, log: Log, what: Literal["gain", "gains", "all", "temperature"], *, created: str = ""
    ) -> Calibration: ...
    def diff(self, older: Calibration) -> dict[str, Any]: ...
    def report(
        self,
        path: _Path,
        *,
        operator: str | None = None,
        notes: Mapping[str, str] | None = None,
    ) -> None: ...
    @property
    def blob(self) -> bytes: ...
    @property
    def model(self) -> str: ...
    @property
    def serial(self) -> str: ...
    @property
    def created(self) -> str: ...
    @property
    def forced(self) -> bool: ...
    @property
    def verdict(self) -> Literal["good", "limited", "refused"] | None: ...
    @property
    def findings(self) -> list[Finding]: ...
    @property
    def warnings(self) -> list[str]: ...
    @property
    def figures(self) -> dict[str, Any] | None: ...
    @property
    def parameters(self) -> dict[str, Parameter]: ...
    @property
    def names(self) -> list[str]: ...
    @property
    def covariance(self) -> NDArray[np.float64]: ...
    def covariance_frame(self) -> pandas.DataFrame: ...
    def to_frame(self) -> pandas.DataFrame: ...
    @property
    def correlations(self) -> NDArray[np.float64]: ...
    @property
    def budget(self) -> pandas.DataFrame | None: ...
    @property
    def errors(self) -> dict[str, dict[str, float]]: ...
    def _repr_html_(self) -> str | None: ...

@final
class Evaluation:
    def residuals(self) -> Residuals: ...
    def report(
        self,
        path: _Path,
        *,
        operator: str | None = None,
        notes: Mapping[str, str] | None = None,
        created: str = "",
    ) -> None: ...
    @property
    def figures(self) -> dict[str, Any]: ...
    @property
    def errors(self) -> dict[str, dict[str, float]]: ...
    @property
    def findings(self) -> list[Finding]: ...
    @property
    def warnings(self) -> list[str]: ...
    @property
    def refusal(self) -> str | None: ...
    @property
    def refusal_code(self) -> str | None: ...
    def _repr_html_(self) -> str: ...

@final
class Decoder:
    @staticmethod
    def open(path: _Path) -> Decoder: ...
    def __call__(
        self,
        log: Log | None = None,
        *,
        hall: ArrayLike | None = None,
        caps: ArrayLike | None = None,
        mount: ArrayLike | None = None,
        body: ArrayLike | None = None,
        velocity: ArrayLike | None = None,
        acceleration: ArrayLike | None = None,
        hold: int = 0,
        invalid: Literal["nan", "zero"] = "nan",
    ) -> NDArray[np.void]: ...
    def uncertainty(
        self,
        log: Log | None = None,
        *,
        hall: ArrayLike | None = None,
        caps: ArrayLike | None = None,
        mount: ArrayLike | None = None,
        body: ArrayLike | None = None,
        whole: bool = False,
    ) -> NDArray[np.float64]: ...
    @property
    def model(self) -> str: ...
    @property
    def serial(self) -> str: ...
    @property
    def created(self) -> str: ...

@final
class Plan:
    def save(self, path: _Path) -> None: ...
    @property
    def seconds(self) -> float: ...
    @property
    def trajectory(self) -> NDArray[np.float64]: ...
    @property
    def figures(self) -> dict[str, Any]: ...

@final
class SimulatedLog(Log):
    @property
    def truth(self) -> NDArray[np.float64]: ...
