"""The Autoferry importer: a small log by hand, each broken record, and the measured logs."""

from __future__ import annotations

import hashlib
import json
import os
from pathlib import Path

import numpy as np
import pytest

from echoset.formats.importers import autoferry
from echoset.models.errors import FormatError, InputError, ParameterError

RADAR, LIDAR, INFRARED = 2, 1, 3


def record(sensor, time, measurement, own=(10.0, 100.0)):
    return {
        "sensorID": sensor,
        "measurements": [],
        "ownshipPosition": list(own),
        "time": time,
        "measurement": measurement,
    }


LOG = [
    record(RADAR, 12.5, [[1.0, 2.0], [3.0, 4.0]], (11.0, 101.0)),
    record(INFRARED, 10.25, -2.2),
    record(RADAR, 10.5, [5.0, 6.0]),
    record(LIDAR, 10.0000000004, []),
    record(LIDAR, 11.0, [[7.0], [8.0]]),
]


def fix(target, time, north, east):
    return {"targetID": target, "position": [north, east, 0.0], "time": time}


TRUTH = [
    [fix(1, 10.0, 1.0, 2.0), fix(2, 10.2, 50.0, 60.0)],
    [fix(1, 10.0, 1.0, 2.0), fix(2, 10.4, 52.0, 62.0)],
    [fix(1, 10.8, 9.0, 2.0)],
    [],
    [fix(2, 11.0, 55.0, 65.0)],
]


def read(folder: Path, log=LOG, truth=None, **params):
    paths = [folder / "trip_detections.json"]
    paths[0].write_bytes(log if isinstance(log, bytes) else json.dumps(log).encode())
    if truth is not None:
        paths.append(folder / "trip_groundTruth.json")
        paths[1].write_text(json.dumps(truth))
    return autoferry.read(paths, autoferry.Params(**params))


def test_records_become_scans_in_order_of_time(tmp_path: Path):
    trip = read(tmp_path)
    radar, lidar = trip.streams["radar"], trip.streams["lidar"]
    assert (radar.kind, radar.nodes, lidar.nodes) == ("position", ("radar",), ("lidar",))
    assert radar.time_ns.tolist() == [10_500_000_000, 12_500_000_000]
    assert radar.row_offset.tolist() == [0, 1, 3]
    assert radar.rows["x"].tolist() == [6.0, 3.0, 4.0]
    assert radar.rows["y"].tolist() == [5.0, 1.0, 2.0]
    assert lidar.time_ns.tolist() == [10_000_000_000, 11_000_000_000]
    assert lidar.row_offset.tolist() == [0, 0, 1]
    assert (lidar.rows["x"].tolist(), lidar.rows["y"].tolist()) == ([8.0], [7.0])
    assert trip.sensors["radar"].time_ns.tolist() == radar.time_ns.tolist()
    assert trip.sensors["radar"].position.tolist() == [[100.0, 10.0, 0.0], [101.0, 11.0, 0.0]]
    assert trip.sensors["radar"].quaternion.tolist() == [[0.0, 0.0, 0.0, 1.0]] * 2
    assert trip.truth is None


def test_truth_stands_where_all_vessels_are_known(tmp_path: Path):
    truth = read(tmp_path, truth=TRUTH).truth.objects
    assert truth.state_names == ("x", "y") and truth.state_units == ("m", "m")
    assert truth.time_ns.tolist() == [10_200_000_000, 10_400_000_000, 10_800_000_000]
    assert truth.row_offset.tolist() == [0, 2, 4, 6]
    assert truth.label.tolist() == [1, 2] * 3
    first = [[2.0, 3.0], [2.0, 5.0], [2.0, 9.0]]
    second = [[60.0, 50.0], [62.0, 52.0], [64.0, 54.0]]
    np.testing.assert_allclose(truth.state[0::2], first, rtol=1e-12)
    np.testing.assert_allclose(truth.state[1::2], second, rtol=1e-12)
    strict = read(tmp_path, truth=TRUTH, max_gap=0.5).truth.objects
    assert len(strict.time_ns) == 0


