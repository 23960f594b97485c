"""What calibrations consist of."""

from __future__ import annotations

from html import escape
from importlib import import_module
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Half the width of an interval that covers 95 % of a normal distribution, in standard deviations.
_COVERS_95 = 1.959963984540054

_AXES = {"x": ("X", "um"), "y": ("Y", "um"), "rz": ("Rz", "urad")}


def plain(value: Any) -> Any:
    """What a number or array of NumPy stands for in `stage.toml`."""
    if hasattr(value, "tolist"):
        return value.tolist()
    raise ValueError(f"{type(value)} is no value of stage.toml: numbers, texts, lists and dicts are")


class OptimizeResult(NamedTuple):
    """The result of a search, with the fields of SciPy. Made by `minimize`."""

    #: Why the search ended.
    message: str
    #: Whether the smallest value is a finite number.
    success: bool
    #: The smallest value.
    fun: float
    #: Where it is, (n,).
    x: NDArray[np.float64]
    #: Generations.
    nit: int
    #: Evaluations of the function.
    nfev: int

    def __repr__(self) -> str:
        return "\n".join(f"{name:>8}: {str(value).replace(chr(10), chr(10) + ' ' * 10)}" for name, value in self._asdict().items())


class Finding(NamedTuple):
    """One thing that is wrong with a log."""

    #: What it is: a name that stays, explained in the reference of `host-fit`.
    code: str
    #: "note", "warn" or "refuse".
    severity: Literal["note", "warn", "refuse"]
    #: Evidence and remedy.
    message: str
    #: The channel, such as "hall_a", "cap_1", "ifm_y1", "x".
    channel: str | None
    #: The movement.
    movement: str | None
    #: When, us in the log.
    t_us: int | None
    #: How large, in `unit`.
    value: float | None
    unit: str | None
    #: Predicted errors in service over the noise floor, with this alone.
    cost: float | None


class Findings(list[Finding]):
    """What is wrong with a log, the most severe first."""

    def __init__(
        self, findings: list[Finding], verdict: str | None, refusal: str | None, refusal_code: str | None
    ) -> None:
        super().__init__(findings)
        #: "good", "limited" or "refused": of the calibration that the log gives.
        self.verdict = verdict
        #: Why the log is refused; None where it is not.
        self.refusal = refusal
        #: The same as a name that stays: "no_fit" or "findings"; None where it is not refused.
        self.refusal_code = refusal_code

    def _repr_html_(self) -> str:
        rows = "".join(
            f"<tr><td>{f.severity}</td><td>{f.code}</td><td>{escape(f.message)}</td>"
            f"<td>{'' if f.cost is None else f'{f.cost:.2f}'}</td></tr>"
            for f in self
        )
        head = "<tr><th></th><th>code</th><th>finding</th><th>cost</th></tr>"
        return f"<p><b>{self.verdict}</b></p><table>{head}{rows}</table>"


class Parameter(NamedTuple):
    """One parameter of a calibration, in its unit."""

    name: str
    value: float
    #: Standard error; None where it is not known, or where the model fixes the parameter.
    std: float | None
    unit: str

    @property
    def interval(self) -> tuple[float, float] | None:
        """The ends of the interval that covers 95 %: value -+ 1.96 std, or None without a standard error."""
        if self.std is None:
            return None
        half = _COVERS_95 * self.std
        return (self.value - half, self.value + half)


