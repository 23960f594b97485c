"""Poses of a moving stage are corrected as in the controller."""

import gzip
from pathlib import Path
from typing import Any

import hallstage as hs
import numpy as np
import pytest
from conftest import DATA, program_in

AXES = ["x_m", "y_m", "rz_rad"]


def planar(poses: np.ndarray) -> np.ndarray:
    return np.stack([poses[axis] for axis in AXES], axis=1)


@pytest.fixture(scope="module")
def fast(coils: Path, stage: hs.Stage) -> hs.Log:
    return hs.Log.load(coils / "fast.csv.gz", stage)


@pytest.fixture(scope="module")
def commanded(coils: Path, fast: hs.Log) -> dict[str, Any]:
    """The motion of the true poses."""
    truth = np.genfromtxt(coils / "truth.csv", delimiter=",", names=True)
    pose = np.stack([truth[name] for name in "x_nm y_nm rz_nrad z_nm rx_nrad ry_nrad".split()], axis=1) * 1e-9
    velocity, acceleration = np.zeros_like(pose), np.zeros_like(pose)
    for rows in np.split(np.arange(len(pose)), np.flatnonzero(np.diff(fast.movement)) + 1):
        velocity[rows] = np.gradient(pose[rows], 0.002, axis=0)
        acceleration[rows] = np.gradient(velocity[rows], 0.002, axis=0)
    return {"velocity": velocity[:, :3], "acceleration": acceleration}


def test_a_fit_shows_lags_and_accelerations_with_their_errors(in_motion: hs.Calibration) -> None:
    assert in_motion.details is not None
    found = in_motion.details["probe_motion"]
    assert np.all(np.abs(np.array(found["lag_s"]) - [2e-4, 0, -2e-4]) < 4 * np.array(found["standard_error_s"]))
    by_acceleration = np.abs(found["by_acceleration_m_per_m_per_s2"])
    assert by_acceleration.max() > 5e-6
    assert np.all(np.array(found["standard_error_m_per_m_per_s2"]) < 1e-6)
    # More than what would leave it good.
    assert in_motion.details["valid_up_to"]["acceleration_m_s2"] < 0.1 and in_motion.verdict == "limited"


def test_fast_moves_have_the_errors_that_an_evaluation_expects(
    in_motion: hs.Calibration, fast: hs.Log, commanded: dict[str, Any]
) -> None:
    dec = in_motion.decoder()
    movements = np.split(np.arange(len(fast)), np.flatnonzero(np.diff(fast.movement)) + 1)

    def rms(poses: np.ndarray) -> Any:
        # Each movement has its own zero deviation.
        errors = planar(poses) - fast.reference
        return np.sqrt(np.mean([np.var(errors[rows], axis=0) for rows in movements], axis=0))

    bare, corrected = rms(dec(fast)), rms(dec(fast, **commanded))
    assert np.all(corrected < 0.5 * bare)
    of = in_motion.evaluate(fast).details["errors_corrected"]
    expected = [of["x"]["rmse_m"], of["y"]["rmse_m"], of["rz"]["rmse_rad"]]
    assert np.allclose(corrected, expected, rtol=0.05)


def test_the_correction_is_that_of_the_controller_bit_for_bit(
    in_motion: hs.Calibration, fast: hs.Log, commanded: dict[str, Any]
) -> None:
    assert in_motion.details is not None
    of = in_motion.details["probe_motion"]["correction"]
    dec = in_motion.decoder()
    wanted = planar(dec(fast))
    for matrix, motion in [("acceleration_s2", "acceleration"), ("velocity_s", "velocity")]:
        for column, by in zip(np.array(of[matrix], "f4").T, commanded[motion].T.astype("f4"), strict=True):
            wanted += column * by[:, None]
    assert wanted.dtype == np.float32
    corrected = dec(fast, **commanded)
    assert np.array_equal(planar(corrected).view("u4"), wanted.view("u4"))
    assert np.array_equal(dec(hall=fast.hall, caps=fast.caps, **commanded), corrected)


def test_decode_corrects_a_log_with_its_trajectory_as_well_as_the_decoder_does(
    in_motion: hs.Calibration, fast: hs.Log, commanded: dict[str, Any], coils: Path, tmp_path: Path
) -> None:
    rows = zip(gzip.open(coils / "fast.csv.gz", "rt"), (coils / "truth.csv").open(), strict=True)
    names = "x_nm y_nm rz_nrad".split()
    columns = [(coils / "truth.csv").open().readline().strip().split(",").index(name) for name in names]
    with (tmp_path / "log.csv").open("w") as log:
        for k, (row, pose) in enumerate(rows):
            cells = [pose.split(",")[column] for column in columns]
            cmd = [str(float(cell) * 1e-9) for cell in cells] if k else ["cmd_x_m", "cmd_y_m", "cmd_rz_rad"]
            log.write(",".join([row.rstrip(), *cmd]) + "\n")
    in_motion.save(tmp_path / "p.bin")
    decode = ["decode", "p.bin", "log.csv", "--stage", DATA / "stage.toml"]
    program_in(tmp_path)(*decode, "--out", "pose.npy", "--format", "npy")
    dec = in_motion.decoder()
    poses = [dec(fast), dec(fast, **commanded), np.load(tmp_path / "pose.npy")]
    bare, mine, theirs = (np.std(planar(pose) - fast.reference, axis=0) for pose in poses)
    assert np.all(theirs < 0.5 * bare) and np.allclose(theirs, mine, rtol=0.05), (bare, mine, theirs)


def test_a_held_pose_is_the_last_corrected_one(in_motion: hs.Calibration, fast: hs.Log) -> None:
    dec, hall = in_motion.decoder(), fast.hall[:9].copy()
    hall[5:8, 0] = 32767
    motion = {"velocity": np.zeros((9, 3)), "acceleration": np.linspace(1, 2, 54).reshape(9, 6)}
    assert fast.caps is not None
    zero, held = (planar(dec(hall=hall, caps=fast.caps[:9], **motion, hold=hold, invalid="zero")) for hold in [0, 2])  # type: ignore[arg-type]
    assert np.all(zero[5:8] == 0) and np.all(held[5:7] == zero[4]) and np.all(held[7] == 0)
    assert np.array_equal(held[[*range(5), 8]], zero[[*range(5), 8]])


def test_a_motion_that_cannot_be_used_is_named(
    service: hs.Log, in_motion: hs.Calibration, fast: hs.Log, commanded: dict[str, Any]
) -> None:
    v, a = commanded["velocity"], commanded["acceleration"]
    endless = a.copy()
    endless[7, 5] = np.inf
    cases: list[tuple[dict[str, Any], str]] = [
        ({"velocity": v}, "acceleration: is missing"), ({"acceleration": a}, "velocity: is missing"),
        ({"velocity": v[:5], "acceleration": a}, "velocity: 5 rows, but log has"),
        ({"velocity": v, "acceleration": a[:5]}, "acceleration: 5 rows, but log has"),
        ({"velocity": v[:, :2], "acceleration": a}, "velocity: shape"),
        ({"velocity": v, "acceleration": a[:, :3]}, "acceleration: shape"),
        ({"velocity": v, "acceleration": endless}, "acceleration: row 7: not finite"),
    ]  # fmt: skip
    for wrong, words in cases:
        with pytest.raises(ValueError, match=words):
            in_motion.decoder()(fast, **wrong)
    with pytest.raises(ValueError, match="velocity, acceleration: the parameters have no motion correction"):
        hs.fit(service).decoder()(fast, **commanded)
