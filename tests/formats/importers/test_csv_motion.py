"""Odometry, wheels and differences of distance from tables of text."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from echoset.formats.importers import csv
from echoset.models.columns import TDOA
from echoset.models.errors import FormatError, ParameterError
from echoset.models.records import Recording

RANGES = "t,anchor,d\n0,A,1.5\n0,B,2.5\n1,A,1.6\n"
COMMON = {"anchors": {"A": [0, 0], "B": [5, 0]}, "devices": {"robot": 0}}
UWB = {"kind": "uwb", "columns": {"time": "t", "anchor": "anchor", "distance": "d"}}


def read(folder: Path, wheels: str, odometry: dict, **more: object) -> Recording:
    (folder / "log.csv").write_text(RANGES)
    (folder / "wheels.csv").write_text(wheels)
    (folder / "m.yaml").write_text("")
    own = {"kind": "odometry", "file": str(folder / "wheels.csv"), **odometry}
    mapping = {**COMMON, "streams": {"uwb": UWB, "wheels": own}, **more}
    return csv.read([folder / "log.csv"], csv.Params(mapping=mapping))


def test_wheels_become_velocity_and_turn_rate(tmp_path: Path) -> None:
    columns = {"time": "t", "left": {"column": "l", "unit": "km/h"}, "right": "r"}
    log = read(
        tmp_path,
        "t,l,r\n0,3.6,1\n0.5,3.6,2\n",
        {"columns": columns, "wheel_distance": "50 cm", "model": {"turn_rate_std": 0.1}},
    )
    moved = log.streams["wheels"]
    assert moved.kind == "odometry"
    assert moved.nodes == ("robot",)
    assert moved.model == {"turn_rate_std": 0.1}
    np.testing.assert_array_equal(moved.time_ns, [0, 500_000_000])
    np.testing.assert_allclose(moved.scan["velocity_x"], [1.0, 1.5])
    np.testing.assert_allclose(moved.scan["velocity_y"], [0.0, 0.0])
    np.testing.assert_allclose(moved.scan["turn_rate"], [0.0, 2.0])


def test_bodies_tell_velocity_turn_rate_and_heading(tmp_path: Path) -> None:
    columns = {
        "time": "t", "velocity_x": "v", "turn_rate": {"column": "w", "unit": "deg/s"},
        "heading": {"column": "h", "unit": "deg"}, "std_heading": {"value": "5 deg"},
    }  # fmt: skip
    log = read(tmp_path, "t,v,w,h\n1,0.5,180,90\n0,1,-90,\n", {"columns": columns})
    scan = log.streams["wheels"].scan
    np.testing.assert_allclose(scan["velocity_x"], [1.0, 0.5])
    np.testing.assert_allclose(scan["turn_rate"], [-np.pi / 2, np.pi])
    np.testing.assert_allclose(scan["heading"], [np.nan, np.pi / 2])
    np.testing.assert_allclose(scan["std_heading"], np.radians([5, 5]))


@pytest.mark.parametrize(
    ("columns", "more", "reason"),
    [
        ({"left": "l", "right": "r"}, {}, "need wheel_distance"),
        ({"left": "l", "right": "r"}, {"wheel_distance": -1}, "wheel_distance must be positive"),
        ({"left": "l"}, {"wheel_distance": 1}, "wheels are left and right"),
        ({"velocity_x": "l"}, {}, "columns need velocity_x and turn_rate"),
    ],
)
def test_what_tells_no_motion_is_refused(
    tmp_path: Path, columns: dict, more: dict, reason: str
) -> None:
    with pytest.raises(ParameterError, match=reason):
        read(tmp_path, "t,l,r\n0,1,1\n", {"columns": {"time": "t", **columns}, **more})


def test_two_events_at_one_time_are_refused(tmp_path: Path) -> None:
    columns = {"time": "t", "velocity_x": "l", "turn_rate": "r"}
    with pytest.raises(FormatError, match="second event"):
        read(tmp_path, "t,l,r\n0,1,1\n0,1,1\n", {"columns": columns})


def test_differences_name_their_reference(tmp_path: Path) -> None:
    (tmp_path / "log.csv").write_text("t,ref,anchor,d\n0,A,B,-1.5\n0,A,C,2.5\n1,A,B,-1.4\n")
    anchors = {"A": [0, 0], "B": [5, 0], "C": [0, 5]}
    columns = {"time": "t", "anchor": "anchor", "reference": "ref", "distance": "d"}
    mapping = {"kind": "uwb", "columns": columns, "anchors": anchors}
    log = csv.read([tmp_path / "log.csv"], csv.Params(mapping=mapping))
    uwb = log.streams["uwb"]
    assert uwb.nodes == ("device", "A", "B", "C")
    assert (uwb.scan["mode"] == TDOA).all()
    np.testing.assert_array_equal(uwb.scan["reference"], [1, 1, 1])
    np.testing.assert_array_equal(uwb.scan["rx"], [2, 3, 2])
    np.testing.assert_array_equal(uwb.scan["tx"], [0, 0, 0])
    np.testing.assert_array_equal(uwb.rows["distance"], [-1.5, 2.5, -1.4])
    (tmp_path / "log.csv").write_text("t,ref,anchor,d\n0,B,B,-1.5\n")
    with pytest.raises(FormatError, match="is the anchor itself"):
        csv.read([tmp_path / "log.csv"], csv.Params(mapping=mapping))
