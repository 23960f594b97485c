"""Parameters, findings and residuals of calibrations."""

from __future__ import annotations

from html import escape
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

#: Half the width of an interval that covers 95 % of a normal distribution, in standard deviations.
_COVERS_95 = 1.959963984540054

_AXES = {"x": ("X", "um"), "y": ("Y", "um"), "rz": ("Rz", "urad")}


def plain(value: Any) -> Any:
    """What a number or array of NumPy stands for in `stage.toml`."""
    if hasattr(value, "tolist"):
        return value.tolist()
    raise ValueError(f"{type(value)} is no value of stage.toml: numbers, texts, lists and dicts are")


def restored(cls: Any, *arguments: Any) -> Any:
    """An object of this package from a pickle."""
    return cls._restore(*arguments)


class OptimizeResult(NamedTuple):
    """The result of a search, with the fields of SciPy. Made by `minimize`.

    `message`: why the search ended. `success`: whether the smallest value is a finite number. `fun`: the smallest
    value. `x`: where it is, (n,). `nit`: generations. `nfev`: evaluations of the function.
    """

    message: str
    success: bool
    fun: float
    x: NDArray[np.float64]
    nit: int
    nfev: int

    def __repr__(self) -> str:
        return "\n".join(f"{name:>8}: {str(value).replace(chr(10), chr(10) + ' ' * 10)}" for name, value in self._asdict().items())


class Finding(NamedTuple):
    """One thing that is wrong with a log.

    `code`: a name that stays, explained in the reference of `host-fit`. `severity`: "note", "warn" or "refuse".
    `message`: evidence and remedy. `channel`, such as "hall_a", "cap_1", "ifm_y1", "x"; `movement`; `t_s`: when, s in
    the log; `value`: how large, in `unit`; `cost`: predicted errors in service over the noise floor, with this alone.
    A field that does not apply is None.
    """

    code: str
    severity: Literal["note", "warn", "refuse"]
    message: str
    channel: str | None
    movement: str | None
    t_s: float | None
    value: float | None
    unit: str | None
    cost: float | None


class Findings(list[Finding]):
    """Faults of a log, the most severe first: a list of `Finding`.

    `verdict`: "good", "limited" or "refused", of the calibration that the log gives. `refusal`: why the log is refused, and
    `refusal_code` the same as a name that stays, "no_fit" or "findings"; None where it is not refused.
    """

    def __init__(
        self, findings: list[Finding], verdict: str | None, refusal: str | None, refusal_code: str | None
    ) -> None:
        super().__init__(findings)
        self.verdict = verdict
        self.refusal = refusal
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
    """One parameter of a calibration, in its SI unit.

    `std`: standard error; None where it is not known, or where the model fixes the parameter.
    """

    name: str
    value: float
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

    def plot(self, ax: Any = None) -> Any:
        """Errors over time in s, um and urad, each row light and the mean over half a second, the drift, dark.

        A panel for each axis, or all in `ax`; gives the array of panels, or `ax`. Movements follow each other, and
        their borders are grey. Needs matplotlib.
        """
        from matplotlib import pyplot

        panels = pyplot.subplots(3, 1, sharex=True, layout="constrained")[1] if ax is None else [ax] * 3
        steps = np.diff(self.time)
        ends = np.diff(self.movement) != 0
        period = float(np.median(steps)) if len(steps) else 0.0
        # A movement may start its time anew.
        steps = np.where(ends & (steps <= 0), period, steps)
        seconds = np.concatenate([self.time[:1], self.time[:1] + np.cumsum(steps)])
        movements = np.split(np.arange(len(self)), np.flatnonzero(ends) + 1)
        for panel, (axis, (name, unit)) in zip(panels, _AXES.items(), strict=True):
            label = f"{name}, {unit.replace('u', chr(0xB5), 1)}"
            errors = getattr(self, axis) * 1e6
            (line,) = panel.plot(seconds, errors, linewidth=0.5, alpha=0.4)
            means = np.concatenate([_mean(errors[rows], round(0.5 / period) if period else 1) for rows in movements])
            panel.plot(seconds, means, linewidth=1.5, color=line.get_color(), label=label)
            panel.set_ylabel(label if ax is None else "error")
            for rows in movements[1:] if len(movements) < 150 else ():
                panel.axvline(seconds[rows[0]], color="0.8", linewidth=0.5, zorder=0)
        if ax is not None:
            ax.legend()
        panels[-1].set_xlabel("time, s")
        return panels if ax is None else ax


def _mean(errors: NDArray[np.float64], rows: int) -> NDArray[np.float64]:
    """The mean over a number of rows about each row, without rows that are NaN."""
    window = np.ones(max(1, min(rows, len(errors))))
    known = np.isfinite(errors)
    counts = np.convolve(known, window, "same")
    with np.errstate(invalid="ignore"):
        means: NDArray[np.float64] = np.convolve(np.where(known, errors, 0.0), window, "same") / counts
    return means
