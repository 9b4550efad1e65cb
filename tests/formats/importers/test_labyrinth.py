"""The libRSF importer: lines by hand, each broken line, and the measured log."""

from __future__ import annotations

import hashlib
import os
from pathlib import Path

import numpy as np
import pytest

from echoset.formats.importers import labyrinth
from echoset.models.errors import FormatError, InputError, ParameterError

LOG = """\
range2 0.2 3.5 0.04 2 0 b 0
odom2diff 0.1 0 0 0 0.0785 0.0001 0.0001 0.0001

range2 0.1000000004 2.5 0.01 -1 0.5 a 0
range2 0.2 1.5 0.01 -1 0.5 a 0
"""
POINTS = "point2 0.2 3 4 0 0 0 0\npoint2 0.1 1 2 0 0 0 0 \n"


def read(folder: Path, log: str | bytes = LOG, points: str | None = None, **params: object):
    paths = [folder / "log.txt"]
    paths[0].write_bytes(log.encode() if isinstance(log, str) else log)
    if points is not None:
        paths.append(folder / "truth.txt")
        paths[1].write_text(points)
    return labyrinth.read(paths, labyrinth.Params(**params))


def test_lines_become_events_in_order_of_time_and_anchor(tmp_path: Path):
    log = read(tmp_path, points=POINTS)
    uwb = log.streams["uwb"]
    assert uwb.nodes == ("device", "a", "b")
    np.testing.assert_array_equal(uwb.time_ns, [100_000_000, 200_000_000, 200_000_000])
    np.testing.assert_array_equal(uwb.row_offset, [0, 1, 2, 3])
    np.testing.assert_array_equal(uwb.scan["mode"], [0, 0, 0])
    np.testing.assert_array_equal(uwb.scan["tx"], [0, 0, 0])
    np.testing.assert_array_equal(uwb.scan["rx"], [1, 1, 2])
    np.testing.assert_array_equal(uwb.rows["distance"], [2.5, 1.5, 3.5])
    np.testing.assert_allclose(uwb.rows["std"], [0.1, 0.1, 0.2], rtol=1e-15)
    np.testing.assert_array_equal(log.sensors["a"].position, [[-1, 0.5, 0]])
    assert log.sensors["device"].kind == "device"
    assert log.truth is not None
    np.testing.assert_array_equal(log.truth.objects.state, [[1, 2], [3, 4]])
    assert log.truth.objects.state_names == ("device_x", "device_y")
    assert log.truth.objects.extent_kind == ""


def test_name_provenance_and_parameters(tmp_path: Path):
    log = read(tmp_path, device="robot", sigma=0.3)
    assert log.meta.name == "log"
    assert log.meta.provenance == {
        "importer": "labyrinth",
        "files": [{"name": "log.txt", "sha256": hashlib.sha256(LOG.encode()).hexdigest()}],
        "parameters": {"device": "robot", "sigma": 0.3, "range_bias_std": 0.1},
    }
    model = log.streams["uwb"].model
    assert model == {"mean_los": 1.0, "mean_scatter": 0.0, "range_bias_std": 0.1}
    assert log.truth is None
    assert log.streams["uwb"].nodes[0] == "robot"
    np.testing.assert_array_equal(log.streams["uwb"].rows["std"], [0.3, 0.3, 0.3])
    for wrong in ({"device": "a/b"}, {"sigma": 0.0}, {"range_bias_std": -1.0}):
        with pytest.raises(ParameterError):
            labyrinth.Params(**wrong)


