"""What the tests share: the shipped logs, a calibration of one, the program beside the package."""

import shutil
import signal
import subprocess
import sysconfig
from collections.abc import Callable
from pathlib import Path

import hallstage as hs
import pytest

DATA = Path(__file__).parents[2] / "data"
#: The program of the wheel.
PROGRAM = str(shutil.which("host-fit", path=sysconfig.get_path("scripts")))
HostFit = Callable[..., Path]


@pytest.fixture(scope="session", autouse=True)
def ctrl_c() -> None:
    """A program that a shell started in the background ignores Ctrl-C."""
    signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture(scope="session")
def stage() -> hs.Stage:
    return hs.Stage.load(DATA / "stage.toml")


@pytest.fixture(scope="session")
def run30(stage: hs.Stage) -> hs.Log:
    return hs.Log.load(DATA / "run30.csv.gz", stage)


@pytest.fixture(scope="session")
def service(stage: hs.Stage) -> hs.Log:
    return hs.Log.load(DATA / "service.csv.gz", stage)


@pytest.fixture(scope="session")
def cal(run30: hs.Log) -> hs.Calibration:
    return hs.fit(run30, serial="S11", created="2026-11-25")


def program_in(folder: Path) -> HostFit:
    """Runs the program in a folder, which it gives."""

    def run(*arguments: str | Path) -> Path:
        subprocess.run([PROGRAM, "-q", *arguments], cwd=folder, check=True)
        return folder

    return run


@pytest.fixture
def host_fit(tmp_path: Path) -> HostFit:
    """Runs the program in a folder of its own."""
    return program_in(tmp_path)


@pytest.fixture(scope="session")
def coils(tmp_path_factory: pytest.TempPathFactory, stage: hs.Stage) -> Path:
    """Logs of a stage with motor coils beside its probes, which are read at three instants: a planned run, run.csv.gz,
    and fast moves, fast.csv.gz, with their true poses, truth.csv."""
    folder = tmp_path_factory.mktemp("coils")
    simulate = ["simulate", "--stage", DATA / "stage.toml", "--coil-cm", "5", "--probe-lag-us=200,0,-200", "--seed", "8"]
    hs.plan(stage, seconds=30).save(folder / "plan.csv")
    host_fit = program_in(folder)
    host_fit(*simulate, "--plan", "plan.csv", "--out", "run.csv.gz")
    return host_fit(*simulate, "--protocol", "fast", "--out", "fast.csv.gz", "--truth", "truth.csv")


@pytest.fixture(scope="session")
def in_motion(coils: Path, stage: hs.Stage) -> hs.Calibration:
    """The calibration of a stage with coils and late probes."""
    return hs.fit(hs.Log.load(coils / "run.csv.gz", stage), model="field")
