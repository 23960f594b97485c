"""Logs and tables: what a log writes, as a file or a frame, is the same log when it is read."""

import copy
from pathlib import Path
from typing import Any

import hallstage as hs
import numpy as np
import pandas as pd  # type: ignore[import-untyped,unused-ignore]
import pytest
from conftest import DATA
from test_log import columns_of

ARRAYS = ["time", "movement", "hall", "caps", "reference", "vertical", "mount", "body"]


def same_log(one: hs.Log, other: hs.Log) -> None:
    for name in ARRAYS:
        have, want = getattr(one, name), getattr(other, name)
        assert (have is None and want is None) or np.array_equal(have, want, equal_nan=have.dtype.kind == "f"), name
    assert one.warnings == [warning for warning in one.warnings if "column" not in warning]


@pytest.fixture(scope="module")
def mapped(tmp_path_factory: pytest.TempPathFactory) -> hs.Stage:
    """A stage whose logs have other columns, and temperatures in another unit."""
    path = tmp_path_factory.mktemp("mapped") / "stage.toml"
    names = '[log]\nhall_a = "ADC 2"\nmovement = "run"\n[temperature]\nmount = "mount_mc"\nbody = "body_mc"\nunit = "mC"\n'
    path.write_text((DATA / "stage.toml").read_text() + names)
    return hs.Stage.load(path)


@pytest.mark.parametrize("form", ["caps", "vertical", "beams", "temperatures", "two logs", "no reference"])
def test_what_a_log_writes_is_the_same_log_when_it_is_read(
    run30: hs.Log, mapped: hs.Stage, tmp_path: Path, form: str
) -> None:
    columns = columns_of(run30)
    if form == "vertical":
        del columns["caps"]
        columns |= dict(zip(["z", "rx", "ry"], run30.vertical.T, strict=True))
    elif form == "temperatures":
        columns["mount"] = np.linspace(20, 21, len(run30)).round(3)
        columns["mount"][5] = np.nan
    elif form == "no reference":
        del columns["x"], columns["y"], columns["rz"]
    log = hs.Log.from_arrays(mapped, **columns)
    if form == "two logs":
        log = hs.Log.load([DATA / "run30.csv.gz", DATA / "service.csv.gz"], run30.stage)
    elif form == "beams":
        tables = tables_of(run30.stage)
        tables["interferometer"]["scale"] = [1.001, 1.0, 1.0]
        log = hs.Log.load(DATA / "run30.csv.gz", hs.Stage(**tables))
        assert "ifm_y2_m" in log.df and "x_m" not in log.df
    log.save(tmp_path / "saved.csv")
    log.df.to_csv(tmp_path / "index.csv")
    log.df.to_csv(tmp_path / "plain.csv", index=False)
    read = [hs.Log.load(tmp_path / name, log.stage) for name in ["saved.csv", "index.csv", "plain.csv"]]
    for other in [*read, hs.Log.from_frame(log.df, log.stage), hs.Log.from_frame(log.df.set_index("time_s"), log.stage)]:
        if form == "beams":
            assert np.allclose(other.reference, log.reference, rtol=1e-12, atol=1e-18)
        else:
            same_log(other, log)


def tables_of(stage: hs.Stage) -> dict[str, Any]:
    tomllib = pytest.importorskip("tomllib", reason="Python 3.11")
    return dict(tomllib.loads(repr(stage)))


def test_a_stage_that_names_a_column_of_the_package_for_another_is_believed(run30: hs.Log) -> None:
    tables = tables_of(run30.stage)
    swapped = hs.Stage(**tables, log={"hall_a": "hall_b", "hall_b": "hall_a"})
    assert np.array_equal(hs.Log.from_frame(run30.df, swapped).hall, run30.hall[:, [1, 0, 2]])


def test_a_frame_with_the_columns_of_a_file_is_its_log(run30: hs.Log, stage: hs.Stage) -> None:
    frame = pd.read_csv(DATA / "run30.csv.gz")
    same_log(hs.Log.from_frame(frame, stage), run30)
    frame["hall_a_cnt"] = frame["hall_a_cnt"].astype(float)
    frame.loc[7, "hall_a_cnt"] = np.nan
    with pytest.raises(hs.LogError, match=r"hall_a_cnt\[7\]") as raised:
        hs.Log.from_frame(frame, stage)
    assert (raised.value.line, raised.value.name) == (7, "hall_a_cnt")
    assert len(hs.Log.from_frame(frame, stage, bad_rows="skip")) == len(run30) - 1
    with pytest.raises(hs.LogError, match="the column `hall_c` is missing"):
        hs.Log.from_frame(run30.df.drop(columns="hall_c"), stage)
    for wrong in [frame[:0], frame.to_numpy(), None]:
        with pytest.raises(ValueError, match="^frame: "):
            hs.Log.from_frame(wrong, stage)


def test_some_rows_of_a_log_are_a_log(run30: hs.Log, cal: hs.Calibration) -> None:
    fast = np.abs(np.gradient(run30.reference[:, 0], run30.time)) > 1e-3
    for rows in [fast, slice(100, 4000), np.flatnonzero(fast)]:
        part = run30[rows]
        assert np.array_equal(part.hall, run30.hall[rows]) and np.array_equal(part.reference, run30.reference[rows])
    assert run30[:8000].stage == run30.stage and hs.fit(run30[:12_000]).verdict == "good"
    assert np.array_equal(cal.decoder()(run30[fast])["x_m"], cal.decoder()(run30)["x_m"][fast])
    for wrong, error in [(5, ValueError), (fast[:9], IndexError), ("x", IndexError), (slice(5, 5), ValueError), (slice(None, None, -1), hs.LogError)]:
        with pytest.raises(error):
            run30[wrong]


def test_all_rows_of_a_long_log_are_there_and_the_sample_on_request(stage: hs.Stage, tmp_path: Path) -> None:
    frame = pd.read_csv(DATA / "paper.csv.gz")
    long = pd.concat([frame.assign(movement=frame["movement"] + 100 * k) for k in range(3)])
    long.to_csv(tmp_path / "long.csv", index=False)
    log = hs.Log.load(tmp_path / "long.csv", stage)
    assert len(log) == len(log.df) == len(log.hall) == log.rows_read == len(long)
    assert np.array_equal(log.hall[:, 1], long["hall_b_cnt"]) and np.array_equal(log.movement, long["movement"])
    sample = hs.Log.load(tmp_path / "long.csv", stage, rows="sample")
    assert 30_000 < len(sample) == len(sample.df) < 125_000 and sample.rows_read == len(long)
    assert len(hs.fit(log, model="31").residuals()) == len(sample)


def test_a_missing_code_is_no_number_of_another_column(run30: hs.Log) -> None:
    # The number that stands for a missing code is a sound number of a movement.
    columns = columns_of(run30) | {"movement": np.full(len(run30), -(2**31))}
    assert np.all(hs.Log.from_arrays(run30.stage, **columns).movement == -(2**31))


def test_a_log_is_its_own_copy(run30: hs.Log) -> None:
    assert copy.copy(run30) is run30 and copy.deepcopy({"log": run30})["log"] is run30
