"""All 48 frames of a sensor, by points whose place is known from the words alone."""

from __future__ import annotations

import itertools
import math
from pathlib import Path

import numpy as np
import pytest

from echoset import formats
from echoset.formats.importers.csv import importer as csv
from echoset.models.errors import FormatError, ParameterError
from echoset.models.geometry.poses import pose_at
from echoset.models.records import Recording

BODY = {
    "forward": (1, 0, 0), "back": (-1, 0, 0), "left": (0, 1, 0), "right": (0, -1, 0),
    "up": (0, 0, 1), "down": (0, 0, -1),
}  # fmt: skip
"""Directions in a level body: ahead, to the left, up."""
TURN = {"forward": 0.0, "left": 90.0, "back": 180.0, "right": -90.0}
"""Heading of a direction against that of forward [deg]."""
AXES = [("forward", "back"), ("left", "right"), ("up", "down")]
FRAMES = [
    words
    for order in itertools.permutations(AXES)
    for words in itertools.product(*order)
]  # fmt: skip
MAPS = {("east", "north", "up"): (0.0, 1), ("north", "east", "down"): (90.0, -1)}
"""Heading of a log's x axis [deg, from east], and the sense in which yaw turns from it."""


def read(folder: Path, header: str, row: str, **said) -> Recording:
    (folder / "log.csv").write_text(f"t,{header}\n0,{row}\n")
    return csv.read([folder / "log.csv"], csv.Params(said))


def heading(words: tuple[str, ...], frame: tuple[str, ...], yaw: float) -> float:
    """Where forward points [rad from east]: the first level word lies at ``yaw`` in the frame."""
    x, sense = MAPS[frame]
    first = next(word for word in words if word in TURN)
    return math.radians(x + sense * yaw - TURN[first])


def place(point: np.ndarray, towards: float) -> np.ndarray:
    c, s = math.cos(towards), math.sin(towards)
    return np.array([c * point[0] - s * point[1], s * point[0] + c * point[1], point[2]])


def test_there_are_48():
    assert len(set(FRAMES)) == 48


@pytest.mark.parametrize("frame", MAPS)
def test_points(tmp_path: Path, frame: tuple[str, ...]):
    for words, yaw in itertools.product(FRAMES, (0.0, 30.0)):
        found = read(
            tmp_path, "x,y,z", "1,2,3", kind="position", frame=list(frame),
            columns={"time": "t", "x": "x", "y": "y", "z": "z"}, sensor_frame=list(words),
            sensors={"radar": {"position": [10, 20, 5], "yaw": f"{yaw} deg"}},
        )  # fmt: skip
        rows = found.streams["radar"].rows
        p, R = pose_at(found.sensors["radar"], 0)
        seen = p + R @ [rows["x"][0], rows["y"][0], rows["z"][0]]
        body = sum(c * np.array(BODY[w]) for c, w in zip((1, 2, 3), words, strict=True))
        at = (10, 20, 5) if frame[0] == "east" else (20, 10, -5)
        expected = np.array(at) + place(body, heading(words, frame, yaw))
        np.testing.assert_allclose(seen, expected, atol=1e-12, err_msg=f"{words} {yaw}")


@pytest.mark.parametrize("frame", MAPS)
def test_bearings(tmp_path: Path, frame: tuple[str, ...]):
    """Azimuth turns from the first word to the second, elevation towards the third."""
    level = [words for words in FRAMES if words[2] in ("up", "down")]
    assert len(level) == 16
    for words, yaw in itertools.product(level, (0.0, 30.0)):
        found = read(
            tmp_path, "r,a,e", "10,20,30", kind="range_bearing", frame=list(frame),
            columns={"time": "t", "range": "r", "azimuth": {"column": "a", "unit": "deg"},
                     "elevation": {"column": "e", "unit": "deg"}},
            sensor_frame=list(words), sensors={"radar": {"position": [0, 0], "yaw": f"{yaw} deg"}},
        )  # fmt: skip
        rows = found.streams["radar"].rows
        r, a, e = (float(rows[k][0]) for k in ("range", "azimuth", "elevation"))
        _, R = pose_at(found.sensors["radar"], 0)
        seen = R @ [
            r * math.cos(e) * math.cos(a), r * math.cos(e) * math.sin(a), r * math.sin(e)
        ]  # fmt: skip
        along = [
            10 * math.cos(math.radians(30)) * math.cos(math.radians(20)),
            10 * math.cos(math.radians(30)) * math.sin(math.radians(20)),
            10 * math.sin(math.radians(30)),
        ]
        body = sum(c * np.array(BODY[w], float) for c, w in zip(along, words, strict=True))
        expected = place(body, heading(words, frame, yaw))
        np.testing.assert_allclose(seen, expected, atol=1e-12, err_msg=f"{words} {yaw}")


