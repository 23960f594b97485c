"""Arguments that are arrays, as the library takes them."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray


def checked(argument: str, given: Any, columns: int | None, kinds: str, wanted: str, dtype: str) -> NDArray[Any]:
    """The argument in C order with this dtype, the same array where it has that form already.

    It has at least one row, of one number or of `columns`. `kinds` are the accepted kinds of its own dtype.
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
    if array.dtype.kind not in kinds:
        raise ValueError(f"{argument}: dtype {array.dtype}: {wanted} are needed")
    if dtype.startswith("int"):
        ends, least, most = np.iinfo(dtype), int(array.min()), int(array.max())
        if least < ends.min or most > ends.max:
            raise ValueError(f"{argument}: numbers from {least} to {most}, but {ends.min} to {ends.max} is what fits")
    return np.ascontiguousarray(array, dtype)
