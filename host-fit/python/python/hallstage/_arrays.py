"""Arguments that are arrays, as the library takes them."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray


#: Stands for a code that is missing.
MISSING = -(2**31)


def checked(argument: str, given: Any, columns: int | None, kinds: str, wanted: str, dtype: str) -> NDArray[Any]:
    """The argument in C order with this dtype, the same array where it has that form already.

    It has at least one row, of one number or of `columns`. `kinds` are the accepted kinds of its own dtype; whole
    floats are whole numbers, and NaN is a missing code where the dtype is int32.
    """
    if isinstance(given, np.ma.MaskedArray):
        raise ValueError(f"{argument}: a masked array; remove the masked rows, since the mask would be lost")
    try:
        array = np.asarray(given)
    except (TypeError, ValueError, OverflowError) as error:
        raise ValueError(f"{argument}: no array of {wanted}: {error}") from None
    form = "one number a row, (n,)" if columns is None else f"{columns} numbers a row, (n, {columns})"
    if array.ndim != (1 if columns is None else 2) or array.shape[1:] not in ((), (columns,)):
        raise ValueError(f"{argument}: shape {array.shape}: {form}, is needed")
    if array.size == 0:
        raise ValueError(f"{argument}: no rows")
    if dtype.startswith("int") and array.dtype.kind == "f":
        missing = np.isnan(array)
        if missing.any() and dtype != "int32":
            raise ValueError(f"{argument}: row {int(np.argmax(missing))} is NaN: {wanted} are needed")
        numbers = array[~missing]
        if not np.all((np.abs(numbers.astype(np.float64)) < 2.0**63) & (np.floor(numbers) == numbers)):
            raise ValueError(f"{argument}: numbers with a fraction or beyond 64 bits: {wanted} are needed")
        array = np.where(missing, MISSING, array.astype(np.float64)).astype(np.int64)
    if array.dtype.kind not in kinds:
        raise ValueError(f"{argument}: dtype {array.dtype}: {wanted} are needed")
    if dtype.startswith("int"):
        ends, least, most = np.iinfo(dtype), int(array.min()), int(array.max())
        if least < ends.min or most > ends.max:
            raise ValueError(f"{argument}: numbers from {least} to {most}, but {ends.min} to {ends.max} is what fits")
    return np.ascontiguousarray(array, dtype)


_REAL = ("iuf", "numbers", "float64")
_WHOLE = ("iu", "whole numbers", "int64")
_CODES = ("iu", "codes (whole numbers)", "int32")


def from_arrays(
    *, time: Any, hall: Any, caps: Any = None, z: Any = None, rx: Any = None, ry: Any = None, x: Any = None,
    y1: Any = None, y2: Any = None, y: Any = None, rz: Any = None, movement: Any = None, mount: Any = None,
    body: Any = None, units: str = "m", angles: str = "rad",
) -> tuple[dict[str, NDArray[Any]], list[tuple[str, str]]]:  # fmt: skip
    """Arrays as the columns of a log, which passes all checks of a file; and the argument of each column."""
    for argument, unit, known in (("units", units, "m mm um nm pm"), ("angles", angles, "rad mrad urad nrad deg")):
        if not isinstance(unit, str) or unit not in known.split():
            raise ValueError(f"{argument}: `{unit}` is none of {', '.join(known.split())}")
    # With a second beam x is a beam, else it is the pose.
    x_key = "x" if y1 is None and y2 is None else "ifm_x"
    forms = [
        ("time", time, _REAL, ["time_s"]),
        ("movement", movement, _WHOLE, ["movement"]),
        ("hall", hall, _CODES, ["hall_a", "hall_b", "hall_c"]),
        ("caps", caps, _CODES, ["cap_1", "cap_2", "cap_3"]),
        *((name, given, _REAL, [f"{name} [{angles}]"]) for name, given in (("rx", rx), ("ry", ry), ("rz", rz))),
        *(
            (name, given, _REAL, [f"{key} [{units}]"])
            for name, key, given in (("z", "z", z), ("x", x_key, x), ("y1", "ifm_y1", y1), ("y2", "ifm_y2", y2), ("y", "y", y))
        ),
        ("mount", mount, _REAL, ["mount_c"]),
        ("body", body, _REAL, ["body_c"]),
    ]
    columns: dict[str, NDArray[Any]] = {}
    names: list[tuple[str, str]] = []
    rows = 0
    for argument, given, form, headers in forms:
        if given is None and argument not in ("time", "hall"):
            continue
        array = checked(argument, given, 3 if form is _CODES else None, *form)
        rows = rows or len(array)
        if len(array) != rows:
            raise ValueError(f"{argument}: {len(array)} rows, but time has {rows}")
        names += [(header, argument) for header in headers]
        columns.update(zip(headers, array.reshape(rows, -1).T, strict=True))
    return columns, names


def frame_text(frame: Any) -> tuple[str, list[tuple[str, str]]]:
    """A `pandas.DataFrame` as the text of a log, and its columns."""
    if not hasattr(frame, "to_csv") or not hasattr(frame, "columns"):
        raise ValueError(f"frame: {type(frame).__name__} is no pandas.DataFrame")
    if len(frame) == 0:
        raise ValueError("frame: no rows")
    names = [str(name) for name in frame.columns]
    return frame.to_csv(index=frame.index.name is not None), [(name, name) for name in names]
