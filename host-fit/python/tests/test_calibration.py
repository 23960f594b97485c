"""Fits and their results, which equal the results of the program."""

import json
import signal
import threading
import time
from pathlib import Path

import hallstage as hs
import numpy as np
import pytest
from conftest import DATA, HostFit


def without_times(figures: dict[str, object]) -> dict[str, object]:
    return {key: value for key, value in figures.items() if key not in ("elapsed_s", "solver_s", "logs")}


def test_a_fit_writes_the_bytes_and_figures_of_the_program(
    cal: hs.Calibration, host_fit: HostFit
) -> None:
    folder = host_fit(
        "fit", DATA / "run30.csv.gz", "--stage", DATA / "stage.toml", "--out", "p.bin",
        "--serial", "S11", "--created", "2026-11-25", "--json", "p.json",
    )  # fmt: skip
    cal.save(folder / "own.bin")
    for name in ["", ".posterior"]:
        assert (folder / f"own.bin{name}").read_bytes() == (folder / f"p.bin{name}").read_bytes()
    assert cal.blob == (folder / "p.bin").read_bytes()
    written = json.loads((folder / "p.json").read_text())
    assert cal.figures is not None
    assert without_times(cal.figures) == without_times(written)


def test_each_option_is_that_of_the_program(stage: hs.Stage, host_fit: HostFit) -> None:
    paper = hs.read_log(DATA / "paper.csv.gz", stage)
    own = hs.fit(
        paper, model="31", solver="lm", project="delta", loss="none", train=400, draw="plain", seed=3,
        force=True,
    )  # fmt: skip
    folder = host_fit(
        "fit", DATA / "paper.csv.gz", "--stage", DATA / "stage.toml", "--out", "p.bin", "--model", "31",
        "--solver", "lm", "--project", "delta", "--loss", "none", "--train", "400", "--draw", "plain",
        "--seed", "3", "--force",
    )  # fmt: skip
    assert own.blob == (folder / "p.bin").read_bytes()
    assert own.model == "31" and own.blob != hs.fit(paper, model="31").blob
    searched = hs.fit(paper, model="31", solver="shtlbo", population=8, generations=40, force=True)
    assert searched.figures is not None and searched.figures["solver"] == "shtlbo"


def test_parameters_have_what_is_known_of_them(cal: hs.Calibration) -> None:
    eta = cal.parameters["eta_a"]
    assert eta.name == "eta_a" and eta.std is not None and eta.interval is not None
    assert 0.5 < eta.value < 1.2 and 0 < eta.std < 0.01
    assert np.isclose(eta.interval[1] - eta.value, 1.96 * eta.std, rtol=1e-3)
    assert cal.parameters["lever_arm_b"].unit == "m" and len(cal.parameters) == 81


def test_covariance_and_correlations_are_arrays_and_frames_have_names(cal: hs.Calibration, run30: hs.Log) -> None:
    of_31 = hs.fit(run30, model="31")
    for one in [cal, of_31]:
        covariance, correlations = one.covariance, one.correlations
        assert one.names == list(one.parameters)[: len(covariance)]
        assert type(covariance) is type(correlations) is np.ndarray
        std = [one.parameters[name].std for name in one.names]
        assert np.allclose(np.sqrt(np.diag(covariance)), np.array(std, dtype=float))
        assert np.allclose(covariance, covariance.T) and np.allclose(np.diag(correlations), 1)
        assert np.all(np.abs(correlations) < 1 + 1e-9)
        frame = one.covariance_frame()
        assert list(frame.index) == list(frame.columns) == one.names and np.array_equal(frame, covariance)
        table = one.to_frame()
        assert list(table.index) == list(one.parameters) and list(table.columns) == ["value", "std", "unit"]
        assert np.allclose(table.loc[one.names, "std"].astype(float), np.array(std, dtype=float))


def test_residuals_are_the_errors_of_the_report(cal: hs.Calibration, run30: hs.Log) -> None:
    r = cal.residuals()
    assert len(r) == len(r.x) == len(r.weight) == len(run30)
    for axis, unit in [("x", "um"), ("y", "um"), ("rz", "urad")]:
        rms = np.sqrt(np.mean(getattr(r, axis) ** 2)) * 1e6
        assert np.isclose(rms, cal.errors[axis][f"rmse_{unit}"], rtol=1e-6)
    assert np.all((r.weight >= 0) & (r.weight <= 1)) and r.weight.max() == 1
    assert np.array_equal(r.time, run30.t_us * 1e-6) and np.array_equal(r.movement, run30.movement)


