"""A planned run, and its rehearsal on a simulated stage."""

from pathlib import Path
from typing import Any

import hallstage as hs
import numpy as np
import pytest
from test_program import host_fit


@pytest.fixture
def stage(tmp_path: Path) -> hs.Stage:
    hs.write_demo(tmp_path)
    return hs.Stage.load(tmp_path / "stage.toml")


def test_plan_and_rehearsal_are_those_of_the_program(stage: hs.Stage, tmp_path: Path) -> None:
    ours = hs.plan(stage, seconds=8.0)
    ours.save(tmp_path / "ours.csv")
    run, log, truth = (tmp_path / name for name in ["run.csv", "log.csv", "truth.csv"])
    of_stage: list[str | Path] = ["--stage", tmp_path / "stage.toml"]
    done = host_fit("plan", *of_stage, "--seconds", "8", "--out", run)
    assert repr(ours).replace("µ", "u") in done.stdout.replace("µ", "u")
    assert (tmp_path / "ours.csv").read_bytes() == run.read_bytes()
    host_fit("simulate", *of_stage, "--plan", run, "--seed", "3", "--out", log, "--truth", truth)
    simulated, read = hs.simulate(stage, ours, seed=3), hs.Log.load(log, stage)
    assert (simulated.hall == read.hall).all() and (simulated.reference == read.reference).all()
    written = np.loadtxt(truth, delimiter=",", skiprows=1)[:, 2:] * 1e-9
    np.testing.assert_allclose(simulated.truth, written, rtol=0, atol=1e-11)
    again = hs.simulate(stage, ours.trajectory, seed=3)
    assert (again.hall == read.hall).all()


def test_a_rehearsal_predicts_a_good_calibration(stage: hs.Stage) -> None:
    plan = hs.plan(stage, seconds=20.0)
    assert plan.trajectory.shape == (10_001, 6) and plan.seconds == 20.0
    assert plan.details["service"]["x"]["ratio"] < 1.03
    simulated = hs.simulate(stage, plan)
    assert isinstance(simulated, hs.Log) and simulated.truth.shape == (len(simulated), 6)
    hs.fit(simulated)


def test_a_protocol_has_its_movements(stage: hs.Stage) -> None:
    service = hs.simulate(stage, "service", seed=2)
    assert (len(service), service.movement.max()) == (32_000, 7)


@pytest.mark.parametrize(
    ("argument", "value", "says"),
    [
        ("run", "dance", "paper, combined"),
        ("run", np.zeros((3, 5)), r"\(n, 6\)"),
        ("run", np.zeros((0, 6)), "no rows"),
        ("run", np.full((3, 6), np.nan), "finite"),
        ("run", np.full((3, 6), 20.0), "absurd"),
        ("run", [[0, 0, 0, -8e-3, 0, 0]], "hit its magnet"),
        ("run", None, r"\(n, 6\)"),
        ("seed", -1, "from 0"),
    ],
)
def test_a_wrong_argument_of_a_rehearsal_is_named(stage: hs.Stage, argument: str, value: Any, says: str) -> None:
    arguments: dict[str, Any] = {"run": "paper", argument: value}
    with pytest.raises(ValueError, match=f"^{argument}: .*({says})"):
        hs.simulate(stage, **arguments)


@pytest.mark.parametrize("seconds", [0.0, -1.0, float("nan"), float("inf"), 601.0, 0.01])
def test_a_length_without_a_plan_is_named(stage: hs.Stage, seconds: float) -> None:
    with pytest.raises(ValueError, match="^seconds: "):
        hs.plan(stage, seconds=seconds)