def test_name_provenance_and_parameters(tmp_path: Path):
    trip = read(tmp_path, sensors=("radar",))
    assert list(trip.streams) == list(trip.sensors) == ["radar"]
    digest = hashlib.sha256(json.dumps(LOG).encode()).hexdigest()
    assert trip.meta.name == "trip"
    assert trip.meta.provenance == {
        "importer": "autoferry",
        "files": [{"name": "trip_detections.json", "sha256": digest}],
        "parameters": {"sensors": ["radar"], "max_gap": 1.0},
    }
    for wrong in ({"sensors": ()}, {"sensors": ("sonar",)}, {"sensors": ("radar",) * 2}):
        with pytest.raises(ParameterError, match="sensors"):
            autoferry.Params(**wrong)
    with pytest.raises(ParameterError, match="max_gap"):
        autoferry.Params(max_gap=0.0)


def changed(**values):
    return [LOG[2], {**LOG[0], **values}, LOG[3]]


BROKEN = {
    r"\[1\]\.sensorID: 7 is not one of 1, 2, 3, 4": changed(sensorID=7),
    r"\[1\]\.sensorID: 'radar' is not one of": changed(sensorID="radar"),
    r"\[1\]\.sensorID: a list of 1 is not one of": changed(sensorID=[2]),
    r"\[1\]\.time: '12' is not a finite number": changed(time="12"),
    r"\[1\]\.time: True is not a finite number": changed(time=True),
    r"\[1\]\.time: None is not": changed(time=None),
    r"\[1\]\.time: .* s is beyond the years": changed(time=1e10),
    r"\[1\]: a second scan of the radar at the same time": changed(time=10.5),
    r"\[1\]\.ownshipPosition: a list of 1 is not a list of 2 numbers": changed(
        ownshipPosition=[1.0]
    ),
    r"\[1\]\.ownshipPosition\[1\]: '2' is not": changed(ownshipPosition=[1.0, "2"]),
    r"\[1\]\.measurement: a list of 1 is not a list of 2 numbers": changed(measurement=[1.0]),
    r"\[1\]\.measurement: 3.5 is not a list": changed(measurement=3.5),
    r"\[1\]\.measurement: has 3 lists, needs north and east": changed(measurement=[[1.0]] * 3),
    r"\[1\]\.measurement: 2 north and 1 east": changed(measurement=[[1.0, 2.0], [3.0]]),
    r"\[1\]\.measurement\[1\]: 4 is not a list": changed(measurement=[[1.0], 4]),
    r"\[1\]\.measurement\[0\]\[0\]: an object is not": changed(measurement=[[{}], [2.0]]),
    r"\[1\]: 'time' is missing": [LOG[2], {k: v for k, v in LOG[0].items() if k != "time"}],
    r"\[1\]: 'x' is not a record": [LOG[2], "x"],
    "is not a list of records": {"a": 1},
    r"line 1, column 2: not JSON": b"[",
    "NaN is not a finite number": b"[NaN]",
    r"\[0\]\.time: 1E\+999 is not a finite number": json.dumps(LOG[:1])
    .replace("12.5", "1E+999")
    .encode(),
    "not JSON that can be read": b'[{"time": 1e9999999999999999999}]',
    "byte 1: is not UTF-8 text": b"[\xff]",
    r"not JSON: Expecting value|nested": b"[" * 100_000,
    "line 1, column 1: not JSON": b"",
}


@pytest.mark.parametrize("message", BROKEN)
def test_a_broken_record_is_named(tmp_path: Path, message: str):
    with pytest.raises(FormatError, match=r"trip_detections\.json: .*" + message) as error:
        read(tmp_path, BROKEN[message])
    assert "\n" not in str(error.value) and len(str(error.value)) < 300


