#!/usr/bin/env python3
"""MEALPY's TLBO (its class OriginalTLO) and this program's TLBO and SHTLBO on the paper's experiment.

    python3 host-fit/benches/mealpy/compare.py

Makes a virtual environment under target/mealpy, installs MEALPY into it with pip, has the
benchmark `search` write the problem (200 rows, 192 unknowns) and measure itself, then runs
MEALPY on the same problem: Np = Gm = 100, the objective vectorised over the rows by NumPy.
First it checks that both programs give one individual the same fitness. Prints `RESULT
key=value` lines and the ratios. Takes about a minute after the installation.
"""

import csv
import pathlib
import statistics
import subprocess
import sys
import time
import venv

ROOT = pathlib.Path(__file__).resolve().parents[3]
FOLDER = ROOT / "target" / "mealpy"
SEEDS = 5
POPULATION = GENERATIONS = 100


def in_environment():
    """Makes the environment if it is missing, then runs this file again inside it."""
    python = FOLDER / "venv" / ("Scripts/python.exe" if sys.platform == "win32" else "bin/python")
    if not python.exists():
        venv.create(FOLDER / "venv", with_pip=True)
        subprocess.run([python, "-m", "pip", "install", "--quiet", "mealpy==3.0.3"], check=True)
    sys.exit(subprocess.run([python, __file__, "--inside"]).returncode)


def ours():
    """The RESULT lines of the benchmark, which also writes rows.csv and unknowns.csv."""
    command = ["cargo", "bench", "-p", "host-fit", "--bench", "search", "--", FOLDER]
    output = subprocess.run(command, cwd=ROOT, check=True, capture_output=True, text=True).stdout
    lines = [line.split()[1].split("=") for line in output.splitlines() if line.startswith("RESULT")]
    return {key: float(value) for key, value in lines}


def read(name):
    """The columns of a CSV file as NumPy arrays."""
    import numpy

    with open(FOLDER / name, newline="") as file:
        rows = list(csv.DictReader(file))
    return {key: numpy.array([float(row[key]) for row in rows]) for key in rows[0]}


def fitness_function(rows):
    """Equations 31 to 33 and the fitness, for one individual in SI units."""
    import numpy

    movement = rows["movement"].astype(int)
    signal = numpy.array([rows["s_a_um"], rows["s_b_um"], rows["s_c_um"]])
    vertical = numpy.array([rows["z_m"], rows["rx_rad"], rows["ry_rad"]])
    reference = numpy.array([rows["x_um"], rows["y_um"], rows["rz_urad"]])

    def fitness(x):
        h1x, h1y, h2x, h2y, h3x, h3y = x[:6]
        (s1, s2, s3), (c1, c2, c3) = numpy.sin(x[6:9]), numpy.cos(x[6:9])
        eta, slopes = x[9:12], x[12:21].reshape(3, 3).T
        delta_um = 1e6 * x[21:].reshape(-1, 3)[movement].T
        plane = numpy.array([
            [-s1, c1, h1x * c1 + h1y * s1],
            [-s2, c2, h2y * s2 - h2x * c2],
            [c3, s3, h3x * s3 - h3y * c3],
        ])
        phi = slopes @ vertical + eta[:, None]
        pose = numpy.linalg.solve(plane, signal / phi - delta_um / eta[:, None])
        return float(numpy.sqrt(numpy.mean((pose - reference) ** 2)))

    return fitness


def theirs(fitness, low, high):
    """Time per evaluation in us and final fitness of MEALPY's TLBO, medians of seeds."""
    from mealpy import FloatVar
    from mealpy.human_based import TLO

    times, ends = [], []
    for seed in range(1, SEEDS + 1):
        calls = 0

        def counted(x):
            nonlocal calls
            calls += 1
            return fitness(x)

        problem = {"obj_func": counted, "bounds": FloatVar(lb=low, ub=high), "minmax": "min", "log_to": None}
        model = TLO.OriginalTLO(epoch=GENERATIONS, pop_size=POPULATION)
        started = time.perf_counter()
        best = model.solve(problem, seed=seed)
        times.append((time.perf_counter() - started) * 1e6 / calls)
        ends.append(best.target.fitness)
        print(f"mealpy seed {seed}: {calls} evaluations, {times[-1]:.1f} us each, fitness {ends[-1]:.3f}")
    return statistics.median(times), statistics.median(ends)


def main():
    figures = ours()
    rows, unknowns = read("rows.csv"), read("unknowns.csv")
    fitness = fitness_function(rows)
    have, want = fitness(unknowns["individual"]), figures["fitness_of_individual"]
    if abs(have - want) > 1e-9 * want:
        sys.exit(f"not the same problem: fitness {have} here, {want} there")
    figures["mealpy_us_per_evaluation"], figures["mealpy_fitness"] = theirs(
        fitness, unknowns["low"], unknowns["high"]
    )
    for key, value in figures.items():
        print(f"RESULT {key}={value:.4f}")
    for name in ["tlbo", "shtlbo"]:
        time_ratio = figures["mealpy_us_per_evaluation"] / figures[f"{name}_us_per_evaluation"]
        error_ratio = figures["mealpy_fitness"] / figures[f"{name}_fitness"]
        print(f"RESULT mealpy_over_{name}_time={time_ratio:.1f}")
        print(f"RESULT mealpy_over_{name}_fitness={error_ratio:.3f}")


if __name__ == "__main__":
    main() if "--inside" in sys.argv else in_environment()
