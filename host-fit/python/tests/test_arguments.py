"""Every argument of every function takes wrong values without a panic, and its exception names it."""

import itertools
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import hallstage as hs
import numpy as np
import pytest
from conftest import DATA

ROWS = 400


def wrong_values() -> Iterator[Any]:
    yield from (None, True, "", "x", "\0", "ä" * 40, b"x", 0, -1, 1.5, float("nan"), float("inf"), 10**30, -(2**63))
    yield from ([], {}, (), {"a": 1}, [[]], [None], ["x"], object(), int, Path("missing"), Path("."), range(ROWS))
    for shape in [(), (0,), (0, 3), (3, 0), (ROWS,), (ROWS, 3), (ROWS, 2), (ROWS, 6), (1, ROWS), (2, ROWS, 3)]:
        for dtype in ["i4", "f8", "?", "c16", "O", "U3", "M8[us]", "u8", ">i2", "f2"]:
            yield np.zeros(shape, dtype)
    codes = np.arange(3 * ROWS).reshape(ROWS, 3)
    yield from (codes.T, codes[::-1], codes[:, ::-1], np.asfortranarray(codes), codes.astype("f8") * 1e300)
    yield from (np.full((ROWS, 3), 2**40), np.full(ROWS, np.nan), np.full(ROWS, -np.inf), np.full(ROWS, 1e300))
    yield from (np.full(ROWS, 2**64 - 1, "u8"), np.ma.masked_equal(codes, 7), np.zeros(ROWS, "i4,f8"))
    yield np.lib.stride_tricks.as_strided(np.zeros(1), (ROWS,), (0,))


def calls(
    folder: Path, run30: hs.Log, cal: hs.Calibration, in_motion: hs.Calibration
) -> list[tuple[Callable[..., Any], dict[str, Any]]]:
    """Functions with sound arguments by name."""
    stage = run30.stage
    x, y, rz = run30.reference[:ROWS].T
    hall, caps = run30.hall[:ROWS], run30.caps[:ROWS] if run30.caps is not None else None
    arrays = {
        "stage": stage, "time": run30.time[:ROWS], "hall": hall, "caps": caps, "x": x, "y": y, "rz": rz,
        "movement": run30.movement[:ROWS], "mount": np.full(ROWS, 20.0), "body": np.full(ROWS, 20.0),
        "units": "m", "angles": "rad", "name": "a", "bad_rows": "refuse",
    }  # fmt: skip
    log = hs.Log.from_arrays(**arrays)
    decoder = in_motion.decoder()
    cal.save(folder / "p.bin")
    fit = {
        "log": log, "model": "31", "solver": "lm", "project": "linear", "loss": "none", "train": 100,
        "draw": "plain", "population": 10, "generations": 2, "seed": 1, "serial": "a",
        "created": "b", "limit": {"x": 1e-6}, "force": False,
    }  # fmt: skip
    tables = {
        "hall": {"h1x_m": 0.2}, "capacitive": {"m_per_count": 1e-8}, "interferometer": {"y_baseline_m": 0.1},
        "servo": {"period_s": 0.002},
    }  # fmt: skip
    minimize = {
        "fun": lambda x: float(x.sum()), "bounds": [(0, 1)] * 2, "method": "tlbo", "seed": 1, "population": 4,
        "maxiter": 1, "maxfev": 9, "x0": [0, 1], "vectorized": False,
    }  # fmt: skip
    decode = {
        "log": None, "hall": hall, "caps": caps, "mount": np.zeros(ROWS), "body": np.zeros(ROWS),
        "velocity": np.zeros((ROWS, 3)), "acceleration": np.zeros((ROWS, 6)), "hold": 2,
    }  # fmt: skip
    return [
        (hs.Stage.load, {"path": DATA / "stage.toml"}),
        (hs.Stage, tables),
        (hs.Log.load, {"paths": DATA / "run30.csv.gz", "stage": stage, "bad_rows": "skip", "rows": "all"}),
        (hs.Log.from_frame, {"frame": log.df, "stage": stage, "name": "a", "bad_rows": "skip"}),
        (log.save, {"path": folder / "l.csv"}),
        (log.__getitem__, {"rows": slice(9)}),
        (hs.Log.from_arrays, arrays),
        (hs.check, {"log": log}),
        (hs.fit, fit),
        (hs.Calibration.load, {"path": folder / "p.bin", "stage": stage}),
        (cal.save, {"path": folder / "q.bin"}),
        (cal.evaluate, {"log": log, "delta": "fit", "limit": 1.0}),
        (cal.recalibrate, {"log": log, "what": "gain", "created": "c"}),
        (cal.diff, {"older": cal}),
        (cal.with_parameters, {"values": {"eta_a": 0.9}}),
        (cal.report, {"path": folder / "r.html", "operator": "me", "notes": {"a": "b"}}),
        (cal.residuals().asd, {"axis": "x"}),
        (hs.Decoder.load, {"path": folder / "p.bin"}),
        (decoder, decode),
        (decoder.uncertainty, {"hall": hall, "caps": caps, "mount": np.zeros(ROWS), "body": np.zeros(ROWS)}),
        (hs.plan, {"stage": stage, "seconds": 4.0}),
        (hs.simulate, {"stage": stage, "run": np.zeros((9, 6)), "seed": 1}),
        (hs.minimize, minimize),
        (hs.write_demo, {"folder": folder / "demo"}),
    ]


def names_it(error: Exception, argument: str) -> bool:
    # Before Python 3.11 an exception has no notes.
    return argument in str(error) or any(argument in note for note in getattr(error, "__notes__", [argument]))


def test_no_argument_leads_to_a_panic_and_each_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, run30: hs.Log, cal: hs.Calibration, in_motion: hs.Calibration
) -> None:
    monkeypatch.chdir(tmp_path)
    silent: list[str] = []
    tried = refused = 0
    for function, sound in calls(tmp_path, run30, cal, in_motion):
        for argument, value in itertools.product(sound, wrong_values()):
            tried += 1
            try:
                function(**(sound | {argument: value}))
            except (TypeError, ValueError, OverflowError) as error:
                # A panic is no Exception, and ends the test.
                refused += 1
                if not isinstance(error, hs.LogError) and not names_it(error, argument):
                    silent.append(f"{function}, {argument}={value!r:.60}: {type(error).__name__}: {error}")
            except (OSError, hs.LogRefused):
                refused += 1
    assert silent == [], "\n".join(silent)
    assert refused > tried / 2