def test_what_no_frame_is_is_refused(tmp_path: Path):
    columns = {"time": "t", "range": "x", "azimuth": "y"}
    with pytest.raises(ParameterError, match="azimuths need two level directions"):
        read(tmp_path, "x,y", "1,2", kind="range_bearing", columns=columns,
             sensor_frame=["right", "down", "forward"])  # fmt: skip
    with pytest.raises(ParameterError, match="needs x, y and z"):
        read(tmp_path, "x,y", "1,2", kind="position", columns={"time": "t", "x": "x", "y": "y"},
             sensor_frame=["right", "down", "forward"])  # fmt: skip
    with pytest.raises(ParameterError, match="sensor_frame must be"):
        read(tmp_path, "x,y", "1,2", kind="position", columns={"time": "t", "x": "x", "y": "y"},
             sensor_frame=["right", "left", "up"])  # fmt: skip


def test_fields_of_view_and_cross_sections(tmp_path: Path):
    """A view from 10 to 30 degrees to the right is one from -30 to -10 to the left."""
    columns = {
        "time": "t", "range": "r", "azimuth": {"column": "a", "unit": "deg"},
        "rcs": {"column": "s", "unit": "dBsm"},
        "view_azimuth_min": {"value": "10 deg"}, "view_azimuth_max": {"value": "30 deg"},
        "view_range_max": {"value": 200},
    }  # fmt: skip
    found = read(tmp_path, "r,a,s", "10,20,-3", kind="range_bearing", columns=columns,
                 sensor_frame=["forward", "right"])  # fmt: skip
    stream = found.streams["radar"]
    assert stream.rows["rcs"][0] == pytest.approx(10**-0.3, rel=1e-12)
    assert np.degrees(stream.scan["view_azimuth_min"]) == pytest.approx([-30.0])
    assert np.degrees(stream.scan["view_azimuth_max"]) == pytest.approx([-10.0])
    assert stream.scan["view_range_max"].tolist() == [200.0]
    assert np.degrees(stream.rows["azimuth"]) == pytest.approx([-20.0])
    for suffix in ("h5", "mcap"):
        path = tmp_path / f"a.{suffix}"
        formats.write(found, path, suffix)
        back = formats.read(path).streams["radar"]
        assert back.rows["rcs"].tolist() == stream.rows["rcs"].tolist()
    with pytest.raises(ParameterError, match="a view needs both azimuths"):
        del columns["view_azimuth_max"]
        read(tmp_path, "r,a,s", "10,20,-3", kind="range_bearing", columns=columns)


def test_scan_ids_of_a_counter_that_begins_anew(tmp_path: Path):
    """Ten ids that are used twice are twenty scans by their times; a split one is refused."""
    rows = [(k % 10, 0.1 * k, j) for k in range(20) for j in range(2)]
    text = "".join(f"{k},{t:.1f},{j},1\n" for k, t, j in rows)
    (tmp_path / "log.csv").write_text("f,t,x,y\n" + text)
    columns = {"time": "t", "x": "x", "y": "y", "scan": "f"}
    said = {"kind": "position", "columns": columns}
    stream = csv.read([tmp_path / "log.csv"], csv.Params(said)).streams["radar"]
    np.testing.assert_array_equal(stream.time_ns, np.arange(20) * 10**8)
    assert (np.diff(stream.row_offset) == 2).all()
    (tmp_path / "log.csv").write_text("f,t,x,y\n1,0,1,1\n2,1,1,1\n1,2,1,1\n")
    with pytest.raises(FormatError, match="scan '1' comes back"):
        csv.read([tmp_path / "log.csv"], csv.Params(said))
