"""The program `host-fit` in the wheel, and the logs that it brings."""

import shutil
import subprocess
from pathlib import Path

import hallstage as hs
from conftest import PROGRAM


def host_fit(*arguments: str | Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run([PROGRAM, *arguments], capture_output=True, text=True)


def test_the_program_prints_its_help_and_explains_wrong_usage() -> None:
    help_ = host_fit("--help")
    assert help_.returncode == 0 and "host-fit demo" in help_.stdout or "Usage" in help_.stdout
    wrong = host_fit("fit", "--no-such-option")
    assert wrong.returncode == 2 and "--no-such-option" in wrong.stderr


def test_the_program_checks_the_shipped_log(tmp_path: Path) -> None:
    hs.write_demo(tmp_path)
    done = host_fit("check", tmp_path / "run30.csv.gz", "--stage", tmp_path / "stage.toml")
    assert (done.returncode, done.stderr) == (0, "")
    shutil.move(tmp_path / "stage.toml", tmp_path / "other.toml")
    missing = host_fit("check", tmp_path / "run30.csv.gz", "--stage", tmp_path / "stage.toml")
    assert missing.returncode == 3 and "stage.toml" in missing.stderr


def test_the_demo_data_are_those_of_the_repository(tmp_path: Path) -> None:
    hs.write_demo(tmp_path / "new")
    data = Path(__file__).parents[2] / "data"
    for name in ["paper.csv.gz", "run30.csv.gz", "service.csv.gz", "stage.toml"]:
        assert (tmp_path / "new" / name).read_bytes() == (data / name).read_bytes()
