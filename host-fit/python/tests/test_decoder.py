"""The decoder gives the words of the target."""

from pathlib import Path
from typing import Any

import hallstage as hs
import numpy as np
import pytest
from conftest import DATA, HostFit

WORDS = ["x_m", "y_m", "rz_rad", "z_m", "rx_rad", "ry_rad", "status"]


def bits(poses: np.ndarray) -> np.ndarray:
    return np.stack([poses[name].view(np.uint32) for name in WORDS], axis=1)


@pytest.mark.parametrize("model", ["31", "field"])
def test_it_is_the_decoder_of_the_program_bit_for_bit(
    stage: hs.Stage, run30: hs.Log, host_fit: HostFit, tmp_path: Path, model: str
) -> None:
    paper = hs.Log.load(DATA / "paper.csv.gz", stage)
    assert len(paper) == 57_000
    hs.fit(run30, model=model).save(tmp_path / "p.bin")  # type: ignore[arg-type]
    host_fit(
        "decode", "p.bin", DATA / "paper.csv.gz", "--stage", DATA / "stage.toml", "--out", "pose.npy",
        "--format", "npy",
    )  # fmt: skip
    wanted = np.load(tmp_path / "pose.npy")
    dec = hs.Decoder.load(tmp_path / "p.bin")
    assert dec.model == model
    assert paper.caps is not None
    of_arrays = dec(hall=paper.hall, caps=paper.caps, invalid="zero")
    assert of_arrays.shape == (57_000,) and of_arrays.dtype.names == tuple(WORDS)
    assert np.array_equal(bits(of_arrays), bits(wanted))
    assert np.array_equal(bits(dec(paper, invalid="zero")), bits(wanted))


def test_codes_of_any_layout_give_the_same_words(cal: hs.Calibration, service: hs.Log) -> None:
    dec, hall, caps = cal.decoder(), service.hall, service.caps
    assert caps is not None
    wanted = bits(dec(hall=hall, caps=caps))
    others: list[np.ndarray] = [
        hall.astype(np.int16), hall.astype(np.int64), np.asfortranarray(hall), hall[::-1][::-1],
    ]  # fmt: skip
    for other in others:
        assert np.array_equal(bits(dec(hall=other, caps=caps)), wanted)
    assert np.array_equal(bits(dec(hall=hall[7:8], caps=caps[7:8])), wanted[7:8])
    assert np.array_equal(bits(dec(hall=hall[::3], caps=caps[::3])), wanted[::3])


def test_what_is_invalid_is_nan_zero_or_held_and_says_so(cal: hs.Calibration, service: hs.Log) -> None:
    dec, hall = cal.decoder(), service.hall.copy()
    hall[5:8, 0] = 32767
    zero = dec(hall=hall, caps=service.caps, invalid="zero")
    nan = dec(hall=hall, caps=service.caps)
    assert np.all(np.isnan(nan["x_m"][5:8])) and not np.any(np.isnan(nan["z_m"]))
    assert np.array_equal(bits(nan)[8:], bits(zero)[8:]) and np.array_equal(nan["status"], zero["status"])
    missing = hall.astype(float)
    missing[5:8, 0] = np.nan
    assert np.array_equal(bits(dec(hall=missing, caps=service.caps)), bits(nan))
    u = cal.decoder().uncertainty(hall=hall, caps=service.caps)
    assert np.all(np.isnan(u[5:8])) and np.all(np.isfinite(u[8:]))
    assert np.all(zero["x_m"][5:8] == 0) and np.all(zero["status"][5:8] & 1) and zero["z_m"][5] != 0
    names = [name for bit, name in hs.STATUS.items() if zero["status"][5] & bit]
    assert "Hall code A bad" in names and "planar pose invalid" in names
    held = dec(hall=hall, caps=service.caps, hold=2)
    assert np.all(held["x_m"][5:7] == held["x_m"][4]) and np.isnan(held["x_m"][7])
    assert np.array_equal(bits(held)[8:], bits(zero)[8:])


def test_a_long_log_is_decoded_in_pieces_that_join(cal: hs.Calibration, service: hs.Log) -> None:
    times = 2**19 // len(service) + 1
    hall, caps = np.tile(service.hall, (times, 1)), np.tile(service.caps, (times, 1))  # type: ignore[arg-type]
    once = cal.decoder()(hall=service.hall, caps=service.caps)
    assert np.array_equal(bits(cal.decoder()(hall=hall, caps=caps)), np.tile(bits(once), (times, 1)))


