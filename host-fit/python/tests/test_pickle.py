"""Objects go to other processes and come back."""

import copy
import multiprocessing
import pickle
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

import hallstage as hs
import numpy as np
import pytest
from conftest import DATA
from test_frames import ARRAYS


def again(of: Any) -> Any:
    return pickle.loads(pickle.dumps(of))


def test_what_is_pickled_is_the_same_again(run30: hs.Log, cal: hs.Calibration, stage: hs.Stage) -> None:
    assert again(stage) == stage
    both = hs.Log.load([DATA / "run30.csv.gz", DATA / "service.csv.gz"], stage, bad_rows="skip")
    simulated = hs.simulate(stage, np.zeros((200, 6)))
    for log in [run30, run30[:500], both, simulated]:
        other = again(log)
        assert type(other) is type(log) and other.stage == log.stage and repr(other) == repr(log)
        for name in ARRAYS:
            assert np.array_equal(getattr(other, name), getattr(log, name), equal_nan=True), name
    assert np.array_equal(again(simulated).truth, simulated.truth)
    # As after `save` and `load`.
    other = again(cal)
    assert other.blob == cal.blob and np.allclose(other.covariance, cal.covariance) and other.stage == cal.stage
    dec, other = cal.decoder(), again(cal.decoder())
    assert np.array_equal(other(run30), dec(run30))
    assert np.allclose(other.uncertainty(run30), dec.uncertainty(run30), rtol=1e-12, atol=0)
    assert again(hs.check(run30)).verdict == "good" and np.array_equal(again(cal.residuals()).x, cal.residuals().x)
    for one in [stage, cal, dec]:
        assert copy.copy(one) is one and copy.deepcopy([one])[0] is one


def test_a_pickle_of_a_log_holds_its_rows(stage: hs.Stage, tmp_path: Path) -> None:
    (tmp_path / "log.csv.gz").write_bytes((DATA / "run30.csv.gz").read_bytes())
    text = pickle.dumps(hs.Log.load(tmp_path / "log.csv.gz", stage))
    (tmp_path / "log.csv.gz").unlink()
    assert hs.fit(pickle.loads(text)).verdict == "good"


def test_exceptions_keep_what_they_say(run30: hs.Log) -> None:
    with pytest.raises(hs.LogRefused) as refused:
        hs.fit(run30, limit={"x": 1e-7})
    other = again(refused.value)
    assert (str(other), other.code, other.findings) == (str(refused.value), "beyond_limit", refused.value.findings)
    error = again(hs.LogError("wrong", "log.csv", 3, 2, "x_m"))
    assert (str(error), error.file, error.line, error.column, error.name) == ("wrong", "log.csv", 3, 2, "x_m")


def refit(log: hs.Log) -> hs.Calibration:
    return hs.fit(log)


def test_a_pool_of_processes_fits_logs(run30: hs.Log, cal: hs.Calibration) -> None:
    with ProcessPoolExecutor(2, multiprocessing.get_context("spawn")) as pool:
        for one in pool.map(refit, [run30, run30]):
            assert one.parameters["eta_a"].value == pytest.approx(cal.parameters["eta_a"].value, rel=1e-6)
