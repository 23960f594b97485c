"""The rate of decoding arrays and of their uncertainties on one core, and the time of a fit by the package and by the program.

    python host-fit/python/benches/package.py [target/release/host-fit]

Prints `RESULT key=value` lines, medians of several runs, in processor time. The fit is to the shipped run of 30 s, with
reading and writing. Without a path it starts the program `host-fit` of the package's own environment.
"""

import os
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Literal

import hallstage as hs
import numpy as np

RUNS = 15
ROWS = 2_000_000


def seconds(work: Callable[[], object], runs: int = RUNS) -> float:
    """Processor time of this process and of the programs it starts."""

    def now() -> float:
        return sum(os.times()[:4])

    def once() -> float:
        started = now()
        work()
        return now() - started

    return statistics.median(once() for _ in range(runs))


def main() -> None:
    folder = Path(tempfile.mkdtemp())
    hs.write_demo(folder)
    stage_file, run30 = folder / "stage.toml", folder / "run30.csv.gz"
    stage = hs.Stage.load(stage_file)
    service = hs.Log.load(folder / "service.csv.gz", stage)
    times = ROWS // len(service)
    hall = np.tile(service.hall, (times, 1))
    caps = np.tile(service.caps, (times, 1)) if service.caps is not None else hall
    models: list[Literal["31", "field"]] = ["31", "field"]
    for model in models:
        dec = hs.fit(hs.Log.load(run30, stage), model=model).decoder()
        rate = len(hall) * 1e-6 / seconds(partial(dec, hall=hall, caps=caps))
        print(f"RESULT decode_{model}_million_ticks_per_s={rate:.1f}", flush=True)
    rate = len(hall) * 1e-6 / seconds(partial(dec.uncertainty, hall=hall, caps=caps), 3)
    print(f"RESULT uncertainty_field_million_rows_per_s={rate:.2f}", flush=True)

    program = sys.argv[1] if len(sys.argv) > 1 else str(Path(sys.executable).parent / "host-fit")
    command: list[str | Path] = [program, "-q", "fit", run30, "--stage", stage_file, "--out", folder / "p.bin"]

    def package() -> None:
        hs.fit(hs.Log.load(run30, stage)).save(folder / "own.bin")

    def started() -> None:
        subprocess.run(command, check=True)

    # In turn, so that both run under the same load.
    pairs = [(seconds(package, 1), seconds(started, 1)) for _ in range(RUNS)]
    own, other = (statistics.median(times) for times in zip(*pairs, strict=True))
    assert (folder / "own.bin").read_bytes() == (folder / "p.bin").read_bytes()
    print(f"RESULT fit_package_s={own:.3f} fit_program_s={other:.3f} ratio={own / other:.2f}")


if __name__ == "__main__":
    main()