def test_a_spectrum_of_the_residuals_has_their_power(cal: hs.Calibration) -> None:
    r = cal.residuals()
    f, asd = r.asd("x")
    assert f.shape == asd.shape and np.isclose(f[-1], 250, atol=0.2)
    # Parseval: what is below the first bin is missing.
    assert 0.5 < np.sum(asd**2) * f[0] / np.mean(r.x**2) < 1.1
    with pytest.raises(ValueError, match="axis"):
        r.asd("z")  # type: ignore[arg-type]


def test_residuals_are_plotted(cal: hs.Calibration) -> None:
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("agg")
    figure = cal.residuals().plot()
    assert len(figure.axes) == 3 and "m" in figure.axes[0].get_ylabel()


def test_a_notebook_shows_verdict_errors_and_findings(cal: hs.Calibration) -> None:
    html = cal._repr_html_()
    assert html is not None and "<b>Good</b>" in html and "rms in service" in html
    assert "Nothing is wrong with the log" in html and "<html" not in html
    assert "S11" in repr(cal) and "Good" in repr(cal)


def test_an_evaluation_has_the_figures_of_the_program_and_a_page(
    cal: hs.Calibration, service: hs.Log, host_fit: HostFit, tmp_path: Path
) -> None:
    cal.save(tmp_path / "p.bin")
    host_fit("eval", "p.bin", DATA / "service.csv.gz", "--stage", DATA / "stage.toml", "--json", "e.json")
    v = cal.evaluate(service)
    written = json.loads((tmp_path / "e.json").read_text())
    assert without_times(v.figures) == without_times(written)
    assert v.refusal is None and v.errors == written["errors"]
    page = tmp_path / "certificate.html"
    v.report(page, operator="A<b", notes={"probe B": "1234"}, created="2026-11-25")
    text = page.read_text()
    for part in ["Verification of a calibration", "A&lt;b", "probe B", "2026-11-25", "SHA-256"]:
        assert part in text
    assert str(DATA) not in text
    assert len(v.residuals()) == len(service)
    cal.report(tmp_path / "fit.html", operator="me")
    assert "Calibration report" in (tmp_path / "fit.html").read_text()


def test_a_calibration_of_another_stage_is_refused_by_an_evaluation(
    cal: hs.Calibration, run30: hs.Log
) -> None:
    swapped = arrays_of(run30, hall=np.ascontiguousarray(run30.hall[:, [1, 0, 2]]))
    v = cal.evaluate(swapped)
    assert v.refusal is not None and "does not describe this log" in v.refusal


def arrays_of(log: hs.Log, **other: object) -> hs.Log:
    x, y, rz = log.reference.T
    arrays: dict[str, object] = {
        "t_us": log.t_us, "movement": log.movement, "hall": log.hall, "caps": log.caps,
        "x": x, "y": y, "rz": rz,
    }  # fmt: skip
    return hs.Log.from_arrays(log.stage, **(arrays | other))  # type: ignore[arg-type]


def test_a_recalibration_finds_no_change_in_the_same_stage_and_is_that_of_the_program(
    cal: hs.Calibration, service: hs.Log, host_fit: HostFit, tmp_path: Path
) -> None:
    cal.save(tmp_path / "old.bin")
    host_fit(
        "recalibrate", "old.bin", DATA / "service.csv.gz", "--stage", DATA / "stage.toml", "--what", "gains",
        "--out", "new.bin", "--created", "later",
    )  # fmt: skip
    new = cal.recalibrate(service, what="gains", created="later")
    new.save(tmp_path / "own.bin")
    for name in ["", ".posterior"]:
        assert (tmp_path / f"own.bin{name}").read_bytes() == (tmp_path / f"new.bin{name}").read_bytes()
    old = hs.Calibration.open(tmp_path / "old.bin", service.stage)
    assert old.recalibrate(service, "gains", created="later").blob == new.blob
    change = new.diff(cal)
    assert abs(change["parameters"]["eta_a"]["sigma"]) < 5 and not change["same_logs"]
    assert new.figures is not None and new.figures["what"] == "gains" and new.verdict == "good"
    with pytest.raises(ValueError, match="residuals"):
        new.residuals()


def test_a_calibration_is_read_with_what_is_known_of_it(
    cal: hs.Calibration, stage: hs.Stage, tmp_path: Path
) -> None:
    cal.save(tmp_path / "p.bin")
    read = hs.Calibration.open(tmp_path / "p.bin", stage)
    assert read.blob == cal.blob and np.array_equal(read.covariance, cal.covariance)
    name = "eta_c"
    assert np.isclose(read.parameters[name].value, cal.parameters[name].value, rtol=1e-6)
    assert read.parameters[name].std == cal.parameters[name].std
    assert read.figures is None and read.verdict is None and read._repr_html_() is None
    (tmp_path / "p.bin.posterior").unlink()
    alone = hs.Calibration.open(tmp_path / "p.bin", stage)
    assert alone.parameters[name].std is None
    with pytest.raises(ValueError, match="covariance"):
        alone.covariance
    with pytest.raises(ValueError, match="posterior"):
        alone.recalibrate(arrays_of(hs.read_log(DATA / "service.csv.gz", stage)), "all")


