"""Stages and logs: from files and from arrays, by the same checks."""

import gzip
from collections.abc import Callable
from pathlib import Path
from typing import Any

import hallstage as hs
import numpy as np
import pytest
from conftest import DATA

UM = 1e6


def columns_of(log: hs.Log) -> dict[str, Any]:
    x, y, rz = log.reference.T
    return {
        "time": log.time, "movement": log.movement, "hall": log.hall, "caps": log.caps, "x": x, "y": y, "rz": rz,
    }  # fmt: skip


def test_a_stage_is_made_of_tables_as_of_a_file(stage: hs.Stage) -> None:
    tomllib = pytest.importorskip("tomllib", reason="Python 3.11")
    tables = tomllib.loads((DATA / "stage.toml").read_text())
    assert hs.Stage(**tables) == stage
    tables["capacitive"]["probes_m"] = np.array(tables["capacitive"]["probes_m"])
    assert hs.Stage(**tables) == stage
    tables["servo"]["period_s"] = 0.001
    other = hs.Stage(**tables)
    assert other != stage and other.servo_period_s == 0.001
    assert "h1x_m = 0.1975" in repr(stage) and "period_s = 0.001" in repr(other)


@pytest.mark.parametrize(
    ("table", "key", "value", "words"),
    [
        ("hall", "h1x_m", "far", "h1x_m"), ("servo", "period_s", -1.0, "period_s"),
        ("servo", "periods", 1.0, "periods"), ("hall", "m_per_count", float("nan"), "hall"),
        ("hall", "h1x_m", object(), "hall"), ("no_such", "x", 1, "no_such"),
    ],
)  # fmt: skip
def test_a_wrong_stage_names_the_key(table: str, key: str, value: object, words: str) -> None:
    tomllib = pytest.importorskip("tomllib", reason="Python 3.11")
    tables = tomllib.loads((DATA / "stage.toml").read_text())
    tables.setdefault(table, {})[key] = value
    with pytest.raises(ValueError, match=words):
        hs.Stage(**tables)


def test_a_stage_without_end_is_refused() -> None:
    endless: list[object] = []
    endless.append(endless)
    with pytest.raises(ValueError, match="hall"):
        hs.Stage(hall={"h1x_m": endless})
    with pytest.raises(ValueError, match="hall"):
        hs.Stage(hall=3)  # type: ignore[arg-type]
    with pytest.raises(FileNotFoundError):
        hs.Stage.load("no such file.toml")


def test_arrays_make_the_log_of_the_file(run30: hs.Log, cal: hs.Calibration) -> None:
    made = hs.Log.from_arrays(run30.stage, **columns_of(run30))
    for name in ["time", "movement", "hall", "caps", "vertical"]:
        assert np.array_equal(getattr(made, name), getattr(run30, name)), name
    # Lengths went through a scale.
    assert np.allclose(made.reference, run30.reference, rtol=1e-15, atol=0)
    again = hs.fit(made)
    for name in ["lever_arm_a", "eta_b", "uw2_c"]:
        # The reference differs by rounding.
        (value, std) = (cal.parameters[name].value, cal.parameters[name].std)
        assert std is not None and abs(again.parameters[name].value - value) < 1e-3 * std


def test_units_and_beams_are_those_of_the_arguments(run30: hs.Log) -> None:
    columns = columns_of(run30)
    x, y, rz = (columns.pop(name) for name in ["x", "y", "rz"])
    half = np.tan(rz) * run30.stage.y_baseline_m / 2
    made = hs.Log.from_arrays(
        run30.stage, **columns, x=x * UM, y1=(y + half) * UM, y2=(y - half) * UM, units="um"
    )
    assert np.allclose(made.reference, run30.reference, rtol=1e-9, atol=1e-15)
    made = hs.Log.from_arrays(
        run30.stage, **columns, x=x * 1e9, y=y * 1e9, rz=rz * UM, units="nm", angles="urad"
    )
    assert np.allclose(made.reference, run30.reference, rtol=1e-9, atol=1e-15)
    z, rx, ry = run30.vertical.T
    del columns["caps"]
    made = hs.Log.from_arrays(run30.stage, **columns, x=x, y=y, rz=rz, z=z, rx=rx, ry=ry)
    assert made.caps is None and np.array_equal(made.vertical, run30.vertical)


