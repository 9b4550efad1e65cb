"""What every record must satisfy before anything else trusts it.

All readers and writers call :func:`check`; a reader that streams calls :func:`check_stream` and
:func:`check_objects` on the parts. Each check looks at whole arrays at once and names the first
value that breaks the rule, as ``streams/uwb/rows/distance[12]``.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

import numpy as np

from .columns import ACTIVE, COLUMNS, PASSIVE, REQUIRED, STREAM_KINDS, Column
from .place import Place
from .radar.checks import check_detections
from .records import Array, Estimates, Model, Objects, Recording, Sensor, Stream, Truth

NAME = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_.+-]*")
"""What sensors and streams may be called: safe in paths, topics and HDF5."""
SENSOR_KINDS = ("radar", "anchor", "device")
EXTENT_AXES = {"circle": 2, "ellipse": 2, "rectangle": 2, "ellipsoid": 3}
"""Extent kinds and the number of their semi-axes; with three, the rotation is a quaternion."""


def check(record: Recording | Estimates, path: object = "recording") -> None:
    """Raise :class:`FormatError` with the first place where ``record`` breaks its contract.

    ``path`` is what messages call the record: the name of its file. Shapes, dtypes and meaning are
    those of :mod:`echoset.models.records` and :mod:`echoset.models.columns`.
    """
    if isinstance(record, Estimates):
        if not isinstance(record.meta.provenance.get("estimator"), str):
            Place(path, "provenance").fail("names no estimator")
        check_objects(record.objects, "objects", path)
        check_steps(record.steps, len(record.objects.time_ns), path)
        if record.recording is not None:
            check(record.recording, path)
        return
    for name in (*record.sensors, *record.streams):
        if not NAME.fullmatch(name):
            Place(path, "").fail(f"{name!r} is not a legal name")
    for name, sensor in record.sensors.items():
        _check_sensor(sensor, Place(path, f"sensors/{name}"))
    for name, stream in record.streams.items():
        check_stream(stream, record.sensors, name, path)
    if record.truth is not None:
        check_truth(record.truth, record, path)


def check_stream(
    stream: Stream,
    sensors: Mapping[str, Sensor],
    name: str,
    path: object = "recording",
    after: int | None = None,
) -> None:
    """The part of :func:`check` for one stream among ``sensors``.

    It may be a part of one; ``after`` is then the time of the last scan of the part before.
    """
    at = Place(path, f"streams/{name}")
    (at / "kind").choice(stream.kind, STREAM_KINDS)
    _check_nodes(stream, sensors, at / "nodes")
    _check_model(stream.model, at / "model")
    n, m = _check_index(stream.time_ns, stream.row_offset, at)
    _check_follows(stream, after, at / "time_ns")
    for group, length in (("scan", n), ("rows", m)):
        level = "scan" if group == "scan" else "row"
        (at / group).group(getattr(stream, group))
        for key, values in getattr(stream, group).items():
            if key not in COLUMNS or COLUMNS[key].level != level:
                (at / group / key).fail(f"not a known {level} column")
            _check_column(values, COLUMNS[key], length, at / group / key)
    for key in REQUIRED[stream.kind]:
        if key not in stream.scan and key not in stream.rows:
            at.fail(f"column {key!r} is missing")
    if stream.kind == "uwb":
        nodes = [sensors[node].kind for node in stream.nodes]
        mode, tx, rx = (stream.scan[key] for key in ("mode", "tx", "rx"))
        _check_links(mode, tx, rx, nodes, at / "scan")
    else:
        check_detections(stream, at)


def check_objects(objects: Objects, place: str, path: object = "recording") -> None:
    """The part of :func:`check` for one set of objects, called ``place``."""
    at, o = Place(path, place), objects
    _, m = _check_index(o.time_ns, o.row_offset, at)
    names, dx = o.state_names, len(o.state_names)
    (at / "state_names").words(names)
    (at / "state_units").words(o.state_units, unique=False)
    if len(o.state_units) != dx:
        (at / "state_units").fail(f"has {len(o.state_units)} units for {dx} names")
    (at / "state").array(o.state, "f8", (m, dx))
    label = (at / "label").array(o.label, "i8", (m,))
    step = np.repeat(np.arange(len(o.time_ns)), np.diff(o.row_offset))
    order = np.lexsort((label, step))
    again = np.zeros(m, bool)
    before, after = order[:-1], order[1:]
    again[after] = (label[after] == label[before]) & (step[after] == step[before])
    (at / "label").none(again, label, "occurs twice at one time")
    if o.covariance is not None:
        place_ = at / "covariance"
        P = place_.array(o.covariance, "f8", (m, dx, dx))
        scale = 1e-9 * np.abs(P).max(axis=(1, 2), keepdims=True, initial=0.0)
        place_.none(np.abs(P - P.swapaxes(1, 2)) > scale, P, "is not symmetric")
        variance = np.diagonal(P, axis1=1, axis2=2)
        place_.none(variance < 0, variance, "is a negative variance")
    if o.existence is not None:
        (at / "existence").probability(o.existence, (m,))
    _check_classes(o, m, at)
    _check_extent(o, m, at)


def check_steps(steps: Mapping[str, Array], n: int, path: object = "recording") -> None:
    """The part of :func:`check` for the values per step of ``n`` estimates."""
    Place(path, "steps").group(steps)
    for key, values in steps.items():
        at = Place(path, f"steps/{key}")
        if not isinstance(values, np.ndarray) or values.dtype.kind not in "biuf":
            at.fail("must be an array of numbers")
        if values.shape[:1] != (n,):
            at.fail(f"has shape {values.shape}, needs {n} steps")
        at.finite(values)


def _check_sensor(sensor: Sensor, at: Place) -> None:
    (at / "kind").choice(sensor.kind, SENSOR_KINDS)
    if isinstance(sensor.object, bool) or not isinstance(sensor.object, int) or sensor.object < -1:
        (at / "object").fail(f"{sensor.object!r} is neither a label nor -1")
    k = len(sensor.time_ns) if isinstance(sensor.time_ns, np.ndarray) and sensor.time_ns.ndim else 0
    time = (at / "time_ns").array(sensor.time_ns, "i8", (k,))
    (at / "time_ns").increasing(time, strictly=True)
    (at / "position").array(sensor.position, "f8", (k, 3))
    (at / "quaternion").unit((at / "quaternion").array(sensor.quaternion, "f8", (k, 4)))
    if k == 0 and sensor.kind != "device":
        at.fail(f"the {sensor.kind} has no position")


def _check_nodes(stream: Stream, sensors: Mapping[str, Sensor], at: Place) -> None:
    nodes = stream.nodes
    at.words(nodes)
    for node in nodes:
        if node not in sensors:
            at.fail(f"{node!r} is not a sensor")
    kinds = [sensors[node].kind for node in nodes]
    if stream.kind == "uwb":
        if "radar" in kinds:
            at.fail(f"{nodes[kinds.index('radar')]!r} is a radar, not a UWB node")
        if "anchor" not in kinds:
            at.fail("anchors missing: none of the nodes is an anchor with a known position")
    elif kinds != ["radar"]:
        at.fail(f"a stream of kind {stream.kind!r} needs one radar, got {' '.join(kinds) or None}")


def _check_model(model: Model, at: Place) -> None:
    at.group(model)
    for key, value in model.items():
        if isinstance(value, str | bool):
            continue
        try:
            values = np.asarray(value)
        except ValueError:
            (at / key).fail("is a ragged list")
        if values.dtype.kind not in "biuf":
            (at / key).fail(f"{value!r} is neither a number, a text nor a list of numbers")
        (at / key).none(~np.isfinite(np.atleast_1d(values)), np.atleast_1d(values), "is not finite")


def _check_index(time_ns: Array, row_offset: Array, at: Place) -> tuple[int, int]:
    """Number of times and of rows of a ragged table."""
    n = len(time_ns) if isinstance(time_ns, np.ndarray) and time_ns.ndim else 0
    (at / "time_ns").increasing((at / "time_ns").array(time_ns, "i8", (n,)), strictly=False)
    offset = (at / "row_offset").array(row_offset, "i8", (n + 1,))
    if offset[0] != 0:
        (at / "row_offset").fail(f"{offset[0]} is not 0", 0)
    (at / "row_offset").increasing(offset, strictly=False)
    return n, int(offset[-1])


def _check_follows(stream: Stream, after: int | None, at: Place) -> None:
    """No part goes back in time, and no radar scans twice at one time."""
    time = stream.time_ns
    if len(time) and after is not None and time[0] < after:
        at.fail(f"{time[0]} is out of order after {after}", 0)
    if stream.kind != "uwb" and len(time):
        again = np.concatenate(([time[0] == after], time[1:] == time[:-1]))
        at.none(again, time, "is the time of a second scan")


def _check_column(values: Any, column: Column, length: int, at: Place) -> None:
    tail = np.shape(values)[1:] if column.axes else ()
    if len(tail) != column.axes:
        at.fail(f"has {len(tail)} axes a scan, needs {column.axes}")
    a = at.array(values, column.dtype, (length, *tail), column.missing)
    if column.minimum == 0:
        at.none(a < 0, a, "is negative")
    if column.flags:
        codes = ", ".join(f"{i} {flag}" for i, flag in enumerate(column.flags))
        at.none(a >= len(column.flags), a, f"is not a code ({codes})")


def _check_links(mode: Array, tx: Array, rx: Array, kinds: list[str], at: Place) -> None:
    """Active links go from a device to an anchor, passive ones from an anchor to an anchor."""
    for key, node in (("tx", tx), ("rx", rx)):
        (at / key).none(
            (node < 0) | (node >= len(kinds)), node, f"is not one of {len(kinds)} nodes"
        )
    anchor = np.array([kind == "anchor" for kind in kinds], bool)
    (at / "rx").none(~anchor[rx], rx, "is not an anchor")
    (at / "tx").none((mode == ACTIVE) & anchor[tx], tx, "is not a device, yet the link is active")
    (at / "tx").none((mode == PASSIVE) & ~anchor[tx], tx, "is a device, yet the link is passive")


def _check_classes(o: Objects, m: int, at: Place) -> None:
    names, index = o.class_names, o.class_index
    (at / "class_names").words(names)
    if index is not None:
        if not isinstance(index, np.ndarray) or index.dtype.kind not in "iu":
            (at / "class_index").fail("must be an array of integers")
        (at / "class_index").array(index, index.dtype.str, (m,))
        bad = (index < 0) | (index >= len(names))
        (at / "class_index").none(bad, index, f"is not one of {len(names)} classes")
    if o.class_probability is not None:
        (at / "class_probability").probability(o.class_probability, (m, len(names)))


def _check_extent(o: Objects, m: int, at: Place) -> None:
    if o.extent_kind == "":
        if o.semi_axes is not None or o.rotation is not None:
            (at / "extent_kind").fail("is empty, yet there are semi-axes or rotations")
        return
    (at / "extent_kind").choice(o.extent_kind, EXTENT_AXES)
    k = EXTENT_AXES[o.extent_kind]
    axes = (at / "semi_axes").array(o.semi_axes, "f8", (m, k))
    (at / "semi_axes").none(axes <= 0, axes, "is not positive")
    rotation = (at / "rotation").array(o.rotation, "f8", (m,) if k == 2 else (m, 4))
    if k == 3:
        (at / "rotation").unit(rotation)


def check_truth(truth: Truth, recording: Recording, path: object = "recording") -> None:
    """The part of :func:`check` for the truth of a recording."""
    at = Place(path, "truth")
    check_objects(truth.objects, "truth/objects", path)
    (at / "objects/time_ns").increasing(truth.objects.time_ns, strictly=True)
    at = at / "blocked"
    time = truth.blocked_time_ns
    b = len(time) if isinstance(time, np.ndarray) and time.ndim else 0
    (at / "time_ns").increasing((at / "time_ns").array(time, "i8", (b,)), strictly=False)
    tx = (at / "tx").array(truth.blocked_tx, "i4", (b,))
    rx = (at / "rx").array(truth.blocked_rx, "i4", (b,))
    networks = [s for s in recording.streams.values() if s.kind == "uwb"]
    nodes = [recording.sensors[n].kind for s in networks[:1] for n in s.nodes]
    _check_links(np.full(b, ACTIVE), tx, rx, nodes, at)
