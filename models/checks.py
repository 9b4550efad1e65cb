"""What every record must satisfy before anything else trusts it.

Writers call :func:`check`, readers have :class:`WindowChecks` look at each window; a whole is one
window. Each check looks at whole arrays at once and names the first value that breaks the rule, as
``streams/uwb/rows/distance[12]``. Types and shapes are those of :mod:`.columns`.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import numpy as np
from numpy.linalg import LinAlgError

from .columns import (
    ACTIVE,
    BLOCKED,
    COLUMNS,
    INTEGERS,
    MODEL,
    OBJECTS,
    PASSIVE,
    REQUIRED,
    SENSOR,
    STEPS,
    STREAM_KINDS,
    TDOA,
    Column,
    Leaf,
)
from .errors import EchosetError
from .radar.checks import check_detections
from .records import Array, Estimates, Meta, Model, Objects, Recording, Sensor, Stream, Truth
from .where import Where, indefinite

NAME = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_.+-]*")
"""What sensors and streams may be called: safe in paths, topics and HDF5."""
SENSOR_KINDS = ("radar", "anchor", "device")
EXTENT_AXES = {"circle": 2, "ellipse": 2, "rectangle": 2, "ellipsoid": 3}
"""Extent kinds and the number of their semi-axes; with three, the rotation is a quaternion."""


KEY = re.compile(r"[^\s/.\x00-\x1f\x7f-\x9f\ud800-\udfff][^/\x00-\x1f\x7f-\x9f\ud800-\udfff]*")
"""What sensor parameters and diagnostics may be called: safe in paths, topics and HDF5."""
NUMBERS = ("b1", "i1", "i2", "i4", "i8", "u1", "u2", "u4", "u8", "f4", "f8")
"""Types that all formats hold."""
EXTENT = ("semi_axes", "rotation")


def check(record: Recording | Estimates, path: object = "recording") -> None:
    """Raise :class:`FormatError` with the first place where ``record`` breaks its contract.

    ``path`` is what messages call the record: the name of its file.
    """
    WindowChecks(path).check(record)
    if isinstance(record, Estimates):
        at, name = Where(path, "provenance"), record.meta.provenance.get("estimator")
        if not isinstance(name, str) or not name:
            at.fail("names no estimator")
        _check_shown(name, at / "estimator")
        if record.recording is not None:
            check(record.recording, path)


class WindowChecks:
    """Checks the windows of one record, called ``path`` in errors: each, and that time goes on."""

    def __init__(self, path: object) -> None:
        self._path = path
        self._last: dict[str, int] = {}
        self._begun = False

    def check(self, window: Recording | Estimates) -> None:
        """Raise :class:`FormatError` where the window breaks its contract."""
        if not self._begun:
            check_meta(window.meta, self._path)
        if isinstance(window, Estimates):
            self._begun = True
            check_objects(window.objects, "objects", self._path)
            check_steps(window.steps, len(window.objects.time_ns), self._path)
            self._follow("objects", window.objects.time_ns, strictly=False)
            return
        if not self._begun:
            check_sensors(window.sensors, self._path)
            self._begun = True
        for name, stream in window.streams.items():
            place = f"streams/{name}"
            _check_name(name, "streams", self._path)
            check_stream(stream, window.sensors, name, self._path, self._last.get(place))
            self._follow(place, stream.time_ns, strictly=False)
        if window.truth is not None:
            truth = window.truth
            check_truth(truth, window, self._path)
            self._follow("truth/objects", truth.objects.time_ns, strictly=True)
            self._follow("truth/blocked", truth.blocked_time_ns, strictly=False)

    def _follow(self, place: str, time_ns: Array, strictly: bool) -> None:
        if not len(time_ns):
            return
        before = self._last.get(place)
        if before is not None and time_ns[0] < before + strictly:
            at = Where(self._path, f"{place}/time_ns")
            at.fail(f"{time_ns[0]} is out of order after {before}", 0)
        self._last[place] = int(time_ns[-1])


def check_meta(meta: Meta, path: object = "recording") -> None:
    """The part of :func:`check` for what a record is called."""
    for name in ("name", "epoch", "frame", "origin"):
        Where(path, name).text(getattr(meta, name))
    _check_shown(meta.name, Where(path, "name"))
    for key in ("parameters", "input", "versions"):
        if not isinstance(meta.provenance.get(key, {}), Mapping):
            Where(path, "provenance").fail(f"{key!r} is not an object")


def _check_shown(name: str, at: Where) -> None:
    """A name that stands in tables, where spreadsheets take what begins so for a formula."""
    at.text(name)
    if name.startswith("="):
        at.fail(f"{name[:40]!r} begins with '='")


def check_sensors(sensors: Mapping[str, Sensor], path: object = "recording") -> None:
    """The part of :func:`check` for the sensors of a recording."""
    for name, sensor in sensors.items():
        _check_name(name, "sensors", path)
        _check_sensor(sensor, Where(path, f"sensors/{name}"))


def _check_name(name: str, group: str, path: object) -> None:
    if not NAME.fullmatch(name):
        Where(path, group).fail(f"{name[:40]!r} is not a legal name")


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
    at = Where(path, f"streams/{name}")
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
        _check_differences(stream, nodes, at)
    elif stream.kind == "odometry":
        if m:
            (at / "row_offset").fail(f"odometry has no rows, yet there are {m}")
    else:
        check_detections(stream, at)


def check_objects(objects: Objects, place: str, path: object = "recording") -> None:
    """The part of :func:`check` for one set of objects, called ``place``."""
    at, o = Where(path, place), objects
    _, m = _check_index(o.time_ns, o.row_offset, at)
    names, dx = o.state_names, len(o.state_names)
    (at / "state_names").words(names)
    (at / "state_units").words(o.state_units, unique=False)
    if len(o.state_units) != dx:
        (at / "state_units").fail(f"has {len(o.state_units)} units for {dx} names")
    sizes = {"m": m, "dx": dx, "c": len(o.class_names)}
    for leaf in OBJECTS:
        values = getattr(o, leaf.name)
        if leaf.per_row and leaf.name not in EXTENT and not (leaf.optional and values is None):
            _check_array(values, leaf, sizes, at / leaf.name)
    label = o.label
    step = np.repeat(np.arange(len(o.time_ns)), np.diff(o.row_offset))
    order = np.lexsort((label, step))
    again = np.zeros(m, bool)
    before, after = order[:-1], order[1:]
    again[after] = (label[after] == label[before]) & (step[after] == step[before])
    (at / "label").none(again, label, "occurs twice at one time")
    if o.covariance is not None:
        place_, P = at / "covariance", o.covariance
        scale = 1e-9 * np.abs(P).max(axis=(1, 2), keepdims=True, initial=0.0)
        place_.none(np.abs(P - P.swapaxes(1, 2)) > scale, P, "is not symmetric")
        variance = np.diagonal(P, axis1=1, axis2=2)
        place_.none(variance < 0, variance, "is a negative variance")
        bad, reason = indefinite(P)[:, None], "begins a covariance that is not semidefinite"
        place_.none(bad, P[:, 0], reason)
    if o.existence is not None:
        (at / "existence").probability(o.existence)
    _check_classes(o, at)
    _check_extent(o, at)


def _length(values: object) -> int:
    return len(values) if isinstance(values, np.ndarray) and values.ndim else 0


def _check_array(values: Any, leaf: Leaf, sizes: Mapping[str, int], at: Where) -> None:
    """An array as it is declared, whose axes have these ``sizes``."""
    dtype = leaf.type
    shape = tuple(sizes[axis] if axis in sizes else int(axis) for axis in leaf.shape)
    if dtype == INTEGERS:
        if not _is_numbers(values) or values.dtype.kind not in "iu":
            at.fail("must be an array of integers")
        dtype = values.dtype.str
    at.array(values, dtype, shape)


def check_steps(steps: Mapping[str, Array], n: int, path: object = "recording") -> None:
    """The part of :func:`check` for the values per step of ``n`` estimates."""
    Where(path, "steps").group(steps)
    for key, values in steps.items():
        at = Where(path, f"steps/{key}")
        _check_key(key, Where(path, "steps"))
        if key in (leaf.name for leaf in OBJECTS):
            at.fail("has the name of a column of objects")
        if not _is_numbers(values):
            at.fail("must be an array of numbers")
        if values.shape[:1] != (n,):
            at.fail(f"has shape {values.shape}, needs {n} steps")
        for leaf in STEPS:
            if leaf.name == key:
                _check_array(values, leaf, {"n": n}, at)
        at.finite(values)


def _check_sensor(sensor: Sensor, at: Where) -> None:
    (at / "kind").choice(sensor.kind, SENSOR_KINDS)
    label = sensor.object
    if isinstance(label, bool) or not isinstance(label, int) or not -1 <= label < 1 << 63:
        (at / "object").fail(f"{sensor.object!r} is neither a label nor -1")
    k = _length(sensor.time_ns)
    for leaf in SENSOR:
        if leaf.shape:
            _check_array(getattr(sensor, leaf.name), leaf, {"k": k}, at / leaf.name)
    (at / "time_ns").increasing(sensor.time_ns, strictly=True)
    (at / "quaternion").unit(sensor.quaternion)
    if k == 0 and sensor.kind != "device":
        at.fail(f"the {sensor.kind} has no position")


def _check_nodes(stream: Stream, sensors: Mapping[str, Sensor], at: Where) -> None:
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
    elif stream.kind == "odometry":
        if kinds != ["device"]:
            at.fail(f"odometry is that of one device, got {' '.join(kinds) or None}")
    elif kinds != ["radar"]:
        at.fail(f"a stream of kind {stream.kind!r} needs one radar, got {' '.join(kinds) or None}")


def _check_model(model: Model, at: Where) -> None:
    at.group(model)
    for key, value in model.items():
        _check_key(key, at)
        if key in MODEL and not (np.ndim(value) == 0 and _is_numbers(np.asarray(value))):
            (at / key).fail("is not a number")
        if isinstance(value, str):
            (at / key).text(value)
        if isinstance(value, str | bool):
            continue
        try:
            values = np.asarray(value)
        except ValueError:
            (at / key).fail("is a ragged list")
        if not _is_numbers(values):
            if isinstance(value, int):
                (at / key).fail("is an integer that does not fit 8 bytes")
            (at / key).fail(f"{value!r} is neither a number, a text nor a list of numbers")
        (at / key).none(~np.isfinite(np.atleast_1d(values)), np.atleast_1d(values), "is not finite")
        if key in MODEL:
            (at / key).none(np.atleast_1d(values) < 0, np.atleast_1d(values), "is negative")


def _check_key(key: object, at: Where) -> None:
    """The name of a sensor parameter or diagnostic, which stands in paths."""
    if not isinstance(key, str) or not KEY.fullmatch(key):
        at.fail(f"{key!r} is not a legal name")


def _is_numbers(values: Any) -> bool:
    """Whether this is an array of numbers of a type that all formats hold."""
    return isinstance(values, np.ndarray) and values.dtype.str.lstrip("<|") in NUMBERS


def _check_index(time_ns: Array, row_offset: Array, at: Where) -> tuple[int, int]:
    """Number of times and of rows of a ragged table."""
    n = _length(time_ns)
    (at / "time_ns").increasing((at / "time_ns").array(time_ns, "i8", (n,)), strictly=False)
    offset = (at / "row_offset").array(row_offset, "i8", (n + 1,))
    if offset[0] != 0:
        (at / "row_offset").fail(f"{offset[0]} is not 0", 0)
    (at / "row_offset").increasing(offset, strictly=False)
    return n, int(offset[-1])


def _check_follows(stream: Stream, after: int | None, at: Where) -> None:
    """No part goes back in time, and no radar scans twice at one time."""
    time = stream.time_ns
    if len(time) and after is not None and time[0] < after:
        at.fail(f"{time[0]} is out of order after {after}", 0)
    if stream.kind != "uwb" and len(time):
        again = np.concatenate(([time[0] == after], time[1:] == time[:-1]))
        at.none(again, time, "is the time of a second scan")


def _check_column(values: Any, column: Column, length: int, at: Where) -> None:
    tail = np.shape(values)[1:] if column.axes else ()
    if len(tail) != column.axes:
        at.fail(f"has {len(tail)} axes a scan, needs {column.axes}")
    a = at.array(values, column.dtype, (length, *tail), column.missing)
    if column.minimum == 0:
        at.none(a < 0, a, "is negative")
    if column.flags:
        codes = ", ".join(f"{i} {flag}" for i, flag in enumerate(column.flags))
        at.none(a >= len(column.flags), a, f"is not a code ({codes})")


def _check_links(mode: Array, tx: Array, rx: Array, kinds: list[str], at: Where) -> None:
    """Active links go from a device to an anchor, passive ones from an anchor to an anchor."""
    for key, node in (("tx", tx), ("rx", rx)):
        (at / key).none(
            (node < 0) | (node >= len(kinds)), node, f"is not one of {len(kinds)} nodes"
        )
    anchor = np.array([kind == "anchor" for kind in kinds], bool)
    (at / "rx").none(~anchor[rx], rx, "is not an anchor")
    (at / "tx").none((mode == ACTIVE) & anchor[tx], tx, "is not a device, yet the link is active")
    (at / "tx").none((mode == PASSIVE) & ~anchor[tx], tx, "is a device, yet the link is passive")
    (at / "tx").none((mode == TDOA) & anchor[tx], tx, "is not a device, yet the link is tdoa")


def _check_differences(stream: Stream, kinds: list[str], at: Where) -> None:
    """Differences name the anchor that they are taken from; nothing else is negative."""
    difference = stream.scan["mode"] == TDOA
    reference = stream.scan.get("reference")
    if reference is None:
        if difference.any():
            (at / "scan").fail("column 'reference' is missing, yet there are tdoa events")
    else:
        own, of = at / "scan/reference", np.where(difference, reference, 0)
        own.none((of < 0) | (of >= len(kinds)), of, f"is not one of {len(kinds)} nodes")
        anchor = np.array([kind == "anchor" for kind in kinds], bool)
        own.none(difference & ~anchor[of], of, "is not an anchor")
        own.none(difference & (of == stream.scan["rx"]), of, "is the anchor itself")
        own.none(~difference & (reference != -1), reference, "is not -1, yet no tdoa event")
    of_rows = np.repeat(difference, np.diff(stream.row_offset))
    distance = stream.rows["distance"]
    (at / "rows/distance").none((distance < 0) & ~of_rows, distance, "is negative")


def _check_classes(o: Objects, at: Where) -> None:
    names, index = o.class_names, o.class_index
    (at / "class_names").words(names)
    if index is not None:
        bad = (index < 0) | (index >= len(names))
        (at / "class_index").none(bad, index, f"is not one of {len(names)} classes")
    if o.class_probability is not None:
        (at / "class_probability").probability(o.class_probability)


def _check_extent(o: Objects, at: Where) -> None:
    if o.extent_kind == "":
        if o.semi_axes is not None or o.rotation is not None:
            (at / "extent_kind").fail("is empty, yet there are semi-axes or rotations")
        return
    (at / "extent_kind").choice(o.extent_kind, EXTENT_AXES)
    m, flat = len(o.label), EXTENT_AXES[o.extent_kind] == 2
    axes = (at / "semi_axes").array(o.semi_axes, "f8", (m, EXTENT_AXES[o.extent_kind]))
    (at / "semi_axes").none(axes <= 0, axes, "is not positive")
    rotation = (at / "rotation").array(o.rotation, "f8", (m,) if flat else (m, 4))
    if not flat:
        (at / "rotation").unit(rotation)


def check_truth(truth: Truth, recording: Recording, path: object = "recording") -> None:
    """The part of :func:`check` for the truth of a recording."""
    at = Where(path, "truth")
    check_objects(truth.objects, "truth/objects", path)
    (at / "objects/time_ns").increasing(truth.objects.time_ns, strictly=True)
    at = at / "blocked"
    time = truth.blocked_time_ns
    for leaf in BLOCKED:
        values = getattr(truth, f"blocked_{leaf.name}")
        _check_array(values, leaf, {"b": _length(time)}, at / leaf.name)
    (at / "time_ns").increasing(time, strictly=False)
    tx, rx = truth.blocked_tx, truth.blocked_rx
    networks = [s for s in recording.streams.values() if s.kind == "uwb"]
    nodes = [recording.sensors[n].kind for s in networks[:1] for n in s.nodes]
    _check_links(np.full(len(time), ACTIVE), tx, rx, nodes, at)


_OUT_OF_RANGE = re.compile(
    "too large|cannot convert (float|complex)|infs or NaNs|negative dimensions|scale < 0|Singular"
    "|not positive definite|did not converge|low >= high|range exceeds valid bounds"
)


@contextmanager
def in_range(kind: type[EchosetError], place: str) -> Iterator[None]:
    """Raise a ``kind`` that names the ``place`` for errors of arithmetic, NumPy's among them.

    Such errors are what Python and its libraries make of numbers that are too large or too small.
    """
    try:
        with np.errstate(over="raise", invalid="raise", divide="raise"):
            yield
    except (ArithmeticError, ValueError) as error:
        known = ArithmeticError | LinAlgError
        if not (isinstance(error, known) or _OUT_OF_RANGE.search(str(error))):
            raise
        raise kind(f"{place}: {error}") from error
