"""The layouts of the page of logs, read with the mappings that stand below them."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from echoset.formats.importers.csv import importer as csv

PAGE = Path(__file__).parents[3] / "docs/gallery.md"
SECTIONS = dict(
    part.split("\n", 1) for part in re.split(r"^## ", PAGE.read_text(), flags=re.M)[1:]
)  # fmt: skip
NOON = 1_714_521_600
"""2024-05-01T00:00:00Z in seconds after 1970."""
EXPECTED: dict[str, tuple[list[float], list[float]]] = {
    "One column per anchor, no header, times as text": (
        list(np.repeat([NOON + 34944.766, NOON + 34944.775, NOON + 34944.782], 3)),
        [3.98, 2.31, 4.05, 4.01, 2.31, 4.02, 4.0, 2.34, 4.06],
    ),
    "Tabs, millimetres, and HHMMSSmmm for the time": (
        list(np.repeat([NOON + 58107.974, NOON + 58108.074, NOON + 58140.001], 2)),
        [5.49, 3.392, 5.518, 3.345, 5.551, 3.387],
    ),
    'Semicolons, decimal commas, and words for "no range"': (
        [0, 0, 0, 0.1, 0.1, 0.2, 0.2],
        [1.52, 3.9, 1.55, 2.81, 2.85],
    ),
    "Several tags and anchors in each row": (
        [1714564800, 1714564800, 1714564800.5, 1714564800.5],
        [1.5, 3.2, 1.55, 3.14],
    ),
    "Addresses as names, and a column of quality": ([NOON + 25200, NOON + 25200.2], [1.52, 1.55]),
    "Several kinds of rows in one file": ([0, 1], [1.52, 2.81]),
    "Ticks that wrap": (
        [17.207400635, 17.207400635 + 0.010955028, 17.207400635 + 0.021910056],
        [1.5, 2.5, 1.6],
    ),
    "Frames that are counted, and a counter that restarts": ([0, 0.05, 0.1], [5.0, 5.1, 5.1]),
    "A date in six columns": ([NOON + 32459.95, NOON + 32460.05], [4.0, 4.1, 4.2]),
    "A truth with a clock and a frame of its own": ([0, 0.5, 1], [5.0, 2.9, 5.21]),
}
"""Times of the events or scans, and the distances or x of their detections."""


def blocks(title: str, tag: str) -> list[str]:
    return re.findall(rf"^```{tag}\n(.*?)^```$", SECTIONS[title], re.M | re.S)


def test_there_are_ten():
    assert list(SECTIONS) == list(EXPECTED) and len(SECTIONS) == 10


@pytest.mark.parametrize("title", EXPECTED)
def test_a_log_is_read_by_its_mapping(tmp_path: Path, title: str):
    (mapping,), (log, *more) = blocks(title, "yaml"), blocks(title, "text")
    assert mapping.count("\n") <= 25
    (tmp_path / "log.csv").write_text(log)
    (tmp_path / "log.yaml").write_text(mapping)
    for text in more:
        (tmp_path / "truth.csv").write_text(text)
    found = csv.read([tmp_path / "log.csv"], csv.Params(str(tmp_path / "log.yaml")))
    stream = found.streams["uwb" if "uwb" in found.streams else "radar"]
    time, main = EXPECTED[title]
    np.testing.assert_allclose(stream.time_ns * 1e-9, time, rtol=0, atol=2e-6)
    key = "distance" if stream.kind == "uwb" else "x"
    np.testing.assert_allclose(stream.rows[key], main, rtol=1e-12)
    if more:
        assert found.truth is not None
        o = found.truth.objects
        assert (o.time_ns * 1e-9).tolist() == [0, 1, 2]
        assert o.row_offset.tolist() == [0, 1, 2, 2]
        np.testing.assert_allclose(o.state, [[3, 4], [3.2, 4]], atol=1e-12)
