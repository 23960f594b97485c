# %% [markdown]
# # A calibration, step by step
#
# The log is one run of 30 s of a simulated stage beside laser interferometers; it ships with the package.
# Run it cell by cell in an editor or a notebook, or as a program. Pictures and results stay in `calibrated`, a
# folder that it makes where it runs.

# %% Load
import time
from pathlib import Path

import hallstage as hs
import matplotlib.pyplot as plt
import numpy as np
from scipy.optimize import least_squares

folder = Path("calibrated")
hs.write_demo(folder)
stage = hs.Stage.load(folder / "stage.toml")
log = hs.Log.load(folder / "run30.csv.gz", stage)
print(log)

# %% Look: codes of the Hall probes, and where the interferometers saw the stage
seconds = log.time
figure, (top, bottom) = plt.subplots(2, 1, sharex=True, figsize=(7, 4), layout="constrained")
top.plot(seconds, log.hall, linewidth=0.7, label=["A", "B", "C"])
top.set_ylabel("Hall code")
top.legend(loc="upper right")
bottom.plot(seconds, log.reference * 1e6, linewidth=0.7, label=["X, µm", "Y, µm", "Rz, µrad"])
bottom.set_xlabel("s")
bottom.legend(loc="upper right")
figure.savefig(folder / "log.png", dpi=80)

# %% Check: what is wrong with the log
for finding in hs.check(log):
    print(finding.severity, finding.code, finding.message, finding.cost)

# %% Fit, and what it knows about itself
started = time.perf_counter()
cal = hs.fit(log, serial="DEMO")
print(cal, f"in {time.perf_counter() - started:.2f} s", sep="\n")
for parameter in list(cal.parameters.values())[:6]:
    print(parameter.name, parameter.value, "+-", parameter.std, parameter.unit)

# %% Residuals over time, and their spectrum: mains hum, drift or a resonance would show
residuals = cal.residuals()
figure = residuals.plot()[0].figure
figure.set_size_inches(7, 4)
figure.savefig(folder / "residuals.png", dpi=80)

figure, axes = plt.subplots(figsize=(7, 3), layout="constrained")
for axis, unit in [("x", "X, µm"), ("y", "Y, µm"), ("rz", "Rz, µrad")]:
    frequency, density = residuals.asd(axis)
    axes.loglog(frequency, density * 1e6, linewidth=0.8, label=f"{unit}/√Hz")
axes.set_xlabel("Hz")
axes.legend(loc="upper right")
figure.savefig(folder / "spectrum.png", dpi=80)

# %% The same rows with SciPy: Model (31), 18 unknowns, the offset of the movement taken off in closed form
signal = log.hall * stage.hall_m_per_count
# In um and urad, as the fitness of the paper.
reference = log.reference * 1e6
names = [f"{what}_{probe}" for what in ["lever_arm", "theta", "eta", "a", "b", "c"] for probe in "abc"]


def pose(unknowns):
    """Equations (31) to (33) without the zero deviations, um and urad, (n, 3)."""
    lever, theta, eta, a, b, c = unknowns.reshape(6, 3)
    sine, cosine = np.sin(theta), np.cos(theta)
    # Rows of PM (eqs 11, 32): probes A and B along Y, C along X.
    along = np.array([[-sine[0], cosine[0]], [-sine[1], cosine[1]], [cosine[2], sine[2]]])
    phi = eta + log.vertical @ np.array([a, b, c])
    return np.linalg.solve(np.column_stack([along, lever]), (signal / phi).T).T * 1e6


def errors(unknowns):
    """What is to be minimised."""
    error = pose(unknowns) - reference
    return (error - error.mean(axis=0)).ravel()


started = time.perf_counter()
ours = hs.fit(log, model="31", solver="lm", loss="none", force=True)
ours_s = time.perf_counter() - started
a_place, b_place, c_place = stage.hall_places_m
designed = np.concatenate([[a_place[0], b_place[0], -c_place[1]], np.zeros(3), np.ones(3), np.zeros(9)])
started = time.perf_counter()
theirs = least_squares(errors, designed, x_scale="jac", method="lm")
scipy_s = time.perf_counter() - started
print(f"hallstage {ours_s:.2f} s with its judgement, SciPy {scipy_s:.2f} s")
found = np.array([ours.parameters[name].value for name in names])
for name, own, other in zip(names, found, theirs.x, strict=True):
    print(f"{name:12} {own:12.6f} {other:12.6f}")
# The same optimum.
np.testing.assert_allclose(found, theirs.x, rtol=1e-5, atol=1e-6)

# %% Decode as the controller does, to the bit, on a log that the fit has not seen
service = hs.Log.load(folder / "service.csv.gz", stage)
decoder = cal.decoder()
decoded = decoder(hall=service.hall, caps=service.caps)
print(decoded.dtype.names, decoded[0])
error = (np.column_stack([decoded["x_m"], decoded["y_m"], decoded["rz_rad"]]) - service.reference) * 1e6
print("rms in service, µm, µm, µrad:", np.sqrt((error**2).mean(axis=0)).round(3))

# %% Uncertainty of each pose: by the parameters and by the noise of the probes
uncertainty = decoder.uncertainty(service) * 1e6
share = (np.abs(error) < 1.96 * uncertainty).mean(axis=0)
print("share of the errors within 1.96 standard uncertainties:", share.round(3))

# %% Judge, and save: the blob for the controller, the certificate for the file
verification = cal.evaluate(service)
verification.report(folder / "certificate.html", operator="me")
cal.save(folder / "params.bin")
print("results in", folder)
