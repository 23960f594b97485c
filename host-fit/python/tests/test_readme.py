"""The snippet of the README runs as it stands."""

import re
from pathlib import Path

import pytest


def test_the_readme_runs_as_it_stands(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("matplotlib").use("agg")
    monkeypatch.chdir(tmp_path)
    text = (Path(__file__).parents[1] / "README.md").read_text(encoding="utf-8")
    snippets = re.findall(r"```python\n(.*?)```", text, re.DOTALL)
    known: dict[str, object] = {}
    exec("\n".join(snippets), known)
    assert (tmp_path / "demo" / "certificate.html").exists() and "sim" in known