BROKEN = {
    "line 2: range2 has 6 fields, needs 8": "\nrange2 1 2 0.01 0 0",
    "line 1: 'range3' is not one of range2": "range3 1 2 0.01 0 0 a 0",
    "line 1: 'abc' is not a finite number": "range2 abc 2 0.01 0 0 a 0",
    "line 1: 'nan' is not a finite number": "range2 1 nan 0.01 0 0 a 0",
    "line 1: '1e999' is not a finite number": "range2 1 2 1e999 0 0 a 0",
    "line 1: '2,5' is not a finite number: decimals are": "range2 1 2,5 0.01 0 0 a 0",
    "line 1: '1e300' s is beyond": "range2 1e300 2 0.01 0 0 a 0",
    "line 2: the distance of a wheel": "range2 1 2 1 0 0 a 0\nodom2diff 1 0 0 0 0 1 1 1",
    "line 3: a second odometry": "range2 1 2 1 0 0 a\n" + 2 * "odom2 1 0 0 0 1 1 1\n",
    "line 1: there are wheels already": (
        "odom2 1 0 0 0 1 1 1\nodom2diff 1 0 0 0 1 1 1 1\nrange2 1 2 1 0 0 a"
    ),
    "line 1: odom2 has 4 fields, needs 8": "odom2 1 0 0\nrange2 1 2 1 0 0 a",
    "line 1: the variance is not positive": "range2 1 2 0 0 0 a 0",
    "line 2: the anchor has moved": "range2 1 2 1 0 0 a 0\nrange2 2 2 1 0 0.1 a 0",
    "line 3: a second range of this": "range2 1 2 1 0 0 a 0\n\nrange2 1 3 1 0 0 a 0",
    "line 1: 'a/b' cannot name an anchor": "range2 1 2 1 0 0 a/b 0",
    "line 1: 'device' cannot name an anchor": "range2 1 2 1 0 0 device 0",
    "line 3: the clock goes back": "\n".join(f"range2 {t} 2 1 0 0 a 0" for t in (1, 2, 0, 0.5, 3)),
    "line 1: the file is empty": " \n",
    "line 1: is longer than": "range2 " + "1" * 100_000,
    "line 2: is not UTF-8 text": b"range2 1 2 1 0 0 a 0\n\xff\xfe",
}


@pytest.mark.parametrize("message", BROKEN)
def test_a_broken_line_is_named(tmp_path: Path, message: str):
    with pytest.raises(FormatError, match=r"log\.txt: " + message):
        read(tmp_path, BROKEN[message])


def test_broken_points_and_missing_files(tmp_path: Path):
    with pytest.raises(FormatError, match=r"truth\.txt: line 2: a second point"):
        read(tmp_path, points="point2 1 0 0 0 0 0 0\npoint2 1 0 0 0 0 0 0\n")
    with pytest.raises(FormatError, match=r"truth\.txt: line 1: point2 has 3 fields"):
        read(tmp_path, points="point2 1 0")
    with pytest.raises(FormatError, match=r"nowhere\.txt: No such file"):
        labyrinth.read([tmp_path / "nowhere.txt"], labyrinth.Params())
    with pytest.raises(InputError, match="there are no ranges"):
        read(tmp_path, POINTS)
    empty = tmp_path / "empty"
    empty.mkdir()
    with pytest.raises(FormatError, match="begins as those of libRSF"):
        labyrinth.read([empty], labyrinth.Params())


