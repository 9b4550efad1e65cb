"""Results of papers on a tiny run: kept piece by piece, taken up again, and made into a page."""

from __future__ import annotations

import re

import pytest
from papers import __main__ as driver
from papers import control, pieces
from papers.pieces import Piece, complete

from echoset.control import figures

SMALL = {"steps": 170, "mean_size": 4.0}


@pytest.fixture(autouse=True)
def small(monkeypatch):
    """Short runs with few targets, which still cross all regions."""
    few = {name: changes | SMALL for name, changes in figures.CONDITIONS.items()}
    monkeypatch.setattr(figures, "CONDITIONS", few)


def test_a_page_is_made_once_and_taken_up_where_it_was(tmp_path):
    kept, first, again = tmp_path / "pieces", tmp_path / "first", tmp_path / "again"
    for folder in (first, again):
        folder.mkdir()
    driver.make(control, 0.0, first, kept, 2)
    made = {path: path.stat().st_ino for path in kept.iterdir()}
    assert len(made) == len(control.pieces(0.0)) == len(figures.CONDITIONS)
    lost = next(iter(made))
    lost.unlink()
    driver.make(control, 0.0, again, kept, 1)
    remade = {path: path.stat().st_ino for path in kept.iterdir()}
    assert set(remade) == set(made)
    assert all(remade[path] == made[path] for path in made if path != lost)
    page = (again / "control.md").read_text()
    assert page == (first / "control.md").read_text()
    assert "2 runs" in page and "Seed 1" in page
    for table in re.findall(r"(?:^\|.*\n)+", page, re.M):
        widths = {line.count(" | ") for line in table.splitlines()}
        assert len(widths) == 1, table
    assert len(re.findall(r"-?\d+\.\d+ ± \d+\.\d+", page)) > 100
    assert "nan" not in page
    pictures = re.findall(r"!\[.*?\]\((.*?)\)", page)
    assert len(pictures) == 3
    for picture in pictures:
        assert (again / picture).read_bytes() == (first / picture).read_bytes()


def test_what_decides_a_result_decides_its_file(tmp_path, monkeypatch):
    piece = Piece(control.run, ("naive 0.6 1", range(2)))
    others = [
        Piece(control.run, ("naive 0.6 1", range(3))),
        Piece(control.run, ("naive 0.8 10", range(2))),
        Piece(control.published_runs, ("naive 0.6 1", range(2))),
    ]
    paths = {p.path(tmp_path) for p in (piece, *others)}
    assert len(paths) == 4
    monkeypatch.setattr(pieces, "sources", lambda: "changed")
    assert piece.path(tmp_path) not in paths


def test_a_piece_that_fails_leaves_nothing_and_is_told(tmp_path):
    good = Piece(control.published_runs, ("naive 0.6 1",))
    bad = Piece(control.published_runs, ("no such condition",))
    with pytest.raises(KeyError, match="no such condition"):
        complete([good, bad], tmp_path, 1, "")
    assert list(tmp_path.iterdir()) == [good.path(tmp_path)]
    assert good.result(tmp_path) == 30