BROKEN_TRUTH = {
    r"\[1\]: 4 is not a list of targets": [TRUTH[0], 4],
    r"\[0\]\[0\]: 4 is not a record": [[4]],
    r"\[0\]\[0\]\.targetID: -1 is not a label": [[fix(-1, 1.0, 1, 1)]],
    r"\[0\]\[0\]\.targetID: 1.5 is not a label": [[fix(1.5, 1.0, 1, 1)]],
    r"\[0\]\[0\]\.position: .* is not a list of 2 or 3": [[{**fix(1, 1.0, 1, 1), "position": []}]],
    r"\[1\]\[0\]: the same vessel elsewhere": [[fix(1, 1.0, 1, 1)], [fix(1, 1.0, 1, 2)]],
}


@pytest.mark.parametrize("message", BROKEN_TRUTH)
def test_broken_truth_is_named(tmp_path: Path, message: str):
    with pytest.raises(FormatError, match=r"trip_groundTruth\.json: " + message):
        read(tmp_path, truth=BROKEN_TRUTH[message])


def test_what_is_missing(tmp_path: Path):
    with pytest.raises(FormatError, match=r"nowhere\.json: No such file"):
        autoferry.read([tmp_path / "nowhere.json"], autoferry.Params())
    with pytest.raises(InputError, match=r"there is no \.\.\._detections\.json"):
        autoferry.read([tmp_path], autoferry.Params())
    with pytest.raises(InputError, match="no scan of the lidar"):
        read(tmp_path, [LOG[0]])
    with pytest.raises(InputError, match="no vessel"):
        read(tmp_path, truth=[[], []])
    read(tmp_path, truth=TRUTH)
    for names in (["trip_groundTruth.json"], ["trip_detections.json"] * 2):
        with pytest.raises(InputError, match="reads one file of detections"):
            autoferry.read([tmp_path / name for name in names], autoferry.Params())
    whole = autoferry.read([tmp_path], autoferry.Params())
    assert whole.truth is not None and len(whole.meta.provenance["files"]) == 2


SCANS = {2: (70, 234, 437), 3: (78, 259, 394), 13: (69, 232, 167), 17: (48, 157, 191)}
NEAR = {2: 0.94, 3: 0.85, 13: 0.78, 17: 0.92}
"""Share of cases in which a radar detection lies within 20 m of a vessel."""


@pytest.mark.parametrize("number", SCANS)
def test_the_measured_logs(number: int):
    data = Path(os.environ.get("ECHOSET_DATA", Path(__file__).parents[4] / "shared/data"))
    folder = data / "autoferry" / f"scenario{number}"
    if not folder.is_dir():
        pytest.skip(f"the measured recordings are not at {data} ($ECHOSET_DATA)")
    trip = autoferry.read([folder], autoferry.Params())
    radar, lidar, truth = trip.streams["radar"], trip.streams["lidar"], trip.truth.objects
    assert trip.meta.name == f"scenario{number}"
    assert (len(radar), len(lidar), len(radar.rows["x"])) == SCANS[number]
    assert abs(np.median(np.diff(radar.time_ns)) - 1.68e9) < 0.01e9
    assert (np.diff(truth.row_offset) == 2).all() and set(truth.label) == {1, 2}
    assert np.diff(truth.time_ns).max() < 0.4e9
    own = trip.sensors["radar"].position
    near = []
    for k in range(len(radar)):
        rows = slice(radar.row_offset[k], radar.row_offset[k + 1])
        x, y = radar.rows["x"][rows] + own[k, 0], radar.rows["y"][rows] + own[k, 1]
        at = np.abs(truth.time_ns - radar.time_ns[k]).argmin()
        for vessel in truth.state[2 * at : 2 * at + 2]:
            near.append((np.hypot(x - vessel[0], y - vessel[1]) < 20.0).any())
    assert round(float(np.mean(near)), 2) == NEAR[number]
