"""Calibrates the Hall-sensor array of a 6-DOF precision stage, and decodes with it as the controller does.

The work is done by the Rust library `host-fit`; this package has no model of its own. All numbers are SI: m, rad, s.
"""

from importlib.metadata import version

from ._errors import LogError, LogRefused
from ._hallstage import (
    Calibration,
    Decoder,
    Evaluation,
    Log,
    Plan,
    SimulatedLog,
    Stage,
    check,
    fit,
    minimize,
    plan,
    simulate,
    status_names,
    write_demo,
)
from ._results import Finding, Findings, OptimizeResult, Parameter, Residuals

__version__: str = version("hallstage")

#: What each bit of a decoder's `status` means, by its value.
STATUS: dict[int, str] = status_names()

__all__ = [
    "STATUS",
    "__version__",
    "Calibration",
    "Decoder",
    "Evaluation",
    "Finding",
    "Findings",
    "Log",
    "LogError",
    "LogRefused",
    "OptimizeResult",
    "Parameter",
    "Plan",
    "Residuals",
    "SimulatedLog",
    "Stage",
    "check",
    "fit",
    "minimize",
    "plan",
    "simulate",
    "write_demo",
]
