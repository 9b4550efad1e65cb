"""The layouts of the page of radars, read with the mappings that stand below them."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
import yaml

from echoset.formats.importers.csv import importer as csv
from echoset.formats.importers.ros2.topics import descriptions

PAGE = Path(__file__).parents[3] / "docs/gallery-radars.md"
SECTIONS = dict(
    part.split("\n", 1) for part in re.split(r"^## ", PAGE.read_text(), flags=re.M)[1:]
)  # fmt: skip
DAY = 1_714_521_600
"""2024-05-01T00:00:00Z in seconds after 1970."""
COS, SIN = np.cos(np.radians(271.4)), np.sin(np.radians(271.4))
EXPECTED: dict[str, dict[str, tuple[list[float], list[int], dict[str, list[float]]]]] = {
    "Several radars, their fields of view, and empty scans": {
        "left": (
            [0.0, 0.07],
            [2, 1],
            {
                "range": [31.2, 18.4, 30.6],
                "doppler": [-8.1, -6.3, -8.1],
                "azimuth": [np.radians(12), np.radians(-40.5), np.radians(12.4)],
                "rcs": [10**0.35, 10**-0.8, 10**0.29],
            },
        ),
        "right": ([0.03, 0.1], [0, 1], {"range": [22.0], "doppler": [-9.9]}),
    },
    "A table of points, and one of all scans": {
        "radar": ([0, 0.05, 0.1, 0.15], [2, 0, 0, 1], {"doppler": [0.5, 0.0, 0.5]}),
    },
    "Plots of a surveillance radar: ASTERIX category 048": {
        "radar": (
            [32400.125, 32404.117, 32408.109],
            [1, 1, 1],
            {"range": [12.5 * 1852, 12.38 * 1852, 12.27 * 1852], "doppler": [-310 * 1852 / 3600,
             -311 * 1852 / 3600, -309 * 1852 / 3600]},
        ),
    },
    "Ships and aircraft that tell where they are": {
        "radar": ([DAY + 32400, DAY + 32404, DAY + 32410, DAY + 32412], [1, 1, 1, 1], {}),
    },
    "Boxes in pictures: MOT and KITTI text": {
        "radar": ([0.04, 0.08, 0.12], [2, 1, 1], {"x": [912, 338, 915, 918],
                                                   "y": [-484, -418, -485, -486]}),
    },
}  # fmt: skip
"""By radar the times of the scans, the numbers of their detections, and columns of these."""


def blocks(title: str, tag: str) -> list[str]:
    return re.findall(rf"^```{tag}\n(.*?)^```$", SECTIONS[title], re.M | re.S)


@pytest.mark.parametrize("title", EXPECTED)
def test_a_table_is_read_by_its_mapping(tmp_path: Path, title: str):
    if "lat:" in SECTIONS[title]:
        pytest.importorskip("pyproj", reason="the extra echoset[geo] is not installed")
    (mapping,), (log, *more) = blocks(title, "yaml"), blocks(title, "text")
    assert mapping.count("\n") <= 25
    (tmp_path / "log.csv").write_text(log)
    (tmp_path / "log.yaml").write_text(mapping)
    for text in more:
        (tmp_path / "frames.csv").write_text(text)
    found = csv.read([tmp_path / "log.csv"], csv.Params(str(tmp_path / "log.yaml")))
    assert sorted(found.streams) == sorted(EXPECTED[title])
    for name, (time, counts, columns) in EXPECTED[title].items():
        stream = found.streams[name]
        day = DAY if "ASTERIX" in title and stream.time_ns[0] > 1e18 else 0
        np.testing.assert_allclose(stream.time_ns * 1e-9 - day, time, rtol=0, atol=2e-6)
        np.testing.assert_array_equal(np.diff(stream.row_offset), counts)
        for column, values in columns.items():
            np.testing.assert_allclose(stream.rows[column], values, rtol=1e-12)
    if "ASTERIX" in title:
        # Degrees from north, clockwise: east is x, north is y.
        r, a = stream.rows["range"][0], stream.rows["azimuth"][0]
        place = 12.5 * 1852 * np.array([SIN, COS])
        np.testing.assert_allclose(r * np.array([np.cos(a), np.sin(a)]), place, atol=1e-6)
    if "lat:" in mapping or "origin:" in mapping:
        # 0.001 degrees of latitude are 111.3 m, 0.01 of longitude 595 m at 57.7 degrees north.
        np.testing.assert_allclose(stream.rows["x"][0], 595.9, atol=1.5)
        np.testing.assert_allclose(stream.rows["y"][0], 111.4, atol=0.2)


def test_the_mapping_of_a_bag_is_one(tmp_path: Path):
    """What ``ros2`` makes of its keys, before any bag is read."""
    (mapping,) = blocks("A car with radars on ROS 2", "yaml")
    told = descriptions(yaml.safe_load(mapping))
    assert told["/radar/front/points"]["columns"]["power"].unit == "dB"
