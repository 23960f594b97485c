"""Fits and their results, which equal the results of the program."""

import json
import signal
import threading
import time
from pathlib import Path
from typing import Any

import hallstage as hs
import numpy as np
import pytest
from conftest import DATA, HostFit


def in_si(value: Any) -> Any:
    """Figures of the program without times, in SI."""
    units: dict[str, tuple[float, str]] = {"um": (1e-6, "m"), "urad": (1e-6, "rad"), "us": (1e-6, "s"), "mm": (1e-3, "m"), "1/mm": (1e3, "1/m"), "1/mm2": (1e6, "1/m2")}

    def scaled(value: Any, factor: float) -> Any:
        if isinstance(value, list):
            return [scaled(one, factor) for one in value]
        return value * factor if factor != 1 and isinstance(value, int | float) else value

    if isinstance(value, list):
        return [in_si(one) for one in value]
    if not isinstance(value, dict):
        return value
    factor, unit = units.get(str(value.get("unit")), (1.0, value.get("unit")))
    out = {}
    for key, one in value.items():
        words = [units.get(word, (1.0, word)) for word in key.split("_")]
        factors = [factor] if key in ("value", "standard_error") else [factor for factor, _ in words]
        out["_".join(word for _, word in words)] = unit if key == "unit" else scaled(in_si(one), float(np.prod(factors)))
    return {key: one for key, one in out.items() if key not in ("elapsed_s", "solver_s", "logs")}


def same(have: Any, want: Any) -> bool:
    """Numbers are equal but for rounding."""
    if isinstance(want, dict):
        return list(have) == list(want) and all(same(have[key], want[key]) for key in want)
    if isinstance(want, list):
        return len(have) == len(want) and all(map(same, have, want))
    return bool(np.isclose(have, want, rtol=1e-12, atol=0)) if isinstance(want, float) else have == want


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
    assert cal.details is not None
    assert same(in_si(cal.details), in_si(written))


def test_each_option_is_that_of_the_program(stage: hs.Stage, host_fit: HostFit) -> None:
    paper = hs.Log.load(DATA / "paper.csv.gz", stage)
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
    assert searched.details is not None and searched.details["solver"] == "shtlbo"


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
    for axis in ["x", "y", "rz"]:
        assert np.isclose(np.sqrt(np.mean(getattr(r, axis) ** 2)), cal.rms[axis], rtol=1e-6)
        assert np.isclose(np.max(np.abs(getattr(r, axis))), cal.peak[axis], rtol=1e-6)
    assert np.all((r.weight >= 0) & (r.weight <= 1)) and r.weight.max() == 1
    assert np.array_equal(r.time, run30.time) and np.array_equal(r.movement, run30.movement)


def test_a_calibration_has_its_stage_noise_range_and_zero_deviations_in_si(
    cal: hs.Calibration, run30: hs.Log, tmp_path: Path
) -> None:
    assert cal.stage == run30.stage and cal.noise is not None and np.allclose(cal.noise, 0.5e-6, rtol=0.05)
    assert list(cal.rms) == ["x", "y", "rz"] and list(cal.range) == ["x", "y", "rz", "z", "rx", "ry"]
    assert cal.range["y"] > np.abs(run30.reference[:, 1]).max() and 1e-4 < cal.range["z"] < 1e-3
    assert cal.zero_deviations is not None and cal.zero_deviations.shape == (1, 3)
    assert np.all(np.abs(cal.zero_deviations) < 5e-6)
    assert cal.parameters["uw2_a"].unit == "1/m2" and abs(cal.parameters["uw2_a"].value) > 1e4
    cal.save(tmp_path / "p.bin")
    read = hs.Calibration.load(tmp_path / "p.bin", run30.stage)
    assert read.zero_deviations is None and np.isclose(read.rms["x"], cal.rms["x"], rtol=1e-6)
    assert read.noise is not None and np.allclose(read.noise, cal.noise)


