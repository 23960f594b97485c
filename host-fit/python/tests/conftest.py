"""What the tests share: the shipped logs, a calibration of one, the program beside the package."""

import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import hallstage as hs
import pytest

DATA = Path(__file__).parents[2] / "data"
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
    return hs.read_log(DATA / "run30.csv.gz", stage)


@pytest.fixture(scope="session")
def service(stage: hs.Stage) -> hs.Log:
    return hs.read_log(DATA / "service.csv.gz", stage)


@pytest.fixture(scope="session")
def cal(run30: hs.Log) -> hs.Calibration:
    return hs.fit(run30, serial="S11", created="2026-11-25")


@pytest.fixture
def host_fit(tmp_path: Path) -> HostFit:
    """Runs the program in a folder of its own, which it gives."""

    def run(*arguments: str | Path) -> Path:
        program = Path(sys.executable).parent / "host-fit"
        subprocess.run([program, "-q", *arguments], cwd=tmp_path, check=True)
        return tmp_path

    return run
