"""The importer of delimited logs: every kind, unit, frame and error by numbers worked by hand."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from echoset.formats.importers.csv import importer as csv
from echoset.models.errors import FormatError, InputError, ParameterError
from echoset.models.records import Recording

EXAMPLE = Path(__file__).parents[3] / "examples/ranges"
ANCHORS = {"A": [0, 0], "B": [4, 0, 2.5]}
RANGES: dict[str, Any] = {
    "kind": "uwb",
    "columns": {"time": "t", "anchor": "id", "distance": "r"},
    "anchors": ANCHORS,
}
POINTS: dict[str, Any] = {"kind": "position", "columns": {"time": "t", "x": "x", "y": "y"}}
BEARINGS: dict[str, Any] = {
    "kind": "range_bearing",
    "columns": {"time": "t", "range": "r", "azimuth": "b"},
}


def read(folder: Path, text: str, mapping: dict[str, Any], **files: str) -> Recording:
    """The log ``text`` with further files by their names without ``.csv``."""
    for name, content in files.items():
        (folder / f"{name}.csv").write_text(content)
    log = folder / "log.csv"
    log.write_text(text)
    return csv.read([log], csv.Params(mapping))


def test_the_example():
    log = csv.read([EXAMPLE / "ranges.csv"], csv.Params(str(EXAMPLE / "mapping.yaml")))
    uwb = log.streams["uwb"]
    assert log.meta.name == "ranges"
    assert uwb.nodes == ("T7", "south-west", "south-east", "north-east", "north-west")
    assert log.sensors["T7"].object == 0
    np.testing.assert_array_equal(uwb.time_ns, np.arange(20) * 100_000_000)
    np.testing.assert_array_equal(np.flatnonzero(np.diff(uwb.row_offset) == 0), [9])
    np.testing.assert_array_equal(uwb.rows["std"], np.full(19, 0.1))
    assert uwb.model == {"mean_scatter": 0, "mean_clutter": 0.1, "max_range": 20}
    assert log.truth is not None
    # The tag walks from (1, 1) at 1.1 m/s east and 0.8 m/s north; ranges are within 15 cm.
    walked = uwb.time_ns[:, None] * 1e-9 * [1.1, 0.8] + [1.0, 1.0]
    anchors = np.array([log.sensors[n].position[0, :2] for n in uwb.nodes[1:]])[uwb.scan["rx"] - 1]
    exact = np.delete(np.linalg.norm(walked - anchors, axis=1), 9)
    assert np.abs(uwb.rows["distance"] - exact).max() < 0.15
    assert [f["name"] for f in log.meta.provenance["files"]] == ["ranges.csv", "truth.csv"]


def test_active_ranges_are_sorted_and_grouped(tmp_path: Path):
    log = read(tmp_path, "t,id,r\n2,B,7\n1,B,5\n1,A,3\n2,A,\n1,B,6\n", RANGES)
    uwb = log.streams["uwb"]
    assert uwb.nodes == ("device", "A", "B")
    np.testing.assert_array_equal(uwb.time_ns, np.array([1, 1, 2, 2]) * 10**9)
    np.testing.assert_array_equal(uwb.scan["rx"], [1, 2, 1, 2])
    np.testing.assert_array_equal(uwb.row_offset, [0, 1, 3, 3, 4])
    np.testing.assert_array_equal(uwb.rows["distance"], [3, 5, 6, 7])
    np.testing.assert_array_equal(log.sensors["B"].position, [[4, 0, 2.5]])
    assert log.sensors["device"].object == -1


def test_active_and_passive_links_by_tx_and_rx(tmp_path: Path):
    columns = {"time": "t", "tx": "tx", "rx": "rx", "distance": "r"}
    columns["amplitude"] = {"column": "u", "unit": "dB"}
    mapping = {**RANGES, "columns": columns, "devices": {"tag": 4}}
    log = read(tmp_path, "t,tx,rx,r,u\n0,A,B,3,40\n0,B,A,1,20\n0,tag,B,2,0\n", mapping)
    uwb = log.streams["uwb"]
    np.testing.assert_array_equal(uwb.scan["mode"], [0, 1, 1])
    np.testing.assert_array_equal(uwb.scan["tx"], [0, 2, 1])
    np.testing.assert_array_equal(uwb.scan["rx"], [2, 1, 2])
    np.testing.assert_array_equal(uwb.rows["distance"], [2, 1, 3])
    np.testing.assert_allclose(uwb.rows["amplitude"], [1, 10, 100], rtol=1e-15)
    assert log.sensors["tag"].object == 4


@pytest.mark.parametrize(
    ("unit", "metres"),
    [("m", 2.0), ("cm", 0.02), ("mm", 0.002), ("km", 2000.0), ("ft", 0.6096), ("in", 0.0508)],
)
def test_units_of_length(tmp_path: Path, unit: str, metres: float):
    mapping = {**RANGES, "columns": {**RANGES["columns"], "distance": {"column": 3, "unit": unit}}}
    log = read(tmp_path, "t,id,r\n0,A,2\n", mapping)
    assert log.streams["uwb"].rows["distance"][0] == pytest.approx(metres, rel=1e-15)


@pytest.mark.parametrize(
    ("unit", "text", "ns"),
    [
        ("s", "1621234567.123456789", 1_621_234_567_123_456_789),
        ("ms", "1.5", 1_500_000),
        ("us", "2e3", 2_000_000),
        ("ns", "9007199254740993", 9_007_199_254_740_993),
    ],
)
def test_times_are_exact_to_the_nanosecond(tmp_path: Path, unit: str, text: str, ns: int):
    mapping = {**RANGES, "columns": {**RANGES["columns"], "time": {"column": "t", "unit": unit}}}
    assert read(tmp_path, f"t,id,r\n{text},A,2\n", mapping).streams["uwb"].time_ns[0] == ns


def test_other_ways_to_write_a_table(tmp_path: Path):
    blanks = {
        **RANGES,
        "delimiter": " ",
        "comment": "%",
        "header": False,
        "columns": {"time": 1, "anchor": 3, "distance": 2},
        "anchors": {"file": "a.csv", "delimiter": ";", "header": True, "columns": {}},
    }
    blanks["anchors"]["columns"] = {"id": "name", "x": {"column": "x", "unit": "cm"}, "y": "y"}
    log = read(tmp_path, "% a b c\n 1   2.5  A \n\n", blanks, a="name;x;y\nA;50;3\n")
    assert log.streams["uwb"].rows["distance"].tolist() == [2.5]
    assert log.sensors["A"].position.tolist() == [[0.5, 3, 0]]
    quoted = read(tmp_path, '\ufefft,"id",r\r\n0,"A",1\r\n', RANGES)
    assert len(quoted.streams["uwb"]) == 1


def test_points_with_empty_scans(tmp_path: Path):
    log = read(tmp_path, "t,x,y\n1,1,2\n3,5,6\n2,,\n1,3,4\n", POINTS)
    radar = log.streams["radar"]
    assert log.sensors["radar"].position.tolist() == [[0, 0, 0]]
    np.testing.assert_array_equal(radar.time_ns, np.array([1, 2, 3]) * 10**9)
    np.testing.assert_array_equal(radar.row_offset, [0, 2, 2, 3])
    np.testing.assert_array_equal(radar.rows["x"], [1, 3, 5])
    listed = {**POINTS, "scans": {"file": "s.csv", "columns": {"time": "at"}}}
    log = read(tmp_path, "t,x,y\n1,1,2\n", listed, s="at\n0\n1\n2\n")
    np.testing.assert_array_equal(log.streams["radar"].row_offset, [0, 0, 1, 1])


def test_scan_ids_and_several_radars(tmp_path: Path):
    columns = {"time": "t", "x": "x", "y": "y", "scan": "k", "sensor": "s"}
    mapping = {**POINTS, "columns": columns, "sensors": {"a": [0, 0], "b": [1, 1]}}
    text = "t,k,s,x,y\n0.2,7,a,1,0\n0.1,7,a,2,0\n0.1,7,b,3,0\n0.5,8,a,4,0\n"
    log = read(tmp_path, text, mapping)
    a, b = log.streams["a"], log.streams["b"]
    np.testing.assert_array_equal(a.time_ns, [100_000_000, 500_000_000])
    np.testing.assert_array_equal(a.row_offset, [0, 2, 3])
    np.testing.assert_allclose(a.rows["time_offset"], [0.1, 0.0, 0.0], atol=1e-15)
    assert b.rows["x"].tolist() == [3]
    with pytest.raises(FormatError, match=r"line 4, column 'k': scan '1' comes back"):
        read(tmp_path, "t,k,s,x,y\n0,1,a,1,0\n1,2,a,1,0\n2,1,a,1,0\n", mapping)


def test_north_east_down(tmp_path: Path):
    frame = {"frame": ["north", "east", "down"], "sensors": {"radar": {"position": [10, 20, -5]}}}
    columns = {**POINTS["columns"], "z": "z"}
    log = read(tmp_path, "t,x,y,z\n0,1,2,3\n", {**POINTS, **frame, "columns": columns})
    rows, sensor = log.streams["radar"].rows, log.sensors["radar"]
    assert [rows[c][0] for c in "xyz"] == [2, 1, -3]
    assert sensor.position.tolist() == [[20, 10, 5]]
    np.testing.assert_allclose(sensor.quaternion, [[0, 0, 0, 1]], atol=1e-15)


def map_points(log: Recording) -> np.ndarray:
    """Detections of the first scan in the map, by the rotation formula of unit quaternions."""
    radar, sensor = log.streams["radar"], log.sensors["radar"]
    rows = radar.rows
    if "range" in rows:
        angle = rows["azimuth"]
        p = np.column_stack([np.cos(angle), np.sin(angle), 0 * angle]) * rows["range"][:, None]
    else:
        p = np.column_stack([rows["x"], rows["y"], np.zeros(len(rows["x"]))])
    v, w = sensor.quaternion[0, :3], sensor.quaternion[0, 3]
    return p + 2 * np.cross(v, np.cross(v, p) + w * p) + sensor.position[0]


def test_heading_from_north_and_bearing_to_the_right(tmp_path: Path):
    # A ship at north 100, east 50 heads east (90 deg clockwise from north). A target 10 m ahead is
    # at east 60, north 100; one 10 m to starboard is at east 50, north 90.
    pose = {
        "frame": ["north", "east"],
        "sensor_frame": ["forward", "right"],
        "sensors": {"radar": {"position": [100, 50], "yaw": "90 deg"}},
    }
    expected = [[60, 100, 0], [50, 90, 0]]
    log = read(tmp_path, "t,x,y\n0,10,0\n0,0,10\n", {**POINTS, **pose})
    np.testing.assert_allclose(map_points(log), expected, atol=1e-12)
    columns = {**BEARINGS["columns"], "azimuth": {"column": "b", "unit": "deg"}}
    log = read(tmp_path, "t,r,b\n0,10,0\n0,10,90\n", {**BEARINGS, **pose, "columns": columns})
    np.testing.assert_allclose(map_points(log), expected, atol=1e-12)
    # What the radar measures to the left is to port, whichever way the heading turns.
    port = {**pose, "sensor_frame": ["forward", "left"]}
    log = read(tmp_path, "t,x,y\n0,10,0\n0,0,10\n", {**POINTS, **port})
    np.testing.assert_allclose(map_points(log), [[60, 100, 0], [50, 110, 0]], atol=1e-12)


def test_axes_that_are_turned(tmp_path: Path):
    # Three to the right and ten ahead, of a sensor whose right points east and whose front north.
    pose = {"sensor_frame": ["right", "forward"], "sensors": {"radar": [100, 50]}}
    log = read(tmp_path, "t,x,y\n0,3,10\n", {**POINTS, **pose})
    np.testing.assert_allclose(map_points(log), [[103, 60, 0]], atol=1e-12)
    south = {"frame": ["south", "east"], "sensors": {"radar": [100, 50]}}
    log = read(tmp_path, "t,x,y\n0,3,10\n", {**POINTS, **south})
    np.testing.assert_allclose(map_points(log), [[60, -103, 0]], atol=1e-12)
    assert log.sensors["radar"].position.tolist() == [[50, -100, 0]]


def test_compass_bearings(tmp_path: Path):
    columns = {**BEARINGS["columns"], "azimuth": {"column": "b", "unit": "deg"}}
    log = read(
        tmp_path,
        "t,r,b\n0,1,0\n0,1,90\n0,1,300\n",
        {**BEARINGS, "frame": ["north", "east"], "columns": columns},
    )
    azimuth = log.streams["radar"].rows["azimuth"]
    np.testing.assert_allclose(np.rad2deg(azimuth), [90, 0, 150], atol=1e-12)


def test_a_moving_radar(tmp_path: Path):
    columns = {"time": "t", "x": "x", "y": "y", "yaw": {"column": "h", "unit": "deg"}}
    moving = {"radar": {"file": "p.csv", "columns": columns}}
    log = read(
        tmp_path, "t,x,y\n0,1,0\n", {**POINTS, "sensors": moving}, p="t,x,y,h\n1,3,4,90\n0,1,2,0\n"
    )
    sensor = log.sensors["radar"]
    np.testing.assert_array_equal(sensor.time_ns, [0, 10**9])
    np.testing.assert_array_equal(sensor.position, [[1, 2, 0], [3, 4, 0]])
    half = np.sqrt(0.5)
    np.testing.assert_allclose(sensor.quaternion, [[0, 0, 0, 1], [0, 0, half, half]], atol=1e-15)
    del columns["yaw"]
    columns |= {"qx": 4, "qy": 5, "qz": 6, "qw": 7}
    poses = "t,x,y,a,b,c,d\n0,0,0,0,0,0.6,0.8\n"
    log = read(tmp_path, "t,x,y\n0,1,0\n", {**POINTS, "sensors": moving}, p=poses)
    np.testing.assert_allclose(log.sensors["radar"].quaternion, [[0, 0, 0.6, 0.8]], atol=1e-15)
    with pytest.raises(FormatError, match=r"p\.csv: line 3, .* is the time of another pose"):
        read(
            tmp_path,
            "t,x,y\n0,1,0\n",
            {**POINTS, "sensors": moving},
            p=poses + "0,0,0,0,0,0,1\n",
        )


def test_truth(tmp_path: Path):
    columns = {"time": "t", "x": "n", "y": "e", "vx": "vn", "vy": "ve", "label": "id"}
    mapping = {**POINTS, "frame": ["north", "east"], "truth": {"file": "g.csv", "columns": columns}}
    table = "t,n,e,vn,ve,id\n1,1,2,3,4,5\n0,5,6,7,8,5\n0,1,1,1,2,3\n"
    truth = read(tmp_path, "t,x,y\n0,1,0\n", mapping, g=table).truth
    assert truth is not None
    o = truth.objects
    assert o.state_names == ("x", "y", "vx", "vy")
    assert o.state_units == ("m", "m", "m s-1", "m s-1")
    np.testing.assert_array_equal(o.time_ns, [0, 10**9])
    np.testing.assert_array_equal(o.row_offset, [0, 2, 3])
    np.testing.assert_array_equal(o.label, [3, 5, 5])
    np.testing.assert_array_equal(o.state, [[1, 1, 2, 1], [6, 5, 8, 7], [2, 1, 4, 3]])


def test_optional_quantities_and_scale(tmp_path: Path):
    columns = {
        **BEARINGS["columns"],
        "doppler": {"column": "v", "unit": "km/h", "scale": -1},
        "power": {"column": "snr", "unit": "dB"},
        "std_azimuth": {"value": "1 deg"},
    }
    log = read(tmp_path, "t,r,b,v,snr\n0,1,0,36,30\n1,,,,\n", {**BEARINGS, "columns": columns})
    rows = log.streams["radar"].rows
    np.testing.assert_allclose(rows["doppler"], [-10], rtol=1e-15)
    np.testing.assert_allclose(rows["power"], [1000], rtol=1e-13)
    np.testing.assert_allclose(rows["std_azimuth"], [np.pi / 180], rtol=1e-15)


BAD_LOGS = {
    "line 3, column 'r': 'abc' is not a finite number": "t,id,r\n0,A,1\n1,A,abc\n",
    "line 2, column 'r': '1,5' is not a finite number: dec": 't,id,r\n0,A,"1,5"\n',
    "line 2, column 'r': 'inf' is not a finite number": "t,id,r\n0,A,inf\n",
    "line 2, column 'r': 'nan' is not a finite number": "t,id,r\n0,A,nan\n",
    "line 4, column 'r': '-1' is negative": "t,id,r\n# note\n0,A,1\n0,A,-1\n",
    "line 2, column 't': is empty, needs a number": "t,id,r\n,A,1\n",
    "line 2, column 't': '1e30' s is beyond": "t,id,r\n1e30,A,1\n",
    "line 2, column 'id': 'C' is not one of A B": "t,id,r\n0,C,1\n",
    "line 3: has 2 fields, needs 3": "t,id,r\n0,A,1\n0,A\n",
    r"line 1: no column 'r' \(did you mean 'rr'": "t,id,rr\n0,A,1\n",
    "line 1: no column 'r': there are t, id, dist": "t,id,dist\n0,A,1\n",
    "line 1: two columns are called 'r'": "t,id,r,r\n0,A,1,2\n",
    "line 1: the file is empty": "",
    "line 1: there is nothing but comments": "# only\n",
    "line 2: unexpected end of data": 't,id,r\n0,"A,1\n',
}


@pytest.mark.parametrize("message", BAD_LOGS)
def test_a_broken_log_is_named_by_line_and_column(tmp_path: Path, message: str):
    with pytest.raises(FormatError, match=r"log\.csv: " + message):
        read(tmp_path, BAD_LOGS[message], RANGES)


BAD_MAPPINGS: dict[str, dict[str, Any]] = {
    r"unknown parameter 'ancors' \(did you mean 'anchors'": {"ancors": {}},
    r"kind must be one of .* \(did you mean 'uwb'": {"kind": "uwbs"},
    "anchors are missing": {"anchors": {}},
    "anchors must be a mapping": {"anchors": [1]},
    r"anchors.A must be a position \[x, y\]": {"anchors": {"A": [1]}},
    "anchors.A must be a number": {"anchors": {"A": [1, "two"]}},
    r"anchors.A: unknown key 'positon' \(did you mean 'position'": {
        "anchors": {"A": {"positon": [0, 0]}}
    },
    "anchors.A: unit 'yd' is not one of m cm": {"anchors": {"A": ["1 yd", 0]}},
    "the name of a sensor must be made of": {"anchors": {**ANCHORS, "a b": [0, 0]}},
    "'A' is an anchor and a device": {"devices": {"A": 0}},
    "several devices need the column 'device'": {"devices": {"c": 0, "d": 1}},
    "frame must be made of .* got 'nort'": {"frame": ["nort", "east"]},
    "frame must be two horizontal": {"frame": ["north", "south"]},
    "delimiter must be one character": {"delimiter": "||"},
    "epoch must be a time in ISO 8601": {"epoch": "yesterday"},
    "header: must be a bool": {"header": 3},
    "columns must map quantities": {"columns": ["t"]},
    "columns: 'distance' is missing": {"columns": {"time": "t", "anchor": "id"}},
    r"unknown quantity 'distanc' \(did you mean 'distance'": {"columns": {"distanc": "r"}},
    r"log.csv: columns need either anchor \(and device\), or": {
        "columns": {"time": "t", "distance": "r"}
    },
    "either anchor": {"columns": {**RANGES["columns"], "tx": "id"}},
    "'sensors' has no meaning for kind 'uwb'": {"sensors": {"radar": [0, 0]}},
    "columns.distance needs either a column or a value": {
        "columns": {**RANGES["columns"], "distance": {"unit": "m"}}
    },
    r"columns.distance: unknown parameter 'units' \(did you mean 'unit'": {
        "columns": {**RANGES["columns"], "distance": {"column": "r", "units": "m"}}
    },
    r"columns.distance: unit 'meter' is not one of": {
        "columns": {**RANGES["columns"], "distance": {"column": "r", "unit": "meter"}}
    },
    "columns.time: unit 'min' is not one of s ms us ns": {
        "columns": {**RANGES["columns"], "time": {"column": "t", "unit": "min"}}
    },
    "truth must have file and columns": {"truth": "g.csv"},
    "truth: 'file' is missing": {"truth": {"columns": {"time": "t"}}},
    "has no header: give the number of column 't'": {"header": False},
}


@pytest.mark.parametrize("message", BAD_MAPPINGS)
def test_a_wrong_mapping_is_a_usage_error(tmp_path: Path, message: str):
    with pytest.raises(ParameterError, match=message):
        read(tmp_path, "t,id,r\n0,A,1\n", {**RANGES, **BAD_MAPPINGS[message]})


def test_yaml_files(tmp_path: Path):
    path = tmp_path / "m.yaml"
    log = tmp_path / "log.csv"
    log.write_text("t,id,r\n0,1,2\n")
    head = "kind: uwb\nepoch: 2024-05-01\ncolumns: {time: t, anchor: id, distance: r}\n"
    path.write_text(head + "anchors: {1: [0, 0]}\nmodel: {sigma: 1e-3}\n")
    found = csv.read([log], csv.Params(str(path)))
    assert found.streams["uwb"].model == {"sigma": 0.001}
    assert found.meta.epoch == "2024-05-01"
    for text, message in {
        "kind: [uwb": "line 1: expected",
        "- a\n": "must map keys to values",
        "a: &x [1]\nb: *x\n": "aliases are not allowed",
        "a: !!python/object:os.system {}\n": "line 1: could not determine a constructor",
        "a: .nan\n": "a: nan is not finite",
        "a: !!binary aGk=\n": "neither a number nor a text",
    }.items():
        path.write_text(text)
        with pytest.raises(ParameterError, match=message):
            csv.read([log], csv.Params(str(path)))
    with pytest.raises(ParameterError, match="No such file"):
        csv.read([log], csv.Params(str(tmp_path / "none.yaml")))
    with pytest.raises(ParameterError, match="mapping must be the path"):
        csv.Params()
    with pytest.raises(InputError, match="reads one log"):
        csv.read([log, log], csv.Params(RANGES))
    with pytest.raises(FormatError, match=r"none\.csv: No such file"):
        csv.read([tmp_path / "none.csv"], csv.Params(RANGES))


def test_partial_measurements_are_refused(tmp_path: Path):
    with pytest.raises(FormatError, match=r"line 2, column 'y': '' and x: one is empty"):
        read(tmp_path, "t,x,y\n0,1,\n", POINTS)
    mapping = {**POINTS, "columns": {**POINTS["columns"], "doppler": "v"}}
    with pytest.raises(FormatError, match=r"column 'v': '' is empty, yet there is a detection"):
        read(tmp_path, "t,x,y,v\n0,1,2,\n", mapping)


def test_a_log_without_rows_has_no_events(tmp_path: Path):
    assert len(read(tmp_path, "t,id,r\n", RANGES).streams["uwb"]) == 0
    assert len(read(tmp_path, "t,x,y\n", POINTS).streams["radar"]) == 0


@pytest.mark.parametrize(
    ("text", "guess"), [("t;id;r\n1;A;2\n", ";"), ("t\tid\tr\n1\tA\t2\n", "\\t"), ("1 A 2\n", " ")]
)
def test_another_delimiter_is_guessed(tmp_path: Path, text: str, guess: str):
    mapping = RANGES
    if text[0] == "1":
        mapping = RANGES | {"header": False, "columns": {"time": 1, "anchor": 2, "distance": 3}}
    with pytest.raises(
        FormatError, match=re.escape(f"line 1: has one column: is the delimiter '{guess}'")
    ):
        read(tmp_path, text, mapping)
    delimiter = guess.replace("\\t", "\t")
    assert len(read(tmp_path, text, mapping | {"delimiter": delimiter}).streams["uwb"]) == 1


def test_anchors_are_called_what_the_mapping_says(tmp_path: Path):
    names = ("0x1A", "007", "no", "1e3")
    (tmp_path / "m.yaml").write_text(
        "kind: uwb\ncolumns: {time: t, anchor: id, distance: r}\nanchors: "
        "{0x1A: [0, 0], 007: [4, 0], no: [4, 3], 1e3: [0, 3]}\n"
    )
    rows = "".join(f"1,{name},2\n" for name in names)
    log = read(tmp_path, f"t,id,r\n{rows}", str(tmp_path / "m.yaml"))  # type: ignore[arg-type]
    assert log.streams["uwb"].nodes == ("device", *names)
