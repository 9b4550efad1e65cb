"""Streams of odometry, and differences of distance among link events, through both formats."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from echoset import formats
from echoset.models.checks import check
from echoset.models.columns import ACTIVE, TDOA
from echoset.models.errors import FormatError
from echoset.models.records import Meta, Recording, Sensor, Stream

NAN = np.nan


def recording() -> Recording:
    sensors = {
        "T": Sensor.device(),
        "A": Sensor.static("anchor", np.array([0.0, 0.0])),
        "B": Sensor.static("anchor", np.array([5.0, 0.0])),
    }
    scan = {
        "mode": np.array([ACTIVE, TDOA, TDOA], np.uint8),
        "tx": np.zeros(3, np.int32),
        "rx": np.array([1, 1, 2], np.int32),
        "reference": np.array([-1, 2, 1], np.int32),
    }
    time = np.array([0, 0, 10**9])
    rows = {"distance": np.array([1.5, -2.25, 0.5]), "std": np.full(3, 0.1)}
    uwb = Stream("uwb", ("T", "A", "B"), {}, time, np.array([0, 1, 2, 3]), scan, rows)
    told = {
        "velocity_x": np.array([1.0, NAN]),
        "velocity_y": np.array([0.0, NAN]),
        "turn_rate": np.array([0.1, NAN]),
        "heading": np.array([NAN, 0.5]),
        "std_heading": np.array([NAN, 0.1]),
    }
    moved = Stream("odometry", ("T",), {"turn": "after"}, time[1:], np.zeros(3, int), told, {})
    meta = Meta("r", provenance={"program": "test"})
    return Recording(meta, sensors, {"uwb": uwb, "wheels": moved})


def test_there_and_back_gives_equal_bytes(tmp_path: Path) -> None:
    first, stream, second = (tmp_path / f for f in ("a.h5", "a.mcap", "b.h5"))
    formats.write(recording(), first, "h5")
    formats.write(formats.read(first), stream, "mcap")
    formats.write(formats.read(stream), second, "h5")
    assert first.read_bytes() == second.read_bytes()
    found = formats.read(stream)
    np.testing.assert_array_equal(found.streams["uwb"].scan["reference"], [-1, 2, 1])
    np.testing.assert_array_equal(found.streams["uwb"].rows["distance"], [1.5, -2.25, 0.5])
    for name, values in recording().streams["wheels"].scan.items():
        np.testing.assert_array_equal(found.streams["wheels"].scan[name], values)


@pytest.mark.parametrize("name", ["a.h5", "a.mcap"])
def test_the_reader_of_the_documentation_finds_them_sound(tmp_path: Path, name: str) -> None:
    formats.write(recording(), tmp_path / name, name[2:])
    reader = Path(__file__).parents[2] / "examples" / "readers" / "reader.py"
    command = [sys.executable, str(reader), str(tmp_path / name)]
    assert "\nsound " in subprocess.run(command, capture_output=True, text=True).stdout


def with_uwb(**columns: np.ndarray) -> Recording:
    whole = recording()
    uwb = whole.streams["uwb"]
    rows = {k: columns.pop(k) for k in ("distance",) if k in columns}
    changed = replace(uwb, scan={**uwb.scan, **columns}, rows={**uwb.rows, **rows})
    return replace(whole, streams={**whole.streams, "uwb": changed})


i4 = np.int32


@pytest.mark.parametrize(
    ("columns", "reason"),
    [
        ({"reference": np.array([-1, 1, 1], i4)}, "is the anchor itself"),
        ({"reference": np.array([-1, 0, 1], i4)}, "is not an anchor"),
        ({"reference": np.array([-1, -1, 1], i4)}, "is not one of 3 nodes"),
        ({"reference": np.array([-1, 3, 1], i4)}, "is not one of 3 nodes"),
        ({"reference": np.array([1, 2, 1], i4)}, "no tdoa event"),
        ({"tx": np.array([0, 2, 0], i4)}, "is not a device, yet the link is tdoa"),
        ({"distance": np.array([-1.5, -2.25, 0.5])}, "is negative"),
    ],
)
def test_what_no_difference_can_be_is_refused(columns: dict, reason: str) -> None:
    check(recording())
    with pytest.raises(FormatError, match=reason):
        check(with_uwb(**columns))


def test_differences_need_their_reference() -> None:
    whole = recording()
    uwb = whole.streams["uwb"]
    scan = {k: v for k, v in uwb.scan.items() if k != "reference"}
    with pytest.raises(FormatError, match="'reference' is missing"):
        check(replace(whole, streams={"uwb": replace(uwb, scan=scan)}))


def test_odometry_is_of_one_device_and_has_no_rows() -> None:
    whole = recording()
    moved = whole.streams["wheels"]
    with pytest.raises(FormatError, match="odometry is that of one device"):
        check(replace(whole, streams={"wheels": replace(moved, nodes=("A",))}))
    more = replace(moved, row_offset=np.array([0, 0, 1]), rows={"x": np.zeros(1)})
    with pytest.raises(FormatError, match="has no rows"):
        check(replace(whole, streams={"wheels": more}))
    again = replace(moved, time_ns=np.array([5, 5]))
    with pytest.raises(FormatError, match="second scan"):
        check(replace(whole, streams={"wheels": again}))
