"""Positioning logs as people have them: layouts of our own, worked out by hand."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from echoset.formats.importers.csv import importer as csv
from echoset.models.errors import FormatError, ParameterError
from echoset.models.records import Recording

ANCHORS = {"A": [0, 0], "B": [4, 0, 2.5]}
WIDE: dict[str, Any] = {
    "kind": "uwb",
    "columns": {"time": "t", "distance": {"pattern": "d_{anchor}", "unit": "mm"}},
    "anchors": ANCHORS,
}


def read(folder: Path, text: str, said: dict[str, Any], **files: str) -> Recording:
    """The log ``text`` with further files by their names without ``.csv``."""
    for name, content in files.items():
        (folder / f"{name}.csv").write_text(content)
    log = folder / "log.csv"
    log.write_text(text)
    return csv.read([log], csv.Params(said))


def events(log: Recording, name: str = "uwb") -> list[tuple[float, str, str, list[float]]]:
    """Time, transmitter, receiver and distances of each event."""
    uwb = log.streams[name]
    bounds = zip(uwb.row_offset[:-1], uwb.row_offset[1:], strict=True)
    return [
        (t * 1e-9, uwb.nodes[tx], uwb.nodes[rx], uwb.rows["distance"][a:b].tolist())
        for t, tx, rx, (a, b) in zip(
            uwb.time_ns, uwb.scan["tx"], uwb.scan["rx"], bounds, strict=True
        )
    ]


EXPECTED = [
    (0.0, "device", "A", [1.5]),
    (0.0, "device", "B", [2.5]),
    (1.0, "device", "A", []),
    (1.0, "device", "B", [3.5]),
]


@pytest.mark.parametrize(
    "distance",
    [
        {"pattern": "d_{anchor}"},
        {"columns": {"A": "d_A", "B": "d_B"}},
        {"columns": {"A": 3, "B": 2}},
    ],
)
def test_one_column_for_each_anchor(tmp_path: Path, distance: dict[str, Any]):
    said = WIDE | {"columns": {"time": "t", "distance": distance | {"unit": "mm"}}}
    log = read(tmp_path, "t,d_B,d_A\n0,2500,1500\n1,3500,\n", said)
    assert events(log) == EXPECTED
    bare = said | {"names": ["t", "d_B", "d_A"]}
    assert events(read(tmp_path, "0,2500,1500\n1,3500,\n", bare)) == EXPECTED


def test_one_column_for_each_anchor_and_tag_whose_ids_are_alike(tmp_path: Path):
    names = ["t", "a0-t0", "a0-t1", "a1-t0", "a1-t1"]
    said: dict[str, Any] = {
        "kind": "uwb",
        "header": False,
        "names": names,
        "columns": {"time": "t", "distance": {"pattern": "a{anchor}-t{device}"}},
        "rename": {"device": {0: "T0", 1: "T1"}},
        "anchors": {0: [0, 0], 1: [4, 0]},
        "devices": {"T0": 5},
    }
    log = read(tmp_path, "0,1,2,3,4\n", said)
    expected = [("T0", "0", 1.0), ("T0", "1", 3.0), ("T1", "0", 2.0), ("T1", "1", 4.0)]
    assert sorted(events(log)) == [(0.0, tag, anchor, [r]) for tag, anchor, r in expected]
    assert [log.sensors[n].object for n in ("T0", "T1")] == [5, -1]
    nested = {0: {0: "a0-t0", 1: "a0-t1"}, 1: {0: "a1-t0", 1: "a1-t1"}}
    columns = {"time": "t", "distance": {"columns": nested}}
    assert events(read(tmp_path, "0,1,2,3,4\n", said | {"columns": columns})) == events(log)
    one = events(read(tmp_path, "0,1,2,3,4\n", said | {"skip": "device != 'T0'"}))
    assert one == sorted(events(log))[:2]
    with pytest.raises(ParameterError, match=r"'0' is an anchor and a device: .*'rename'"):
        read(tmp_path, "0,1,2,3,4\n", said | {"rename": {}, "devices": {}})


def test_several_quantities_for_each_anchor(tmp_path: Path):
    columns = {**WIDE["columns"], "std": {"columns": {"A": "s1", "B": "s2"}, "unit": "cm"}}
    text = "t,d_A,d_B,s1,s2\n0,1500,2500,10,20\n"
    log = read(tmp_path, text, WIDE | {"columns": columns})
    assert log.streams["uwb"].rows["std"].tolist() == [0.1, 0.2]
    columns["std"] = {"columns": {"B": "s2", "A": "s1"}}
    with pytest.raises(ParameterError, match=r"std: its columns are not those of the same"):
        read(tmp_path, text, WIDE | {"columns": columns})


def test_errors_of_wide_logs_name_the_column(tmp_path: Path):
    with pytest.raises(FormatError, match=r"log\.csv: line 3, column 'd_B': 'x' is not a finite"):
        read(tmp_path, "t,d_A,d_B\n0,1,2\n1,1,x\n", WIDE)
    with pytest.raises(FormatError, match=r"line 2, column 'd_C': 'C' is not one of A B"):
        read(tmp_path, "t,d_A,d_C\n0,1,2\n", WIDE)
    with pytest.raises(FormatError, match=r"line 1: no column is called like 'd_\{anchor\}'"):
        read(tmp_path, "t,a,b\n0,1,2\n", WIDE)
    with pytest.raises(ParameterError, match=r"needs a header, or 'names'"):
        read(tmp_path, "0,1,2\n", WIDE | {"header": False})
    with pytest.raises(ParameterError, match=r"pattern must be a name with \{anchor\}"):
        read(
            tmp_path, "t,a\n0,1\n", WIDE | {"columns": {"time": "t", "distance": {"pattern": "a"}}}
        )


def test_what_is_missing_and_what_is_skipped_is_counted(tmp_path: Path, caplog):
    said = WIDE | {"missing": ["nan", "-"], "skip": ["distance <= 0", "q < 3 or tag == 'x'"]}
    text = "t,d_A,d_B,q,tag\n0,1500,0.0,5,y\n1,nan,-3,5,y\n2,-,2500,2,y\n3,1000,2000,9,x\n"
    log = read(tmp_path, text, said)
    assert events(log) == [(0.0, "device", "A", [1.5]), (1.0, "device", "A", [])]
    assert log.meta.provenance["left_out"] == {
        "log": {"distance <= 0": 2, "q < 3 or tag == 'x'": 4}
    }
    (record,) = caplog.records
    assert record.getMessage().endswith(
        "log.csv: left out 2 rows (distance <= 0), 4 rows (q < 3 or tag == 'x')"
    )
    with pytest.raises(ParameterError, match=r"skip: .*no column 'quality'"):
        read(tmp_path, text, said | {"skip": "quality < 3"})
    whole = read(tmp_path, "t,d_A,d_B,q\n0,1,2,3\n", said | {"skip": "q > 100"})
    assert "left_out" not in whole.meta.provenance


SECTIONS = """\
UWB,0.0,A,1500
RADAR,0.5,10,0.1,7
UWB,1.0,B,2500
GPS,1.0,x
RADAR,1.5,20,0.2,8
"""


def test_kinds_of_rows_in_one_file_are_streams(tmp_path: Path):
    uwb = {
        "kind": "uwb",
        "rows": {1: "UWB"},
        "columns": {"time": 2, "anchor": 3, "distance": {"column": 4, "unit": "mm"}},
    }
    radar = {
        "kind": "range_bearing",
        "rows": {1: ["RADAR"]},
        "columns": {"time": 2, "range": 3, "azimuth": 4},
        "sensors": {"front": [1, 2]},
    }
    said = {"header": False, "anchors": ANCHORS, "streams": {"tags": uwb, "front": radar}}
    log = read(tmp_path, SECTIONS, said)
    assert sorted(log.streams) == ["front", "tags"]
    assert events(log, "tags") == [(0.0, "device", "A", [1.5]), (1.0, "device", "B", [2.5])]
    assert log.streams["front"].rows["range"].tolist() == [10, 20]
    assert log.sensors["front"].position.tolist() == [[1, 2, 0]]
    assert len(log.meta.provenance["files"]) == 1
    assert log.meta.provenance["left_out"]["tags"] == {"1 is not UWB": 3}
    with pytest.raises(FormatError, match="line 2: has 5 fields, needs 4"):
        read(tmp_path, SECTIONS, {**uwb, "anchors": ANCHORS, "header": False, "rows": {}})


def test_streams_and_rows_of_several_files(tmp_path: Path):
    one = {"columns": {"time": "t", "anchor": "id", "distance": "r"}}
    said = {"kind": "uwb", "anchors": ANCHORS, **one, "file": ["more.csv"]}
    more = "t,id,r\n1,B,2\n"
    log = read(tmp_path, "t,id,r\n0,A,1\n", said, more=more)
    assert events(log) == [(0.0, "device", "A", [1.0]), (1.0, "device", "B", [2.0])]
    assert [f["name"] for f in log.meta.provenance["files"]] == ["log.csv", "more.csv"]
    with pytest.raises(FormatError, match=r"more\.csv: line 2, column 'r': 'x'"):
        read(tmp_path, "t,id,r\n0,A,1\n", said, more="t,id,r\n1,B,x\n")
    with pytest.raises(FormatError, match=r"more\.csv: line 1: its columns are not those of"):
        read(tmp_path, "t,id,r\n0,A,1\n", said, more="t,r,id\n1,B,x\n")
    points = {"kind": "position", "file": "p.csv", "columns": {"time": "t", "x": "x", "y": "y"}}
    said = {"anchors": ANCHORS, "streams": {"uwb": {"kind": "uwb", **one}, "roof": points}}
    log = read(tmp_path, "t,id,r\n0,A,1\n", said, p="t,x,y\n3,1,2\n")
    assert log.streams["roof"].rows["y"].tolist() == [2]
    assert [f["name"] for f in log.meta.provenance["files"]] == ["log.csv", "p.csv"]


def test_ids_in_spaces_of_their_own_by_columns(tmp_path: Path):
    said = {
        "kind": "uwb",
        "columns": {"time": "t", "anchor": "a", "device": "d", "distance": "r"},
        "rename": {"anchor": {"0": "A", "12:AF": "B"}, "device": {"0": "tag"}},
        "anchors": ANCHORS,
    }
    log = read(tmp_path, "t,a,d,r\n0,0,0,1\n0,12:AF,0,2\n", said)
    assert events(log) == [(0.0, "tag", "A", [1.0]), (0.0, "tag", "B", [2.0])]
    with pytest.raises(ParameterError, match="rename: there is no column 'tx'"):
        read(tmp_path, "t,a,d,r\n0,0,0,1\n", said | {"rename": {"tx": {}}})


SECOND = 10**9
DAY = 86400 * SECOND
NOON = 19_844 * DAY + 43_200 * SECOND
"""2024-05-01T12:00:00Z: 19,844 days after 1970 (54 years of 365 days, 13 leap days, 121 days)."""
TIMES: dict[str, tuple[Any, list[list[str]], list[int]]] = {
    "iso": ("t", [["2024-05-01T12:00:00.25Z"]], [NOON + SECOND // 4]),
    "iso with a zone": ("t", [["2024-05-01 14:30:00+02:30"]], [NOON]),
    "iso without a zone": ("t", [["2024-05-01 12:00:00"]], [NOON]),
    "one digit": ("t", [["2024-5-1 9:00:00.001"]], [NOON - 10_800 * SECOND + 1_000_000]),
    "zone told": ({"column": "t", "zone": "-05:00"}, [["2024-05-01 07:00:00"]], [NOON]),
    "nanoseconds": ("t", [["2024-05-01T12:00:00.123456789Z"]], [NOON + 123_456_789]),
    "time of day": ({"column": "t", "date": "2024-05-01"}, [["12:00:00.5"]], [NOON + SECOND // 2]),
    "with dots": ({"column": "t", "date": "2024-05-01"}, [["12.00.40"]], [NOON + 40 * SECOND]),
    "no date": ("t", [["00:00:01.5"], ["00:01:00"]], [1_500_000_000, 60 * SECOND]),
    "past midnight": (
        "t",
        [["23:59:59"], ["0:00:01"], ["11:00:00"], ["22:00:00"], ["0:00:00"]],
        [DAY - SECOND, DAY + SECOND, *(DAY + k * 3600 * SECOND for k in (11, 22, 24))],
    ),
    "digits": (
        {"column": "t", "format": "HHMMSSmmm"},
        [["160827974"], ["160828074"], ["160900001"]],
        [(58107 * 1000 + 974) * 10**6, (58108 * 1000 + 74) * 10**6, (58140 * 1000 + 1) * 10**6],
    ),
    "digits that lost a nought": ({"column": "t", "format": "HHMMSSmmm"}, [["93015123"]],
                                  [(34215 * 1000 + 123) * 10**6]),
    "day first": ({"column": "t", "format": "DD.MM.YYYY HH:MM:SS"}, [["1.5.2024 12:00:00,5"]],
                  [NOON + SECOND // 2]),
    "two columns": ({"columns": ["t", "u"]}, [["2024-05-01", "12:00:00.5"]], [NOON + SECOND // 2]),
    "six columns": (
        {"columns": ["t", "u", "v", "w", "x", "y"], "format": "YYYY MM DD HH MM SS.f"},
        [["2024", "5", "1", "12", "0", "7.25"]],
        [NOON + 7_250_000_000],
    ),
    "seconds and nanoseconds": (
        {"columns": ["t", "u"], "unit": ["s", "ns"]},
        [["1714564800", "7"], ["1714564800", "999999999"]],
        [NOON + 7, NOON + 999_999_999],
    ),
    "ticks that wrap": (
        {"column": "t", "rate": 1e6, "bits": 8},
        [["250"], ["5"], ["3"], ["130"], ["0"]],
        [250_000, 261_000, 259_000, 386_000, 512_000],
    ),
    "ticks of 15.65 ps": ({"column": "t", "rate": 63.8976e9, "bits": 40}, [["1099511627775"]],
                          [round(1099511627775 / 63.8976)]),
}  # fmt: skip


@pytest.mark.parametrize("case", TIMES)
def test_times(tmp_path: Path, case: str):
    given, rows, expected = TIMES[case]
    names = "tuvwxy"[: len(rows[0])]
    text = ",".join([*names, "id", "r"]) + "\n"
    text += "".join(",".join([f'"{f}"' for f in row] + ["A", "1"]) + "\n" for row in rows)
    said = {
        "kind": "uwb",
        "columns": {"time": given, "anchor": "id", "distance": "r"},
        "anchors": ANCHORS,
    }
    log = read(tmp_path, text, said)
    assert log.streams["uwb"].time_ns.tolist() == sorted(expected)


def test_dates_count_from_the_epoch(tmp_path: Path):
    said = {
        "kind": "uwb",
        "epoch": "2024-05-01T10:00:00+02:00",
        "columns": {"time": "t", "anchor": "id", "distance": "r"},
        "anchors": ANCHORS,
    }
    log = read(tmp_path, "t,id,r\n2024-05-01T12:00:00Z,A,1\n", said)
    assert log.streams["uwb"].time_ns.tolist() == [4 * 3600 * SECOND]
    log = read(tmp_path, "t,id,r\n12:00:00,A,1\n", said)
    assert log.streams["uwb"].time_ns.tolist() == [4 * 3600 * SECOND]


BAD_TIMES = {
    "line 3, column 't': '12:60:00' is no time of day": (["12:00:00", "12:60:00"], {}),
    "line 3, column 't': 'noon' is no time like": (["12:00:00", "noon"], {}),
    "line 2, column 't': '2023-02-29 12:00:00' is no day": (["2023-02-29 12:00:00"], {}),
    "line 2, column 't': 'noon' is not a finite number": (["noon"], {}),
    "line 2, column 't': '1.5' is no whole number": (["1.5"], {"rate": 10}),
    "line 2, column 't': 256 does not fit into 8 bits": (["256"], {"rate": 10, "bits": 8}),
    "columns.time: zone must be such as": (["12:00:00"], {"zone": "CET"}),
    "columns.time: date must be a day": (["12:00:00"], {"date": "tomorrow"}),
    "columns.time: format must be made of": (["12:00"], {"format": "hh:mm"}),
    "columns.time: format .* tells HH twice": (["12"], {"format": "HH HH"}),
    "columns.time: ticks have a rate": (["1"], {"bits": 8}),
    "columns.time: bits must be between": (["1"], {"rate": 1, "bits": 80}),
}


@pytest.mark.parametrize("message", BAD_TIMES)
def test_times_that_cannot_be(tmp_path: Path, message: str):
    rows, more = BAD_TIMES[message]
    said = {
        "kind": "uwb",
        "columns": {"time": {"column": "t", **more}, "anchor": "id", "distance": "r"},
        "anchors": ANCHORS,
    }
    with pytest.raises((FormatError, ParameterError), match=message):
        read(tmp_path, "t,id,r\n" + "".join(f"{t},A,1\n" for t in rows), said)


def test_truth_on_a_clock_and_in_a_frame_of_its_own(tmp_path: Path):
    # A point at (1, 2) of a table that is turned by 90 degrees and in half metres: (x, y) goes to
    # (-y, x) / 2 + (3, -2) = (2, -1.5); its velocity (0, 4) to (-2, 0).
    columns = {"time": "t", "x": "x", "y": "y", "vx": "vx", "vy": "vy", "z": "z"}
    truth = {
        "file": "g.csv",
        "columns": columns,
        "clock": {"offset": "-7 s", "scale": 2},
        "transform": {"rotation": "90 deg", "translation": [3, -2, 1], "scale": 0.5},
    }
    said = WIDE | {"truth": truth}
    log = read(tmp_path, "t,d_A,d_B\n0,1,2\n", said, g="t,x,y,vx,vy,z\n5,1,2,0,4,6\n")
    assert log.truth is not None
    o = log.truth.objects
    assert o.time_ns.tolist() == [3 * SECOND]
    found = dict(zip(o.state_names, o.state[0].tolist(), strict=True))
    expected = {"x": 2.0, "y": -1.5, "z": 4.0, "vx": -2.0, "vy": 0.0, "vz": None}
    assert found == pytest.approx({k: expected[k] for k in found}, abs=1e-12)
    for wrong in (
        {"clock": {"ofset": 1}},
        {"clock": {"offset": "1 m"}},
        {"clock": {"scale": 0}},
        {"transform": {"rotation": "1 m"}},
        {"transform": {"translation": [1]}},
        {"transform": {"scale": -1}},
    ):
        with pytest.raises(ParameterError, match=r"truth\.(clock|transform)"):
            read(tmp_path, "t,d_A,d_B\n0,1,2\n", WIDE | {"truth": truth | wrong})


def test_arrays_of_matlab(tmp_path: Path):
    from scipy.io import savemat

    poses = np.array([[1, 1.7e9, 5e8, 1.25, -2.0], [2, 1.7e9 + 1, 5e8, math.pi, 0.1]])
    savemat(tmp_path / "vicon.mat", {"poses": poses})
    columns = {
        "time": {"columns": [2, 3], "unit": ["s", "ns"]}, "device_x": 4, "device_y": 5
    }  # fmt: skip
    said = WIDE | {"delimiter": ";", "truth": {"file": "vicon.mat", "columns": columns}}
    log = read(tmp_path, "t;d_A;d_B\n0;1;2\n", said)
    assert log.truth is not None
    assert log.truth.objects.state.tolist() == poses[:, 3:].tolist()
    assert log.truth.objects.time_ns.tolist() == [
        1_700_000_000_500_000_000,
        1_700_000_001_500_000_000,
    ]
    assert [f["name"] for f in log.meta.provenance["files"]] == ["log.csv", "vicon.mat"]
    savemat(tmp_path / "vicon.mat", {"a": poses, "b": poses})
    with pytest.raises(FormatError, match=r"vicon\.mat: .*holds a, b: .*one table"):
        read(tmp_path, "t;d_A;d_B\n0;1;2\n", said)
    (tmp_path / "vicon.mat").write_bytes(b"MATLAB 5.0" + bytes(200))
    with pytest.raises(FormatError, match=r"vicon\.mat"):
        read(tmp_path, "t;d_A;d_B\n0;1;2\n", said)


@pytest.mark.parametrize("by", ["yaw", "quaternion"])
def test_a_device_somewhere_on_a_body(tmp_path: Path, by: str):
    """A body at (1, 2) that heads north, its device 0.5 m ahead and 0.2 m to the left."""
    (tmp_path / "log.csv").write_text("t,a,r\n0,A,1\n")
    (tmp_path / "g.csv").write_text(f"t,x,y,h,s\n0,1,2,90,{0.5**0.5!r}\n")
    heading: dict[str, Any] = {"yaw": {"column": "h", "unit": "deg"}}
    if by == "quaternion":
        heading = {"qx": {"value": 0}, "qy": {"value": 0}, "qz": "s", "qw": "s"}
    columns = {"time": "t", "x": "x", "y": "y"} | heading
    said = {
        "kind": "uwb",
        "columns": {"time": "t", "anchor": "a", "distance": "r"},
        "anchors": {"A": [0, 0]},
        "truth": {"file": "g.csv", "columns": columns, "device": [0.5, 0.2]},
    }
    found = csv.read([tmp_path / "log.csv"], csv.Params(said))
    assert found.sensors["device"].object == 0
    state = found.truth.objects.columns("x", "y", "device_x", "device_y")
    np.testing.assert_allclose(state, [[1, 2, 0.8, 2.5]], atol=1e-12)
    without = {**said, "truth": {**said["truth"], "columns": {"time": "t", "x": "x", "y": "y"}}}
    with pytest.raises(ParameterError, match="device needs the heading"):
        csv.read([tmp_path / "log.csv"], csv.Params(without))
