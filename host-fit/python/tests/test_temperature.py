"""A stage that warms in service: its logs and its calibration, which equal the program's."""

from pathlib import Path

import hallstage as hs
import numpy as np
import pytest
from conftest import DATA, HostFit
from test_decoder import bits

TEMPERATURE = """
[temperature]
mount = "mount_mc"
body = "body_mc"
unit = "mC"
"""
NAMES = ["k_a", "h_a", "k_b", "h_b", "k_c", "h_c"]


@pytest.fixture(scope="module")
def toml(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("warm") / "stage.toml"
    path.write_text((DATA / "stage.toml").read_text() + TEMPERATURE)
    return path


def test_a_calibration_with_temperatures_is_that_of_the_program(toml: Path, host_fit: HostFit) -> None:
    stage = hs.Stage.load(toml)
    run = hs.plan(stage, seconds=8.0)
    folder = host_fit("plan", "--stage", toml, "--seconds", "8", "--out", "run.csv")
    for name, hour in [("cold", -0.2), ("early", 0.2), ("warm", 3.5), ("later", 3.0)]:
        host_fit(
            "simulate", "--stage", toml, "--plan", "run.csv", "--seed", "3", f"--hour={hour}",
            "--out", f"{name}.csv",
        )  # fmt: skip
        simulated = hs.simulate(stage, run, seed=3, hour=hour)
        log = hs.Log.load(folder / f"{name}.csv", stage)
        assert (simulated.hall == log.hall).all() and (simulated.mount == log.mount).all()
    files = [folder / f"{name}.csv" for name in ["cold", "early", "warm"]]
    cal = hs.fit(hs.Log.load(files, stage), model="field", created="2026-11-25")
    host_fit(
        "fit", *files, "--stage", toml, "--model", "field", "--out", "p.bin", "--created", "2026-11-25"
    )
    assert cal.blob == (folder / "p.bin").read_bytes()
    cal.save(folder / "own.bin")
    opened = hs.Calibration.load(folder / "own.bin", stage)
    for one in [cal, opened]:
        covariance = one.covariance
        assert one.names[-6:] == NAMES and covariance.shape == (87, 87)
        std = [one.parameters[name].std for name in NAMES]
        assert np.allclose(np.sqrt(np.diag(covariance))[-6:], np.array(std, dtype=float))
        assert one.parameters["k_a"].unit == "1/K"
        # NdFeB loses 0.12 %/K, and the runs are 3 K apart.
        assert all(-2e-3 < one.parameters[name].value < -5e-4 for name in NAMES[::2])
    assert opened.diff(cal)["parameters"]["k_a"]["change"] == 0
    new = opened.recalibrate(hs.Log.load(folder / "later.csv", stage), what="temperature")
    assert new.diff(opened)["parameters"]["k_a"]["sigma"] is not None
    with pytest.raises(hs.LogRefused, match="fitted to warm.csv"):
        opened.recalibrate(hs.Log.load(folder / "warm.csv", stage), what="temperature")

    warm = hs.Log.load(folder / "warm.csv", stage)
    pose = opened.decoder()(hall=warm.hall, caps=warm.caps, mount=warm.mount, body=warm.body)
    host_fit(
        "decode", "p.bin", folder / "warm.csv", "--stage", toml, "--out", "pose.npy", "--format", "npy"
    )
    assert np.array_equal(bits(pose), bits(np.load(folder / "pose.npy")))
    # Without temperatures, or with one that cannot be true, each row is marked and decoded as at T0.
    none = opened.decoder()(hall=warm.hall, caps=warm.caps)
    far = opened.decoder()(hall=warm.hall, caps=warm.caps, mount=warm.mount + 273.15, body=warm.body)
    (missing,) = (bit for bit, name in hs.STATUS.items() if "temperature" in name)
    assert (none["status"] == missing).all() and (none == far).all() and (none["y_m"] != pose["y_m"]).any()


def test_an_hour_needs_the_columns_of_temperatures_and_a_day(toml: Path, stage: hs.Stage) -> None:
    with pytest.raises(ValueError, match=r"hour: .*\[temperature\]"):
        hs.simulate(stage, "service", hour=1)
    for hour in [25.0, float("nan")]:
        with pytest.raises(ValueError, match="hour: -24"):
            hs.simulate(hs.Stage.load(toml), "service", hour=hour)
