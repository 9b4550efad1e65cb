"""Presets are files beside an estimator, and what plugins add."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from echoset.estimators import presets
from echoset.models import registry
from echoset.models.errors import ParameterError

ENTRY_POINTS = """[echoset.presets]
phd.harbour = plugin_presets:HARBOUR
"""


@pytest.fixture
def package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    folder = tmp_path / "some_filters" / "presets"
    folder.mkdir(parents=True)
    (tmp_path / "some_filters" / "__init__.py").write_text("")
    (folder / "a.fast.yaml").write_text("# Chosen on seeds\n# 1 to 3.\ngate: 1e1\n")
    (folder / "a.empty.yaml").write_text("")
    (folder / "b.fast.yaml").write_text("gate: 2\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    yield "some_filters"
    sys.modules.pop("some_filters", None)


def test_files_of_an_estimator(package):
    found = presets.Presets(package, "a")
    assert dict(found) == {"empty": {}, "fast": {"gate": 10.0}}
    assert found.comment("fast") == "Chosen on seeds 1 to 3."


def test_a_plugin_adds_one(tmp_path, monkeypatch):
    (tmp_path / "plugin_presets.py").write_text("HARBOUR = {'gate': 9.0}\n")
    info = tmp_path / "harbour-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: harbour\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(ENTRY_POINTS)
    monkeypatch.syspath_prepend(str(tmp_path))
    registry._points.cache_clear()
    assert presets.preset("phd", "harbour") == {"gate": 9.0}
    assert "tuned" in presets.presets("phd")
    with pytest.raises(ParameterError, match=r"phd has no preset 'harbor' \(did you mean"):
        presets.preset("phd", "harbor")
    registry._points.cache_clear()