@pytest.mark.parametrize("model", ["31", "field"])
def test_other_parameters_make_another_calibration_of_the_same_stage(run30: hs.Log, model: Any) -> None:
    cal = hs.fit(run30, model=model)
    wanted = {"eta_a": 1.01 * cal.parameters["eta_a"].value, "theta_c": 0.01}
    other = cal.with_parameters(wanted)
    for name, parameter in other.parameters.items():
        value = wanted.get(name, cal.parameters[name].value)
        assert np.isclose(parameter.value, value, rtol=2e-6, atol=2e-7), name
    if model == "field":
        assert other.parameters["uw_a"].std == cal.parameters["uw_a"].std
    # The gain of a probe, by 1 %, is 1 % of its motion.
    gain = cal.with_parameters({f"{name}_a": 1.01 * cal.parameters[f"{name}_a"].value for name in ["eta", "a", "b", "c"]})
    change = gain.decoder()(run30)["y_m"] - cal.decoder()(run30)["y_m"]
    assert 1e-7 < np.std(change) < 0.01 * np.std(run30.reference[:, 1])
    for wrong in [{"eta_d": 1.0}, {"eta_a": np.nan}, {"eta_a": 0.0}]:
        with pytest.raises(ValueError, match="values"):
            cal.with_parameters(wrong)


def test_draws_of_the_parameters_scatter_as_their_uncertainty(cal: hs.Calibration, service: hs.Log) -> None:
    rng = np.random.default_rng(1)
    far = service[np.flatnonzero(np.abs(service.reference[:, 0]) > 2e-4)[::200]]
    mean = [cal.parameters[name].value for name in cal.names]
    draws = rng.multivariate_normal(mean, cal.covariance, 200, method="cholesky")
    poses = [cal.with_parameters(dict(zip(cal.names, draw, strict=True))).decoder()(far)["x_m"] for draw in draws]
    scatter = np.std(poses, axis=0)
    assert cal.details is not None
    # The form of the model adds 42 nm to the uncertainty, as it does at rest, where parameters add nothing.
    at_rest, mean, worst = (place["systematic"]["x_m"] for place in cal.details["field"]["pose_uncertainty"])
    assert np.all(scatter < worst) and 0.5 < np.sqrt(np.mean(scatter**2)) / np.sqrt(mean**2 - at_rest**2) < 1.5


def test_a_spectrum_of_the_residuals_has_their_power(cal: hs.Calibration) -> None:
    r = cal.residuals()
    f, asd = r.asd("x")
    assert f.shape == asd.shape and np.isclose(f[-1], 250, atol=0.2)
    # Parseval: what is below the first bin is missing.
    assert 0.5 < np.sum(asd**2) * f[0] / np.mean(r.x**2) < 1.1
    with pytest.raises(ValueError, match="axis"):
        r.asd("z")  # type: ignore[arg-type]


def test_residuals_are_plotted_in_seconds_with_their_drift_in_one_figure(cal: hs.Calibration) -> None:
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("agg")
    from matplotlib import pyplot

    pyplot.close("all")
    r = cal.residuals()
    r.x = r.x + 2e-6 * (r.time > 15)
    panels = r.plot()
    assert len(panels) == 3 and len(pyplot.get_fignums()) == 1 and panels[2].get_xlabel() == "time, s"
    rows, drift = panels[0].get_lines()
    assert np.isclose(rows.get_xdata()[-1], 30, atol=0.1)
    # The noise of a row is 0.9 um, the step 2 um.
    assert np.std(drift.get_ydata()[2000:7000]) < 0.3 < 0.8 < np.std(rows.get_ydata()[2000:7000])
    assert np.isclose(drift.get_ydata()[10_000] - drift.get_ydata()[5000], 2, atol=0.3)
    _, ax = pyplot.subplots()
    assert r.plot(ax=ax) is ax and len(pyplot.get_fignums()) == 2


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
    assert same(in_si(v.details), in_si(written))
    assert v.refusal is None and v.verdict == written["verdict"] and v.stage == service.stage
    assert np.isclose(v.rms["rz"], 1e-6 * written["errors"]["rz"]["rmse_urad"], rtol=1e-12)
    assert np.isclose(v.peak["x"], 1e-6 * written["errors"]["x"]["peak_um"], rtol=1e-12)
    zero = [[1e-6 * movement[key] for key in ("a_um", "b_um", "c_um")] for movement in written["zero_deviations"]]
    assert np.allclose(v.zero_deviations, zero, rtol=1e-12)
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
        "time": log.time, "movement": log.movement, "hall": log.hall, "caps": log.caps,
        "x": x, "y": y, "rz": rz,
    }  # fmt: skip
    return hs.Log.from_arrays(log.stage, **(arrays | other))  # type: ignore[arg-type]