def test_integers_of_any_size_and_layout_are_codes(run30: hs.Log) -> None:
    columns = columns_of(run30)
    for dtype in ["int16", "int64", ">i4"]:
        made = hs.Log.from_arrays(run30.stage, **(columns | {"hall": run30.hall.astype(dtype)}))
        assert np.array_equal(made.hall, run30.hall)
    made = hs.Log.from_arrays(run30.stage, **(columns | {"hall": np.asfortranarray(run30.hall)}))
    assert np.array_equal(made.hall, run30.hall)


def test_temperatures_pass_through(run30: hs.Log) -> None:
    mount = np.linspace(20.0, 24.0, len(run30)).round(3)
    mount[3] = np.nan
    made = hs.Log.from_arrays(run30.stage, **columns_of(run30), mount=mount)
    assert np.allclose(made.mount, mount, atol=1e-9, equal_nan=True) and np.isnan(made.body).all()
    assert np.isnan(run30.mount).all()


@pytest.mark.parametrize(
    ("argument", "value", "words"),
    [
        ("hall", np.zeros(5, int), r"hall: shape \(5,\)"),
        ("hall", np.zeros((3, 9), int), r"hall: shape \(3, 9\)"),
        ("hall", np.zeros((0, 3), int), "hall: no rows"),
        ("hall", np.full((9, 3), 0.5), "hall: numbers with a fraction"),
        ("caps", np.zeros((9, 3), bool), "caps: dtype bool"),
        ("caps", np.full((9, 3), 2**40), "caps: numbers from"),
        ("caps", np.zeros((8, 3), int), "caps: 8 rows"),
        ("x", np.zeros((9, 1)), "x: shape"),
        ("x", ["a"] * 9, "x: dtype"),
        ("x", [[1], [2, 3]], "x: no array"),
        ("y", np.zeros(9, complex), "y: dtype complex128"),
        ("rz", np.ma.masked_array(np.zeros(9), np.zeros(9, bool)), "rz: a masked array"),
        ("movement", np.full(9, np.nan), "movement: row 0 is NaN"),
        ("movement", np.full(9, 2**63, np.uint64), "movement: numbers from"),
        ("time", None, "time"),
        ("units", "urad", "units: `urad`"),
        ("units", "um/s", "units"),
        ("angles", "um", "angles: `um`"),
        ("bad_rows", "drop", "bad_rows"),
    ],
)
def test_a_wrong_argument_is_named(stage: hs.Stage, argument: str, value: object, words: str) -> None:
    arrays: dict[str, Any] = {
        "time": 0.002 * np.arange(9), "movement": np.zeros(9, int), "hall": np.zeros((9, 3), int),
        "caps": np.zeros((9, 3), int), "x": np.zeros(9), "y": np.zeros(9), "rz": np.zeros(9),
    }  # fmt: skip
    hs.Log.from_arrays(stage, **arrays)
    with pytest.raises((ValueError, TypeError), match=words):
        hs.Log.from_arrays(stage, **(arrays | {argument: value}))


def test_a_wrong_row_is_named_by_argument_and_row(run30: hs.Log) -> None:
    columns = columns_of(run30)
    for argument, row, wrong, words in [
        ("x", 17, np.nan, "NaN"), ("y", 0, np.inf, "inf"), ("rz", 3, 2.0, "1e-1 rad"), ("x", 5, 1.0, "m"),
        ("time", 8, 0.002, "backwards"),
    ]:  # fmt: skip
        spoilt = np.array(columns[argument], dtype=float)
        spoilt[row] = wrong
        with pytest.raises(hs.LogError) as raised:
            hs.Log.from_arrays(run30.stage, **(columns | {argument: spoilt}))
        assert str(raised.value).startswith(f"{argument}[{row}]"), raised.value
        assert words in str(raised.value)
        assert (raised.value.line, raised.value.name, raised.value.file) == (row, argument, None)
    skipped = hs.Log.from_arrays(run30.stage, **(columns | {"x": spoilt_at(columns["x"], 17)}), bad_rows="skip")
    assert len(skipped) == len(run30) - 1 and skipped.warnings
    saturated = run30.hall.copy()
    saturated[4, 1] = 32767
    with pytest.raises(hs.LogError, match=r"hall\[4\]"):
        hs.Log.from_arrays(run30.stage, **(columns | {"hall": saturated}))


