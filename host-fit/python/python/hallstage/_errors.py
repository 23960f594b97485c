"""Exceptions of the package, beside `ValueError` for wrong arguments and `OSError` for files."""

from __future__ import annotations

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
    """A log that is no good for a calibration.

    `findings` say what is wrong with it, the most severe first. `code` is the code of the finding that refuses it,
    None where the errors are beyond `limit`, or where a fit failed without such a finding.
    """

    def __init__(self, message: str, findings: list[Finding]) -> None:
        super().__init__(message)
        self.findings = findings
        self.code = next((found.code for found in findings if found.severity == "refuse"), None)