def test_the_measured_log():
    data = Path(os.environ.get("ECHOSET_DATA", Path(__file__).parents[4] / "shared/data"))
    folder = data / "labyrinth"
    if not folder.is_dir():
        pytest.skip(f"the measured recordings are not at {data} ($ECHOSET_DATA)")
    log = labyrinth.read([folder], labyrinth.Params())
    uwb = log.streams["uwb"]
    assert len(uwb) == 233
    assert uwb.nodes == ("device", "105", "107", "108", "109")
    places = [log.sensors[node].position[0, :2].tolist() for node in uwb.nodes[1:]]
    assert places == [[-0.02, -0.01], [-0.02, 2.365], [2.385, 2.36], [2.385, -0.005]]
    assert uwb.time_ns[[0, -1]].tolist() == [127_943_993, 29_902_198_076]
    assert uwb.rows["distance"][[0, -1]].tolist() == [2.95522014829822, 3.14571415367563]
    assert uwb.scan["rx"][[0, -1]].tolist() == [1, 3]
    np.testing.assert_allclose(uwb.rows["std"], 0.1, rtol=1e-15)
    assert log.truth is not None
    state = log.truth.objects.state
    assert state[0].tolist() == [1.65205474853516, 2.2191780090332]
    assert state[-1].tolist() == [0.1763950791323, 0.354996161516054]
    names = ("Indoor_UWB_GT.txt", "Indoor_UWB_Input.txt")
    whole = labyrinth.read([folder / name for name in names], labyrinth.Params())
    assert whole.meta.provenance == log.meta.provenance
    moved = log.streams["odometry"]
    assert len(moved) == 233
    # dead reckoning alone, laid over the truth, is off by centimetres
    dt = np.diff(moved.time_ns, prepend=0) * 1e-9
    turn = moved.scan["turn_rate"] * dt
    way = np.cumsum(moved.scan["velocity_x"] * dt * np.exp(1j * (np.cumsum(turn) - turn)))
    true = state[:, 0] + 1j * state[:, 1]
    a, b = true - true.mean(), way - way.mean()
    across = (a * b.conj()).sum()
    off = a - across / abs(across) * b
    assert np.sqrt((abs(off) ** 2).mean()) < 0.1


def test_all_kinds_of_lines_are_read_from_files_of_any_name(tmp_path: Path):
    (tmp_path / "a walk.txt").write_text(
        "odom2 1 2.0 0.5 0.1 0.04 0.09 0.01\n"
        "odom2 2 1.0 0.0 -0.1 0.04 0.09 0.01\n"
        "angle 2 0.25 0.04\n"
        "angle 3 0.5 0.04\n"
        + "".join(f"range2 {t} {t + j}.5 0.25 {j} {j * j} {j}\n" for t in (1, 2) for j in range(8))
        + "range2 2.5 -0.3 0.25 0 0 0\n"
    )
    (tmp_path / "b.txt").write_text("point2 1 0 0 0 0 0 0\n")
    (tmp_path / "c.txt").write_text("notes of the day\n")
    log = labyrinth.read([tmp_path], labyrinth.Params())
    assert log.meta.name == "a walk"
    assert len(log.streams["uwb"]) == 16
    assert log.meta.provenance["left_out"] == {"range2": {"range < 0": 1}}
    moved = log.streams["odometry"]
    assert moved.model == {"turn": "after"}
    nan = np.nan
    expected = {
        "velocity_x": [2.0, 1.0, nan],
        "velocity_y": [0.5, 0.0, nan],
        "turn_rate": [0.1, -0.1, nan],
        "std_velocity_x": [0.2, 0.2, nan],
        "std_velocity_y": [0.3, 0.3, nan],
        "std_turn_rate": [0.1, 0.1, nan],
        "heading": [nan, 0.25, 0.5],
        "std_heading": [nan, 0.2, 0.2],
    }
    assert moved.scan.keys() == expected.keys()
    for name, values in expected.items():
        np.testing.assert_allclose(moved.scan[name], values, rtol=1e-12)
    assert log.truth is not None


def test_wheels_are_velocity_and_turn_rate(tmp_path: Path):
    line = "odom2diff 1 0.3 0.5 0.05 0.1 0.0001 0.0003 0.0004\n"
    log = read(tmp_path, line + "range2 1 2 1 0 0 a 0")
    scan = log.streams["odometry"].scan
    found = {name: float(values[0]) for name, values in scan.items()}
    assert found == pytest.approx(
        {
            "velocity_x": 0.4,
            "velocity_y": 0.05,
            "turn_rate": 0.2 / (2 * 0.1),
            "std_velocity_x": 0.01,
            "std_velocity_y": 0.02,
            "std_turn_rate": 0.02 / (2 * 0.1),
        }
    )