def spoilt_at(numbers: Any, row: int) -> Any:
    spoilt = np.array(numbers)
    spoilt[row] = np.nan
    return spoilt


def test_a_wrong_file_is_named_with_line_and_column(stage: hs.Stage, tmp_path: Path) -> None:
    lines = gzip.decompress((DATA / "run30.csv.gz").read_bytes()).decode().splitlines()
    cells = lines[11].split(",")
    cells[3] = "x"
    path = tmp_path / "log.csv"
    path.write_text("\n".join([*lines[:11], ",".join(cells), *lines[12:40]]))
    with pytest.raises(hs.LogError) as raised:
        hs.Log.load(path, stage)
    error = raised.value
    assert (error.file, error.line, error.column) == (str(path), 12, 4)
    assert error.name == lines[0].split(",")[3] and isinstance(error, ValueError)
    with pytest.raises(FileNotFoundError):
        hs.Log.load(tmp_path / "none.csv", stage)
    with pytest.raises(OSError, match="folder"):
        hs.Log.load(tmp_path, stage)
    with pytest.raises(ValueError, match="paths"):
        hs.Log.load(3, stage)  # type: ignore[arg-type]
    with pytest.raises(hs.LogError, match="no log"):
        hs.Log.load([], stage)


def test_several_logs_are_calibrated_together(stage: hs.Stage) -> None:
    both = hs.Log.load([DATA / "run30.csv.gz", DATA / "service.csv.gz"], stage)
    assert len(both) == both.rows_read and "service.csv.gz" in repr(both)
    # No movement of the second log has the number of one in the first.
    movements = both.df.groupby("movement")["log"].unique()
    assert list(map(list, movements)) == [[0], *[[1]] * 8]


def test_a_log_is_a_table(run30: hs.Log) -> None:
    pytest.importorskip("pandas")
    df = run30.df
    assert len(df) == len(run30) and df["hall_c"].dtype == np.int32
    assert np.array_equal(df["y_m"], run30.reference[:, 1])
    assert np.array_equal(df["cap_2"], run30.caps[:, 1] if run30.caps is not None else 0)
    assert "mount_c" not in df and np.isclose(df["time_s"].diff().dropna(), 0.002).all()


def test_the_channels_of_a_log_have_their_noise(run30: hs.Log) -> None:
    channels = {row["channel"]: row for row in run30.channels}
    assert list(channels) == ["hall_a", "hall_b", "hall_c", "ifm_x", "ifm_y1", "ifm_y2", "cap_1", "cap_2", "cap_3"]
    assert 4e-7 < channels["hall_b"]["noise_m"] < 6e-7 and 5e-9 < channels["ifm_x"]["noise_m"] < 7e-9
    assert channels["hall_a"]["stuck_bits"] == [] and channels["ifm_x"]["rows_per_value"] is None


def test_a_log_without_reference_is_decoded_and_not_fitted(run30: hs.Log, cal: hs.Calibration) -> None:
    columns = columns_of(run30)
    alone = hs.Log.from_arrays(run30.stage, **{k: columns[k] for k in ["time", "movement", "hall", "caps"]})
    assert np.array_equal(cal.decoder()(alone), cal.decoder()(run30))
    uses: list[Callable[[hs.Log], object]] = [hs.fit, hs.check, cal.evaluate]
    for use in uses:
        with pytest.raises(hs.LogError, match="ifm_x"):
            use(alone)
