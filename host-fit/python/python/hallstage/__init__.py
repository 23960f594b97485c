"""Calibrates the Hall-sensor array of a 6-DOF precision stage, and decodes with it as the controller does.

The work is done by the Rust library `host-fit`; this package has no model of its own. All numbers are SI: m, rad, s.
"""

from ._hallstage import OptimizeResult, minimize, write_demo

__all__ = ["OptimizeResult", "minimize", "write_demo"]
