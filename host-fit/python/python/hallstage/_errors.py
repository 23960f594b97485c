"""Exceptions of the package, beside `ValueError` for wrong arguments and `OSError` for files."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ._results import Finding


class LogError(ValueError):
    """A log that is wrong: the message says what, where, and what to do.

    `file`, `line` (from 1) and `column` (from 1, `name` in the header) say where, each None where it does not
    apply. Of a log of arrays `line` is the row, from 0, and `name` the argument.
    """

    def __init__(
        self,
        message: str,
        file: str | None = None,
        line: int | None = None,
        column: int | None = None,
        name: str | None = None,
    ) -> None:
        super().__init__(message)
        self.file = file
        self.line = line
        self.column = column
        self.name = name


class LogRefused(Exception):
    """A log that gives no calibration.

    `findings`: its faults, the most severe first. `code`: the reason, "no_fit", "findings", "beyond_limit" or
    "unfinished"; None for a recalibration that failed.
    """

    def __init__(self, message: str, findings: Sequence[Finding] = (), code: str | None = None) -> None:
        super().__init__(message)
        self.findings = list(findings)
        self.code = code
