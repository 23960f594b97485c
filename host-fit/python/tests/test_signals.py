"""Ctrl-C ends every call that may take long, and the next call works."""

import signal
import threading
from collections.abc import Callable
from pathlib import Path

import hallstage as hs
import numpy as np
import pytest
from conftest import DATA

CALLS: dict[str, Callable[[hs.Log, hs.Calibration, Path], object]] = {
    "load": lambda log, cal, file: hs.Log.load(file, log.stage),
    "rows": lambda log, cal, file: log[:-1],
    "save": lambda log, cal, file: log.save(file.with_name("other.csv")),
    "check": lambda log, cal, file: hs.check(log),
    "fit": lambda log, cal, file: hs.fit(log, force=True),
    "plan": lambda log, cal, file: hs.plan(log.stage, seconds=120),
    "simulate": lambda log, cal, file: hs.simulate(log.stage, "paper"),
    "evaluate": lambda log, cal, file: cal.evaluate(log),
    "decode": lambda log, cal, file: cal.decoder()(log),
    "uncertainty": lambda log, cal, file: cal.decoder().uncertainty(log),
    "uncertainty of arrays": lambda log, cal, file: cal.decoder().uncertainty(hall=log.hall, caps=log.caps),
}


@pytest.fixture(scope="module")
def long(stage: hs.Stage, tmp_path_factory: pytest.TempPathFactory) -> tuple[hs.Log, Path]:
    """A log of some seconds of work, and its file."""
    log = hs.Log.load(DATA / "paper.csv.gz", stage)
    rows = np.tile(np.arange(len(log)), 20)
    x, y, rz = log.reference[rows].T
    caps = log.caps[rows] if log.caps is not None else None
    log = hs.Log.from_arrays(
        stage, time=0.002 * np.arange(len(rows)), movement=np.arange(len(rows)) // 1000, hall=log.hall[rows], caps=caps,
        x=x, y=y, rz=rz,
    )  # fmt: skip
    path = tmp_path_factory.mktemp("long") / "long.csv"
    log.save(path)
    return log, path


@pytest.mark.parametrize("name", CALLS)
def test_ctrl_c_ends_a_long_call_without_a_result(name: str, long: tuple[hs.Log, Path], cal: hs.Calibration) -> None:
    log, path = long
    made = []
    timer = threading.Timer(0.1, signal.raise_signal, [signal.SIGINT])
    timer.start()
    with pytest.raises(KeyboardInterrupt):
        made.append(CALLS[name](log, cal, path))
    timer.join()
    assert made == []
    # The work that was left goes on for a while, and does not disturb this.
    assert len(hs.Log.load(DATA / "run30.csv.gz", log.stage)) == 15_001