def test_uncertainties_are_those_of_the_program_and_cover_the_errors(
    cal: hs.Calibration, service: hs.Log, host_fit: HostFit, tmp_path: Path
) -> None:
    cal.save(tmp_path / "p.bin")
    host_fit(
        "decode", "p.bin", DATA / "service.csv.gz", "--stage", DATA / "stage.toml", "--out", "pose.npy",
        "--format", "npy", "--uncertainty",
    )  # fmt: skip
    wanted = np.load(tmp_path / "pose.npy")
    dec = hs.Decoder.load(tmp_path / "p.bin")
    assert service.caps is not None
    u = dec.uncertainty(hall=service.hall, caps=service.caps)
    assert np.allclose(dec.uncertainty(service), u, rtol=1e-12)
    assert u.shape == (len(service), 3) and u.dtype == np.float64
    for axis, name in enumerate(["u_x_m", "u_y_m", "u_rz_rad"]):
        # The program knows the drawing, the blob alone does not.
        assert np.allclose(u[:, axis], wanted[name], rtol=1e-4)
    whole = dec.uncertainty(service, whole=True)
    for axis, name in enumerate(["uc_x_m", "uc_y_m", "uc_rz_rad"]):
        assert np.allclose(whole[:, axis], wanted[name], rtol=1e-4)
    assert np.all(whole > u)
    poses = dec(service)
    error = np.stack([poses[name] for name in WORDS[:3]], axis=1) - service.reference
    covered = np.mean(np.abs(error) < 2 * u, axis=0)
    assert np.all((covered > 0.9) & (covered < 0.995)), covered


def test_a_blob_without_posterior_has_no_uncertainty(
    run30: hs.Log, cal: hs.Calibration, tmp_path: Path
) -> None:
    with pytest.raises(ValueError, match="31"):
        hs.fit(run30, model="31").decoder().uncertainty(run30)
    (tmp_path / "p.bin").write_bytes(cal.blob)
    with pytest.raises(ValueError, match="posterior"):
        hs.Decoder.load(tmp_path / "p.bin").uncertainty(run30)


def test_temperatures_are_read_where_parameters_want_them(cal: hs.Calibration, run30: hs.Log) -> None:
    dec = cal.decoder()
    arrays: dict[str, Any] = {"hall": run30.hall, "caps": run30.caps}
    warm = np.full(len(run30), 25.0)
    # These parameters know no temperature.
    assert np.array_equal(bits(dec(**arrays, mount=warm, body=warm)), bits(dec(**arrays)))
    with pytest.raises(ValueError, match="mount: 3 rows"):
        dec(**arrays, mount=warm[:3])
    with pytest.raises(ValueError, match="body: row 0"):
        dec(**arrays, body=warm * 1e9)


def test_a_wrong_argument_is_named(cal: hs.Calibration, run30: hs.Log, tmp_path: Path) -> None:
    dec, hall, caps = cal.decoder(), run30.hall, run30.caps
    cases: list[tuple[dict[str, Any], str]] = [
        ({}, "hall"), ({"hall": hall}, "caps"), ({"caps": caps}, "hall"),
        ({"hall": hall + 0.5, "caps": caps}, "hall: numbers with a fraction"), ({"hall": hall, "caps": caps, "invalid": "x"}, "invalid"), ({"hall": hall[:5], "caps": caps}, "caps"),
        ({"log": run30, "hall": hall}, "log"), ({"hall": hall[:0], "caps": caps}, "hall: no rows"),
        ({"hall": hall[:, :2], "caps": caps}, "hall: shape"),
    ]  # fmt: skip
    for wrong, words in cases:
        with pytest.raises(ValueError, match=words):
            dec(**wrong)
    with pytest.raises(FileNotFoundError):
        hs.Decoder.load(tmp_path / "none.bin")
    (tmp_path / "p.bin").write_bytes(cal.blob[:-1])
    with pytest.raises(ValueError, match=r"p\.bin"):
        hs.Decoder.load(tmp_path / "p.bin")
