"""The page on many targets, from tiny runs."""

from __future__ import annotations

import re

import pytest
from papers import __main__ as driver
from papers import crowds


@pytest.fixture
def small(monkeypatch):
    """Two scenes, two models, short recordings, and costs of few targets."""
    whole = crowds.recordings

    def short(scenario, runs, **settings):
        steps = {} if scenario == "manoeuvre" else {"steps": settings.pop("steps", 12)}
        return whole(scenario, runs, **steps, **settings)

    monkeypatch.setattr(crowds, "recordings", short)
    monkeypatch.setattr(crowds, "TARGETS", (3,))
    monkeypatch.setattr(crowds, "CLUTTER", (2, 5))
    monkeypatch.setattr(crowds, "COSTS", ((3, 5, 1000.0),))
    models = {name: crowds.MODELS[name] for name in ("cv, 0.1", "cv, 4", "imm")}
    monkeypatch.setattr(crowds, "MODELS", models)


def test_a_page_has_all_tables(small, tmp_path):
    driver.make(crowds, 0.0, tmp_path, tmp_path / "pieces", 1)
    page = (tmp_path / "crowds.md").read_text()
    assert "nan" not in page and page.count("2 runs") == 5
    tables = re.findall(r"(?:^\|.*\n)+", page, re.M)
    assert len(tables) == 6
    for table in tables:
        assert len({line.count(" | ") for line in table.splitlines()}) == 1, table
    assert "% in turns" in page and "% in straight runs" in page
