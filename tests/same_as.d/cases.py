"""The runs that `same_as` compares: every command that needs no bus, on every log."""

import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path

from candump import candump

KINDS = ("paper", "combined", "service", "run30", "run8")
MODELS = ("auto", "12", "15", "30", "31")
PROJECTIONS = ("none", "delta", "linear")
SEARCHES = "shtlbo tlbo gbtlbo mutation hybrid success-ratio".split()
# Inputs lie beside the folder of each run.
IN = "../../in"


@dataclass
class Case:
    """One run: its name, its arguments, and whether its words are to be the same too."""

    name: str
    arguments: list
    message: bool = True


@dataclass
class Log:
    """A log in the inputs, its stage file, and the blobs fitted to it, by model."""

    name: str
    shipped: bool
    blobs: dict

    @property
    def arguments(self):
        """As fit and eval take it."""
        return [f"{IN}/{self.name}.csv.gz", "--stage", f"{IN}/{self.name}.toml"]


def blobs(old, root, data, inputs):
    """Puts the logs into the inputs, beside the blobs that the old program fits to them."""
    shipped = root / "host-fit/data"
    found = [("shipped", shipped / "paper.csv.gz", shipped / "stage.toml")]
    for folder in sorted(data.glob("stage*/")) if data else []:
        if not folder.is_dir():
            continue
        own = folder / "stage.toml"
        stage = own if own.is_file() else data / "stage.toml"
        for kind in KINDS:
            log = folder / f"{kind}.csv.gz"
            if log.is_file():
                found.append((f"{folder.name}-{kind}", log, stage))
    if data and len(found) == 1:
        raise SystemExit(f"no stageN/paper.csv.gz in {data}")
    logs = []
    for name, log, stage in found:
        shutil.copy(log, inputs / f"{name}.csv.gz")
        shutil.copy(stage, inputs / f"{name}.toml")
        fitted = {}
        for model in MODELS[1:]:
            blob = f"{name}-{model}.bin"
            command = [old, "fit", f"{name}.csv.gz", "--stage", f"{name}.toml", "--out", blob]
            command += ["--serial", name, "--model", model]
            done = subprocess.run(command, cwd=inputs, capture_output=True, check=False)
            if done.returncode == 0:
                fitted[model] = f"{IN}/{blob}"
        if "31" not in fitted:
            raise SystemExit(f"{old} fits no Model (31) to {log}: {done.stderr.decode()}")
        logs.append(Log(name, name == "shipped", fitted))
    candump(root, inputs)
    return logs


def fits(log):
    """fit, with all that decides its way."""

    def fit(what, *options):
        written = ["--out", "p.bin", "--json", "fit.json"]
        return Case(f"{log.name}: fit {what}", ["fit", *log.arguments, *written, *options])

    few = ["--train", "200", "--seed", "3"]
    for model in MODELS:
        yield fit(f"model {model}", "--model", model)
        yield fit(f"model {model}, lm", "--model", model, "--solver", "lm")
    for projection in PROJECTIONS:
        project = ["--project", projection]
        yield fit(f"{projection}, lm, 500 rows", *project, "--solver", "lm", "--train", "500")
        yield fit(f"{projection}, 200 rows", *project, *few)
        if log.shipped or log.name.endswith("paper"):
            for solver in SEARCHES:
                yield fit(f"{projection}, {solver}", *project, *few, "--solver", solver)
            for model in ("12", "15", "30"):
                solver = ["--model", model, "--solver", "shtlbo"]
                yield fit(f"{projection}, model {model}, shtlbo", *project, *few, *solver)
    if log.shipped:
        yield fit("plain draw", "--draw", "plain", *few)
        paper = ["--draw", "plain", "--train", "200", "--solver", "shtlbo", "--project", "none"]
        yield fit("as the paper", *paper)
        yield fit("population", "--population", "30", *few, "--solver", "shtlbo")
        for threads in ("1", "2"):
            yield fit(f"{threads} threads", "--threads", threads, "--seed", "7")
        yield fit("serial and time", "--serial", "HS-0007", "--created", "2026-11-20")
        yield fit("bad rows", "--bad-rows", "skip")


def readers(log):
    """The commands that read a blob."""
    for model, blob in log.blobs.items():
        name = f"{log.name}, model {model}"
        for delta in ([], ["--delta", "fit"], ["--delta", "zero"]):
            arguments = ["eval", blob, *log.arguments, *delta, "--json", "eval.json"]
            yield Case(f"{name}: eval {' '.join(delta)}", arguments)
        yield Case(f"{name}: decode", ["decode", blob, *log.arguments, "--out", "pose.csv"])
        yield Case(f"{name}: inspect", ["inspect", blob, "--json", "inspect.json"])
        yield Case(f"{name}: inspect as text", ["inspect", blob])


def exports(blob):
    """export, in its formats and to its places."""
    for kind in ("bin", "hex"):
        for place in (["--slot", "0"], ["--slot", "1"], ["--address", "0x08020000"]):
            arguments = ["export", blob, "--format", kind, *place, "--out", f"exported.{kind}"]
            yield Case(f"export {kind} {' '.join(place)}", arguments)


def imports():
    """import, with and without an offset between the clocks."""
    written = ["--stage", f"{IN}/shipped.toml", "--out", "joined.csv"]
    for layout in ("16", "24"):
        record = f"{IN}/bus-{layout}.log"
        for what in ([], ["--offset-us", "3000"]):
            arguments = ["import", record, f"{IN}/interferometer.csv", *written, *what]
            yield Case(f"import, {layout} bits, {' '.join(what)}", arguments)


def cases(logs):
    """Every run on good input."""
    for log in logs:
        yield from fits(log)
        yield from readers(log)
    stages = {}
    for log in logs:
        if "-" in log.name:
            stage, kind = log.name.split("-")
            stages.setdefault(stage, {})[kind] = log
    for stage, kinds in stages.items():
        if "paper" in kinds and "combined" in kinds:
            both = [f"{IN}/{stage}-combined.csv.gz", *kinds["paper"].arguments]
            written = ["--out", "p.bin", "--json", "fit.json"]
            yield Case(f"{stage}: fit both logs", ["fit", *both, *written])
            arguments = ["eval", kinds["paper"].blobs["31"], *both, "--json", "eval.json"]
            yield Case(f"{stage}: eval both logs", arguments)
    yield from exports(logs[0].blobs["31"])
    yield from imports()
    yield Case("demo", ["demo", "--out", "."])