class Residuals:
    """Errors of the rows of a log: decoded pose less reference, zero deviations taken off.

    `time` (s, within the log), `movement` (its number), `x`, `y` (m), `rz` (rad), `weight` (0 to 1: how much the
    row counted in the fit, 0 if it was not used), all (n,). Rows without a pose are NaN.
    """

    def __init__(
        self,
        time: NDArray[np.float64],
        movement: NDArray[np.int64],
        axes: NDArray[np.float64],
        weight: NDArray[np.float64],
    ) -> None:
        self.time = time
        self.movement = movement
        self.x, self.y, self.rz = axes
        self.weight = weight

    def __len__(self) -> int:
        return len(self.time)

    def __repr__(self) -> str:
        rms = {axis: float(np.sqrt(np.nanmean(getattr(self, axis) ** 2)) * 1e6) for axis in _AXES}
        figures = ", ".join(f"{name} {rms[axis]:.3f} {unit}" for axis, (name, unit) in _AXES.items())
        return f"<Residuals of {len(self)} rows, rms {figures}>"

    def asd(self, axis: Literal["x", "y", "rz"]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Amplitude spectral density of an axis: frequencies, Hz, and m/rtHz or rad/rtHz, without that at 0 Hz.

        Mean over windows of up to 4096 rows within the movements, with a Hann taper: Welch's method. Raises
        `ValueError` for another axis, or where no movement is long enough (32 rows).
        """
        if axis not in _AXES:
            raise ValueError(f"axis: {axis!r} is none of x, y, rz")
        steps = np.diff(self.time)
        period = float(np.median(steps)) if len(steps) else 0.0
        ends = (np.diff(self.movement) != 0) | (np.abs(steps - period) > 0.5 * period)
        movements = np.split(np.nan_to_num(getattr(self, axis)), np.flatnonzero(ends) + 1)
        longest = max(map(len, movements))
        if longest < 32:
            raise ValueError("axis: no movement has the 32 rows that a spectrum needs")
        length = min(4096, 1 << (longest.bit_length() - 1))
        windows = np.concatenate([m[: len(m) // length * length].reshape(-1, length) for m in movements])
        taper = 0.5 - 0.5 * np.cos(2 * np.pi * np.arange(length) / length)
        bins = np.fft.rfft((windows - windows.mean(axis=1, keepdims=True)) * taper)[:, 1 : length // 2]
        # One side of the spectrum; the sum of squares of the taper is 3/8 of its length.
        power = np.mean(np.abs(bins) ** 2, axis=0) * 2 * period / (0.375 * length)
        return (np.arange(1, length // 2) / (length * period), np.sqrt(power))

    def plot(self, ax: Any = None) -> Figure:
        """Errors over time, s, um and urad: a panel for each axis, or all in `ax`; needs matplotlib.

        Movements follow each other, and their borders are grey.
        """
        from matplotlib import pyplot

        if ax is None:
            figure, panels = pyplot.subplots(3, 1, sharex=True)
        else:
            figure, panels = ax.figure, [ax] * 3
        steps = np.diff(self.time)
        borders = np.flatnonzero(np.diff(self.movement)) + 1
        period = float(np.median(steps)) if len(steps) else 0.0
        # A movement may start its time anew.
        steps = np.where((np.diff(self.movement) != 0) & (steps <= 0), period, steps)
        seconds = np.concatenate([self.time[:1], self.time[:1] + np.cumsum(steps)])
        for panel, (axis, (name, unit)) in zip(panels, _AXES.items(), strict=True):
            unit = unit.replace("u", "\N{MICRO SIGN}", 1)
            panel.plot(seconds, getattr(self, axis) * 1e6, linewidth=0.5, label=f"{name}, {unit}")
            panel.set_ylabel(f"{name}, {unit}" if ax is None else "error")
            for row in borders if len(borders) < 150 else ():
                panel.axvline(seconds[row], color="0.8", linewidth=0.5, zorder=0)
        if ax is not None:
            ax.legend()
        panels[-1].set_xlabel("time, s")
        return figure


def frame(log: Any, logs: Any, has_reference: bool, has_temperatures: tuple[bool, bool]) -> Any:
    """The rows of a log as a `pandas.DataFrame`."""
    pandas = import_module("pandas")
    columns: dict[str, Any] = {"log": logs, "movement": log.movement, "t_us": log.t_us}

    def add(names: str, array: Any) -> None:
        columns.update(zip(names.split(), array.T, strict=True))

    add("hall_a hall_b hall_c", log.hall)
    if log.caps is not None:
        add("cap_1 cap_2 cap_3", log.caps)
    add("z_m rx_rad ry_rad", log.vertical)
    if has_reference:
        add("x_m y_m rz_rad", log.reference)
    for name, there in zip(("mount", "body"), has_temperatures, strict=True):
        if there:
            columns[f"{name}_c"] = getattr(log, name)
    return pandas.DataFrame(columns)
