"""Every rule of a record, broken once, is named with the place where it is broken."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from echoset.models.checks import check, check_objects, check_stream
from echoset.models.errors import FormatError
from echoset.models.records import Estimates, Meta, Objects, Recording, Sensor, Stream, Truth


def uwb(**changes: Any) -> Stream:
    """Three events at two times, with two, none and one distances."""
    stream = Stream(
        "uwb",
        ("d", "a", "b"),
        {"mean_scatter": 5.0, "note": "text", "table": [1.0, 2.0], "flag": True, "count": 3},
        np.array([10, 10, 20]),
        np.array([0, 2, 2, 3]),
        {
            "mode": np.array([0, 1, 0], np.uint8),
            "tx": np.array([0, 2, 0], np.int32),
            "rx": np.array([1, 1, 2], np.int32),
        },
        {
            "distance": np.array([1.0, 0.0, 3.0]),
            "origin_id": np.array([0, -1, 0], np.int32),
            "origin_x": np.array([1.0, np.nan, 2.0]),
        },
    )
    return replace(stream, **changes)


def objects(**changes: Any) -> Objects:
    """Two objects at the first time, one at the second."""
    whole = Objects(
        np.array([10, 20]),
        np.array([0, 2, 3]),
        np.array([0, 1, 0]),
        ("x", "y"),
        ("m", "m"),
        np.arange(6.0).reshape(3, 2),
        covariance=np.tile(np.eye(2), (3, 1, 1)),
        existence=np.array([0.0, 0.5, 1.0]),
        class_names=("car", "bus"),
        class_index=np.array([0, 1, 1]),
        class_probability=np.array([[1.0, 0.0], [0.5, 0.5], [0.2, 0.8]]),
        extent_kind="ellipse",
        semi_axes=np.ones((3, 2)),
        rotation=np.zeros(3),
    )
    return replace(whole, **changes)


SENSORS = {
    "d": Sensor.device(0),
    "a": Sensor.static("anchor", np.zeros(2)),
    "b": Sensor.static("anchor", np.ones(3)),
    "r": Sensor.static("radar", np.zeros(2)),
}


def recording(**changes: Any) -> Recording:
    truth = Truth(objects(), np.array([10]), np.zeros(1, np.int32), np.full(1, 2, np.int32))
    return replace(Recording(Meta("log"), SENSORS, {"uwb": uwb()}, truth), **changes)


def estimates(**changes: Any) -> Estimates:
    meta = Meta("log", provenance={"estimator": "e"})
    whole = Estimates(meta, objects(), {"spread": np.zeros((2, 3))}, recording())
    return replace(whole, **changes)


def changed(array: np.ndarray, index: Any, value: Any) -> np.ndarray:
    copy = np.array(array)
    copy[index] = value
    return copy


def test_sound_records_pass():
    check(recording())
    check(estimates())
    check(recording().setup())
    check(recording().observed())
    check(recording(streams={}, sensors={}, truth=None))
    check_stream(uwb().part(1, 3), SENSORS, "uwb")


def test_the_radar_kinds():
    for kind, columns in (("position", "xy"), ("range_bearing", ("range", "azimuth"))):
        rows = {c: np.array([1.0]) for c in columns}
        stream = Stream(kind, ("r",), {}, np.array([1, 2]), np.array([0, 0, 1]), {}, rows)
        check_stream(stream, SENSORS, "radar/r")
        with pytest.raises(FormatError, match="needs one radar, got anchor"):
            check_stream(replace(stream, nodes=("a",)), SENSORS, "radar/r")
        del rows[columns[1]]
        with pytest.raises(FormatError, match=f"column '{columns[1]}' is missing"):
            check_stream(stream, SENSORS, "radar/r")


scan, rows = uwb().scan, uwb().rows
STREAMS = {
    "kind: 'lidar' is not one of": {"kind": "lidar"},
    r"kind: array\(": {"kind": np.zeros(2)},
    "nodes: 'z' is not a sensor": {"nodes": ("d", "a", "z")},
    "nodes: 'r' is a radar": {"nodes": ("d", "a", "r")},
    "nodes: anchors missing": {"nodes": ("d",)},
    "nodes: names something twice": {"nodes": ("d", "a", "a")},
    "nodes: must be a tuple": {"nodes": ["d", "a", "b"]},
    r"model/p\[0\]: nan is not finite": {"model": {"p": np.nan}},
    r"model/p\[1\]: inf is not finite": {"model": {"p": [0.0, np.inf]}},
    "model/p: None is neither": {"model": {"p": None}},
    "model/p: is a ragged list": {"model": {"p": [[1.0], [1.0, 2.0]]}},
    "model: must be a group": {"model": 3},
    r"time_ns\[2\]: 5 is out of order": {"time_ns": np.array([10, 10, 5])},
    "time_ns: has type float64": {"time_ns": np.array([10.0, 10.0, 20.0])},
    "row_offset: has shape": {"row_offset": np.array([0, 2, 3])},
    r"row_offset\[0\]: 1 is not 0": {"row_offset": np.array([1, 2, 2, 3])},
    r"row_offset\[2\]: 1 is out of order": {"row_offset": np.array([0, 2, 1, 3])},
    r"rows/distance: has shape \(3,\), needs \(4,\)": {"row_offset": np.array([0, 2, 2, 4])},
    "rows: must be a group": {"rows": np.zeros(3)},
    "rows/colour: not a known row column": {"rows": {**rows, "colour": np.zeros(3)}},
    "rows/tx: not a known row column": {"rows": {**rows, "tx": scan["tx"]}},
    "scan/distance: not a known scan": {"scan": {**scan, "distance": np.zeros(3)}},
    "column 'mode' is missing": {"scan": {k: scan[k] for k in ("tx", "rx")}},
    "column 'distance' is missing": {"rows": {}, "row_offset": np.zeros(4, np.int64)},
    r"distance\[1\]: -0.5 is negative": {"rows": {"distance": changed(rows["distance"], 1, -0.5)}},
    r"distance\[2\]: nan is not": {"rows": {"distance": changed(rows["distance"], 2, np.nan)}},
    r"distance\[0\]: inf is not": {"rows": {"distance": changed(rows["distance"], 0, np.inf)}},
    "distance: has type float32": {"rows": {"distance": np.zeros(3, np.float32)}},
    "distance: must be an array, not list": {"rows": {"distance": [1.0, 2.0, 3.0]}},
    r"origin_x\[1\]: inf": {"rows": {**rows, "origin_x": changed(rows["origin_x"], 1, np.inf)}},
    r"mode\[1\]: 3 is not a code \(0 active": {
        "scan": {**scan, "mode": changed(scan["mode"], 1, 3)}
    },
    r"tx\[2\]: -1 is negative": {"scan": {**scan, "tx": changed(scan["tx"], 2, -1)}},
    r"rx\[1\]: 3 is not one of 3 nodes": {"scan": {**scan, "rx": changed(scan["rx"], 1, 3)}},
    r"rx\[0\]: 0 is not an anchor": {"scan": {**scan, "rx": changed(scan["rx"], 0, 0)}},
    r"tx\[0\]: 1 is not a device": {"scan": {**scan, "tx": changed(scan["tx"], 0, 1)}},
    r"tx\[1\]: 0 is a device": {"scan": {**scan, "tx": changed(scan["tx"], 1, 0)}},
}


@pytest.mark.parametrize("message", STREAMS)
def test_a_broken_stream(message: str):
    with pytest.raises(FormatError, match=f"^log.h5: streams/uwb[/:].*{message}"):
        check(recording(streams={"uwb": uwb(**STREAMS[message])}), "log.h5")


whole = objects()
OBJECTS = {
    r"time_ns\[1\]: 5 is out of order": {"time_ns": np.array([10, 5])},
    r"label\[1\]: 0 occurs twice": {"label": np.array([0, 0, 0])},
    "label: has type int32": {"label": np.array([0, 1, 0], np.int32)},
    "state_names: names something twice": {"state_names": ("x", "x")},
    "state_units: has 1 units for 2": {"state_units": ("m",)},
    r"state: has shape \(3, 1\)": {"state": np.zeros((3, 1))},
    r"state\[2, 1\]: nan": {"state": changed(whole.state, (2, 1), np.nan)},
    r"covariance\[1, 0, 1\]: 0.1 is not symm": {
        "covariance": changed(whole.covariance, (1, 0, 1), 0.1)
    },
    r"covariance\[1, 0\]: -1.0 is a negative variance": {
        "covariance": changed(whole.covariance, (1, 0, 0), -1.0)
    },
    r"existence\[2\]: 1.5 is not a prob": {"existence": np.array([0.0, 0.5, 1.5])},
    r"class_index\[0\]: 2 is not one of 2": {"class_index": np.array([2, 0, 0])},
    "class_index: must be an array of integers": {"class_index": np.zeros(3)},
    r"class_probability\[0, 1\]: -0.1": {
        "class_probability": changed(whole.class_probability, (0, 1), -0.1)
    },
    "class_probability: has shape": {"class_probability": np.zeros((3, 1))},
    "extent_kind: 'star' is not one of": {"extent_kind": "star"},
    "extent_kind: is empty, yet": {"extent_kind": ""},
    r"semi_axes\[2, 0\]: 0.0 is not positive": {"semi_axes": changed(np.ones((3, 2)), (2, 0), 0)},
    "semi_axes: must be an array, not NoneType": {"semi_axes": None},
    "rotation: has shape": {"rotation": np.zeros((3, 4))},
}


@pytest.mark.parametrize("message", OBJECTS)
def test_broken_objects(message: str):
    broken = objects(**OBJECTS[message])
    with pytest.raises(FormatError, match=f"truth/objects/.*{message}"):
        check(recording(truth=Truth(broken)))
    with pytest.raises(FormatError, match=f"^e: objects/.*{message}"):
        check(estimates(objects=broken), "e")


def test_an_ellipsoid_rotates_by_a_unit_quaternion():
    q = np.tile([0.0, 0.0, 0.6, 0.8], (3, 1))
    solid = objects(extent_kind="ellipsoid", semi_axes=np.ones((3, 3)), rotation=q)
    check_objects(solid, "objects")
    with pytest.raises(FormatError, match=r"rotation\[1\]: .* is not the norm"):
        check_objects(replace(solid, rotation=changed(q, (1, 3), 0.81)), "objects")


def test_broken_sensors():
    anchor = SENSORS["a"]
    two = replace(
        anchor,
        time_ns=np.array([0, 5]),
        position=np.zeros((2, 3)),
        quaternion=np.tile(anchor.quaternion, (2, 1)),
    )
    check(recording(sensors={**SENSORS, "a": two}))
    for message, sensor in {
        "kind: 'lamp' is not one of": replace(anchor, kind="lamp"),
        r"time_ns\[1\]: 5 is out of order": replace(two, time_ns=np.array([5, 5])),
        r"position\[1, 2\]: inf": replace(two, position=changed(two.position, (1, 2), np.inf)),
        r"quaternion\[0\]: .* unit quat": replace(two, quaternion=two.quaternion * 1.001),
        "position: has shape": replace(two, position=np.zeros((2, 2))),
        "the anchor has no position": replace(SENSORS["d"], kind="anchor"),
        "object: -2 is neither": replace(anchor, object=-2),
    }.items():
        with pytest.raises(FormatError, match=f"sensors/a.*{message}"):
            check(recording(sensors={**SENSORS, "a": sensor}))


def test_broken_truth_and_steps():
    truth = recording().truth
    assert truth is not None
    one = np.ones(1, np.int32)
    for message, broken in {
        r"blocked/tx\[0\]: 1 is not a device": replace(truth, blocked_tx=one),
        r"blocked/rx\[0\]: 7 is not one of 3 nodes": replace(truth, blocked_rx=7 * one),
        "blocked/rx: has shape": replace(truth, blocked_rx=np.ones(2, np.int32)),
        r"objects/time_ns\[1\]: 10 is out": replace(
            truth, objects=objects(time_ns=np.array([10, 10]))
        ),
    }.items():
        with pytest.raises(FormatError, match=f"truth/{message}"):
            check(recording(truth=broken))
    for message, steps in {
        "steps/s: has shape": {"s": np.zeros(3)},
        r"steps/s\[1\]: nan": {"s": np.array([0.0, np.nan])},
        "steps/s: must be an array of numbers": {"s": np.array(["a", "b"])},
    }.items():
        with pytest.raises(FormatError, match=message):
            check(estimates(steps=steps))
    with pytest.raises(FormatError, match="provenance: names no estimator"):
        check(estimates(meta=Meta("log")))
    with pytest.raises(FormatError, match=re.escape("distance[0]: -1.0 is negative")):
        bad = uwb(rows={"distance": np.array([-1.0, 0.0, 0.0])})
        check(estimates(recording=recording(streams={"uwb": bad})))


def test_extreme_times_are_compared_without_overflow():
    ends = np.iinfo(np.int64)
    time = np.array([ends.min, 0, ends.max])
    check_stream(uwb(time_ns=time), SENSORS, "uwb")
    with pytest.raises(FormatError, match=r"time_ns\[1\]"):
        check_stream(uwb(time_ns=time[::-1].copy()), SENSORS, "uwb")