def test_a_log_is_checked(run30: hs.Log) -> None:
    found = hs.check(run30)
    assert found == [] and found.verdict == "good" and found.refusal is None
    swapped = hs.check(arrays_of(run30, hall=np.ascontiguousarray(run30.hall[:, [1, 0, 2]])))
    assert swapped[0].code == "channels_swapped" and swapped[0].severity == "refuse"
    assert swapped.refusal is not None and swapped[0].message in swapped.refusal
    assert "channels_swapped" in swapped._repr_html_()


def test_a_refused_log_raises_its_findings_and_is_fitted_by_force(run30: hs.Log) -> None:
    inverted = run30.hall.copy()
    inverted[:, 2] *= -1
    log = arrays_of(run30, hall=inverted)
    with pytest.raises(hs.LogRefused, match="refused") as raised:
        hs.fit(log)
    assert raised.value.code == "no_fit" and raised.value.findings[0].code == "channel_inverted"
    with pytest.raises(hs.LogRefused, match="limit"):
        hs.fit(run30, limit="x=0.1um")
    forced = hs.fit(run30, limit="x=0.1um", force=True)
    assert forced.forced and not hs.fit(run30).forced


@pytest.mark.parametrize(
    ("wrong", "argument"),
    [
        ({"model": "13"}, "model"), ({"solver": "newton"}, "solver"), ({"project": "all"}, "project"),
        ({"loss": "l1"}, "loss"), ({"loss": "huber", "solver": "shtlbo"}, "loss"), ({"train": 0}, "train"),
        ({"draw": "x"}, "draw"), ({"population": 3}, "population"), ({"generations": 0}, "generations"),
        ({"serial": "s" * 33}, "serial"), ({"created": "s" * 33}, "created"), ({"limit": "x=1"}, "x=1"),
        ({"model": "field", "solver": "shtlbo"}, "solver"),
    ],
)  # fmt: skip
def test_a_wrong_option_is_named(run30: hs.Log, wrong: dict[str, object], argument: str) -> None:
    with pytest.raises(ValueError, match=argument):
        hs.fit(run30, **wrong)  # type: ignore[arg-type]


def test_other_threads_go_on_while_a_log_is_fitted(run30: hs.Log) -> None:
    ticks = 0
    done = threading.Event()

    def count() -> None:
        nonlocal ticks
        while not done.is_set():
            ticks += 1
            time.sleep(0.001)

    thread = threading.Thread(target=count)
    thread.start()
    before = ticks
    hs.fit(run30)
    after = ticks
    done.set()
    thread.join()
    assert after - before > 10


def test_ctrl_c_ends_a_search_that_shows_how_far_it_is_and_the_next_fit_works(
    run30: hs.Log, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("hallstage._progress._is_seen", lambda: True)
    paper = hs.read_log(DATA / "paper.csv.gz", run30.stage)
    timer = threading.Timer(1.5, signal.raise_signal, [signal.SIGINT])
    timer.start()
    with pytest.raises(KeyboardInterrupt):
        hs.fit(paper, model="31", solver="shtlbo", project="none", generations=10_000_000)
    shown = capsys.readouterr().err
    assert " % " in shown and shown.endswith("\r")
    assert hs.fit(run30).verdict == "good"


def test_the_budget_of_a_fit_is_a_frame_also_after_it_is_read_from_its_files(
    cal: hs.Calibration, tmp_path: Path
) -> None:
    pytest.importorskip("pandas")
    cal.save(tmp_path / "p.bin")
    read = hs.Calibration.open(tmp_path / "p.bin", hs.Stage.load(DATA / "stage.toml"))
    frame = read.budget
    assert frame is not None and cal.budget is not None and frame.equals(cal.budget)
    assert cal.figures is not None
    figures = cal.figures["budget"]
    sources = len(figures["sources"])
    squares = (frame["rms_x_um"][:sources] ** 2).sum()
    combined = frame[frame["source"] == "combined"]["rms_x_um"].item()
    assert np.isclose(combined, figures["combined"]["rms"]["x_um"]) and np.isclose(combined**2, squares)
    assert list(frame["source"][sources + 1 :]) == [f"not included: {name}" for name in figures["not_included"]]