def test_a_recalibration_finds_no_change_in_the_same_stage_and_is_that_of_the_program(
    cal: hs.Calibration, service: hs.Log, host_fit: HostFit, tmp_path: Path
) -> None:
    cal.save(tmp_path / "old.bin")
    host_fit(
        "recalibrate", "old.bin", DATA / "service.csv.gz", "--stage", DATA / "stage.toml", "--what", "gains",
        "--out", "new.bin", "--created", "2026-11-26",
    )  # fmt: skip
    new = cal.recalibrate(service, what="gains", created="2026-11-26")
    new.save(tmp_path / "own.bin")
    for name in ["", ".posterior"]:
        assert (tmp_path / f"own.bin{name}").read_bytes() == (tmp_path / f"new.bin{name}").read_bytes()
    old = hs.Calibration.load(tmp_path / "old.bin", service.stage)
    assert old.recalibrate(service, "gains", created="2026-11-26").blob == new.blob
    change = new.diff(cal)
    assert abs(change["parameters"]["eta_a"]["sigma"]) < 5 and not change["same_logs"]
    assert new.details is not None and new.details["what"] == "gains" and new.verdict == "good"
    with pytest.raises(ValueError, match="residuals"):
        new.residuals()


def test_a_calibration_is_read_with_what_is_known_of_it(
    cal: hs.Calibration, stage: hs.Stage, tmp_path: Path
) -> None:
    cal.save(tmp_path / "p.bin")
    read = hs.Calibration.load(tmp_path / "p.bin", stage)
    assert read.blob == cal.blob and np.array_equal(read.covariance, cal.covariance)
    name = "eta_c"
    assert np.isclose(read.parameters[name].value, cal.parameters[name].value, rtol=1e-6)
    assert read.parameters[name].std == cal.parameters[name].std
    assert read.details is None and read.verdict is None and read._repr_html_() is None
    (tmp_path / "p.bin.posterior").unlink()
    alone = hs.Calibration.load(tmp_path / "p.bin", stage)
    assert alone.parameters[name].std is None
    with pytest.raises(ValueError, match="covariance"):
        alone.covariance
    with pytest.raises(ValueError, match="posterior"):
        alone.recalibrate(arrays_of(hs.Log.load(DATA / "service.csv.gz", stage)), "all")


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
        hs.fit(run30, limit={"x": 1e-7})
    hs.fit(run30, limit={"x": 1e-6, "rz": 3e-6})
    forced = hs.fit(run30, limit={"x": 1e-7}, force=True)
    assert forced.forced and not hs.fit(run30).forced


@pytest.mark.parametrize(
    ("wrong", "argument"),
    [
        ({"model": "13"}, "model"), ({"solver": "newton"}, "solver"), ({"project": "all"}, "project"),
        ({"loss": "l1"}, "loss"), ({"loss": "huber", "solver": "shtlbo"}, "loss"), ({"train": 0}, "train"),
        ({"draw": "x"}, "draw"), ({"population": 3}, "population"), ({"generations": 0}, "generations"),
        ({"serial": "s" * 33}, "serial"), ({"created": "s" * 33}, "created"), ({"limit": {"z": 1.0}}, "limit: a dict of x, y and rz"),
        ({"limit": {"x": -1.0}}, "limit"), ({"limit": "x=1um"}, "limit: a dict"),
        ({"model": "field", "solver": "shtlbo"}, "solver"),
    ],
)  # fmt: skip
def test_a_wrong_option_is_named(run30: hs.Log, wrong: dict[str, object], argument: str) -> None:
    with pytest.raises(ValueError, match=argument):
        hs.fit(run30, **wrong)  # type: ignore[arg-type]


def test_an_unknown_option_is_a_type_error_and_force_is_true_or_false(run30: hs.Log) -> None:
    with pytest.raises(TypeError, match="models"):
        hs.fit(run30, models="31")  # type: ignore[call-arg]
    with pytest.raises(ValueError, match="force: True or False"):
        hs.fit(run30, force="yes")  # type: ignore[arg-type]


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
    paper = hs.Log.load(DATA / "paper.csv.gz", run30.stage)
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
    read = hs.Calibration.load(tmp_path / "p.bin", hs.Stage.load(DATA / "stage.toml"))
    frame = read.budget
    assert frame is not None and cal.budget is not None and frame.equals(cal.budget)
    assert cal.details is not None
    figures = cal.details["budget"]
    sources = len(figures["sources"])
    squares = (frame["rms_x_m"][:sources] ** 2).sum()
    combined = frame[frame["source"] == "combined"]["rms_x_m"].item()
    assert np.isclose(combined, figures["combined"]["rms"]["x_m"]) and np.isclose(combined**2, squares)
    assert list(frame["source"][sources + 1 :]) == [f"not included: {name}" for name in figures["not_included"]]
