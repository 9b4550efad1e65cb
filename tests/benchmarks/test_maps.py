"""The page on targets seen in maps, of recordings so short that they say nothing."""

from __future__ import annotations

from dataclasses import replace

import pytest
from papers import __main__ as driver
from papers import maps, stations


@pytest.mark.verification
def test_the_page_has_all_that_it_compares(tmp_path, monkeypatch):
    scene = replace(stations.scene(), scans=14)
    monkeypatch.setattr(stations, "scene", lambda: scene)
    monkeypatch.setattr(maps, "NUMBERS", (3,))
    monkeypatch.setattr(maps, "BOTH", (3,))
    driver.PAPERS["maps"].write([(p, p.make(*p.arguments)) for p in maps.pieces(0.0)], tmp_path)
    page = (tmp_path / "maps.md").read_text()
    assert "2 by `tbd`, 2 by `templates`" in page and "tbd smooth 3" in page
    assert page.count("| mbm templates adaptive") == 2 == page.count("| phd tuned adaptive")
    for picture in ("maps-3.svg", "maps-tracks.svg"):
        assert picture in page and (tmp_path / picture).stat().st_size > 1000
