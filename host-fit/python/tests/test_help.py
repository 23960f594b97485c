"""`help` shows what everything is and takes, and messages name arguments of Python."""

import pydoc
from pathlib import Path

import hallstage as hs
import numpy as np
import pytest
from test_log import columns_of


def shown(of: object) -> str:
    return pydoc.plain(pydoc.render_doc(of))


def test_help_describes_every_public_thing() -> None:
    for name in hs.__all__:
        thing = getattr(hs, name)
        if not callable(thing):
            continue
        assert thing.__doc__, name
        for member, value in vars(thing).items() if isinstance(thing, type) else ():
            is_field = issubclass(thing, tuple) and member in getattr(thing, "_fields", ())
            if not member.startswith("_") and not is_field:
                assert getattr(value, "__doc__", None), f"{name}.{member}"
    for thing, words in [
        (hs.Decoder, ["velocity", "float32", "hold"]), (hs.Finding, ["`t_s`", "evidence and remedy"]),
        (hs.Findings, ["refusal_code"]), (hs.fit, ["limit", "1.5e-6"]), (hs.Log, ["mask", "from_frame"]),
        (hs.OptimizeResult, ["generations"]), (hs.Calibration.range, ["m and rad"]),
    ]:  # fmt: skip
        assert all(word in shown(thing) for word in words), shown(thing)


def test_messages_name_arguments_and_functions_of_the_package(
    run30: hs.Log, cal: hs.Calibration, tmp_path: Path
) -> None:
    saturated = run30.hall.copy()
    saturated[4, 1] = 32767
    with pytest.raises(hs.LogError, match='skip such rows with bad_rows="skip"'):
        hs.Log.from_arrays(run30.stage, **(columns_of(run30) | {"hall": saturated}))
    with pytest.raises(ValueError, match=r'fit again, with model="field"'):
        hs.fit(run30, model="31").recalibrate(run30[:8000], "gains")
    with pytest.raises(ValueError, match="invalid value '13' for 'model'"):
        hs.fit(run30, model="13")  # type: ignore[arg-type]
    columns = columns_of(run30) | {"hall": np.repeat(run30.hall[:1], len(run30), axis=0)}
    with pytest.raises(hs.LogRefused) as refused:
        hs.fit(hs.Log.from_arrays(run30.stage, **columns), model="31")
    said = [str(refused.value), repr(cal), str(cal._repr_html_()), str(cal.details)]
    said += [finding.message for finding in refused.value.findings]
    for text in said:
        assert "--" not in text and "host-fit fit" not in text and "host-fit eval" not in text, text
