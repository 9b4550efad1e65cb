"""Windows of maps: which belong together, at what time, and in what order all scans come."""

import numpy as np

from echoset.estimators.maps.frames import STAMP, frames
from echoset.models.records import Scan

MS = 1_000_000


def scan(stream, ms):
    return Scan(stream, int(ms * MS), {"map": np.zeros((2, 2))}, {})


def windows(scans, within=None, streams=("a", "b", "c")):
    """Times [ms] of the windows, with the maps of each and when they were taken."""
    found = {}
    for s in frames(scans, frozenset(streams), within):
        taken = s.scan.get(STAMP, s.time_ns) / MS
        found.setdefault(s.time_ns / MS, []).append((s.stream, taken))
    assert list(found) == sorted(found)
    return found


def test_equal_stamps_stay_as_they_are():
    scans = [scan(name, 50 * k) for k in range(4) for name in "abc"]
    assert list(frames(scans, frozenset("abc"), None)) == scans
    assert list(frames([], frozenset("abc"), None)) == []


def test_stations_8_ms_apart_are_one_frame():
    scans = [scan(name, 50 * k + 8 * i) for k in range(4) for i, name in enumerate("abc")]
    found = windows(scans)
    assert list(found) == [8.0, 58.0, 108.0, 158.0]
    assert [len(maps) for maps in found.values()] == [3] * 4
    assert found[58.0] == [("a", 50.0), ("b", 58.0), ("c", 66.0)]


def test_a_window_has_one_map_of_a_station_and_an_end():
    fast = sorted(
        [scan("a", 50 * k) for k in range(8)] + [scan("b", 100 * k + 3) for k in range(4)],
        key=lambda s: s.time_ns,
    )
    found = windows(fast)
    assert [len(maps) for maps in found.values()] == [2, 1] * 4
    late = [scan("a", 0), scan("a", 50), scan("b", 99), scan("a", 100), scan("b", 149)]
    assert [len(maps) for maps in windows(late).values()] == [1, 1, 2, 1]
    assert [len(maps) for maps in windows(late, 0.0).values()] == [1] * 5


def test_other_scans_keep_their_times_and_the_order_holds():
    scans = [scan("a", 0), scan("eye", 5), scan("b", 30), scan("eye", 31), scan("a", 50)]
    found = list(frames(scans, frozenset("ab"), None))
    assert [(s.stream, s.time_ns / MS) for s in found] == [
        ("eye", 5.0), ("a", 15.0), ("b", 15.0), ("eye", 31.0), ("a", 50.0)
    ]  # fmt: skip
