"""What the detections of a radar must satisfy beside the rules for all columns.

A field of view tells which targets a radar may detect. The noise carries what it measures of them
over the bounds, so a detection may stand as far outside as the noise that the rows or the model
state explains; where nothing is stated, as far as rounding does. So it is with radial speeds and
``doppler_max``: those that differ by twice as much are one and the same to the radar.
"""

from __future__ import annotations

from math import pi

import numpy as np

from ..records import Array, Stream
from ..where import Where, indefinite

PLANE = ("cov_xx", "cov_xy", "cov_yy")
SPACE = (*PLANE, "cov_xz", "cov_yz", "cov_zz")
ROUNDING = 1e-3
"""How far outside its view [m, rad] a detection may stand, its numbers having been rounded; and
how far from even, in steps, the axis of a map may be."""
SPREAD = 6.0
"""Standard deviations of the noise that it may stand outside."""


def check_detections(stream: Stream, at: Where) -> None:
    """Raise :class:`FormatError` unless covariances are such and the views hold the detections.

    Maps must have their axes.

    ``stream`` is one of a radar, its columns sound one by one.
    """
    if any(key in stream.rows for key in SPACE):
        _check_covariance(stream, at)
    if any(f"{key}_table" in stream.model for key in SPACE):
        _check_tables(stream, at / "model")
    if any(key.startswith("view_") for key in stream.scan):
        _check_view(stream, at)
    if "doppler_max" in stream.model:
        _check_doppler(stream, at)
    if stream.kind == "range_angle_map":
        _check_axes(stream, at)


def _check_covariance(stream: Stream, at: Where) -> None:
    """All entries there, and positive definite: by Sylvester's criterion on the correlations."""
    rows = stream.rows
    solid = any(key in rows for key in SPACE[3:])
    for key in (*SPACE, "z") if solid else PLANE:
        if key not in rows:
            at.fail(f"column {key!r} is missing")
    std = {a: np.sqrt(np.maximum(rows[f"cov_{a}{a}"], 0.0)) for a in ("xyz" if solid else "xy")}
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        xy = rows["cov_xy"] / std["x"] / std["y"]
        good = (std["x"] > 0) & (std["y"] > 0) & (np.abs(xy) < 1)
        if solid:
            xz, yz = rows["cov_xz"] / std["x"] / std["z"], rows["cov_yz"] / std["y"] / std["z"]
            good &= (std["z"] > 0) & (1 + 2 * xy * xz * yz - xy**2 - xz**2 - yz**2 > 0)
    reason = "begins a covariance that is not positive definite"
    (at / "rows/cov_xx").none(~good, rows["cov_xx"], reason)


def _check_tables(stream: Stream, at: Where) -> None:
    """All tables of a covariance there, of one shape, and positive semidefinite at every node.

    What a node has that no sensor sees may be zero.
    """
    names = [f"{key}_table" for key in SPACE]
    names = names if any(name in stream.model for name in names[3:]) else names[:3]
    tables = []
    for name in names:
        if name not in stream.model:
            at.fail(f"{name!r} is missing")
        tables.append(np.asarray(stream.model[name]))
        if tables[-1].dtype.kind not in "iuf" or tables[-1].shape != tables[0].shape:
            (at / name).fail(f"must be numbers in the shape {tables[0].shape} of {names[0]}")
    xx, xy, yy, *more = (np.asarray(t, float) for t in tables)
    zero = np.zeros_like(xx)
    xz, yz, zz = more or (zero, zero, zero)
    P = np.stack([xx, xy, xz, xy, yy, yz, xz, yz, zz], -1).reshape(*xx.shape, 3, 3)
    (at / names[0]).none(indefinite(P), xx, "begins a covariance that is not semidefinite")


def _check_view(stream: Stream, at: Where) -> None:
    """Bounds in order, and every detection inside those of its scan."""
    n, counts = len(stream), np.diff(stream.row_offset)

    def bound(key: str, default: float) -> Array:
        return stream.scan.get(f"view_{key}", np.full(n, default))

    near, far = bound("range_min", 0.0), bound("range_max", np.inf)
    first, last = bound("azimuth_min", -pi), bound("azimuth_max", pi)
    (at / "scan/view_range_max").none(far < near, far, "is below the nearest range")
    if len(stream.rows) == 0:
        return
    distance, azimuth, keys = _polar(stream)
    slack, slip = _slack(stream, distance)
    beyond = (distance < np.repeat(near, counts) - slack) | (
        distance > np.repeat(far, counts) + slack
    )
    (at / f"rows/{keys[0]}").none(beyond, stream.rows[keys[0]], "is out of range of the view")
    width = np.where(last >= first, last - first, (last - first) % (2 * pi))
    turn = (azimuth - np.repeat(first, counts) + slip) % (2 * pi)
    beside = turn > np.repeat(width, counts) + 2 * slip
    (at / f"rows/{keys[1]}").none(beside, stream.rows[keys[1]], "is beside the view's azimuths")


def _check_doppler(stream: Stream, at: Where) -> None:
    """Radial speeds as the radar tells them apart, from ``-doppler_max`` to ``doppler_max``."""
    most = float(stream.model["doppler_max"])
    if most <= 0:
        (at / "model/doppler_max").fail(f"{most!r} is not positive")
    if "doppler" in stream.rows:
        speed = stream.rows["doppler"]
        slack = ROUNDING + SPREAD * float(stream.model.get("std_doppler", 0.0))
        (at / "rows/doppler").none(np.abs(speed) > most + slack, speed, "is beyond doppler_max")


def _check_axes(stream: Stream, at: Where) -> None:
    """Both axes of a map: even steps upwards, as many values as the map has along them."""
    shape = []
    for name, limit in (("range_axis", np.inf), ("azimuth_axis", 2 * pi)):
        place = at / "model" / name
        if name not in stream.model:
            place.fail("is missing: where do the cells of the map lie?")
        axis = np.asarray(stream.model[name])
        if axis.ndim != 1 or len(axis) < 2 or axis.dtype.kind not in "iuf":
            place.fail("must be a list of two or more numbers")
        axis = axis.astype(float)
        place.increasing(axis, strictly=True)
        even = np.linspace(axis[0], axis[-1], len(axis))
        place.none(np.abs(axis - even) > ROUNDING * (even[1] - even[0]), axis, "breaks even steps")
        if axis[-1] - axis[0] > limit + ROUNDING:
            place.fail("goes round more than once")
        shape.append(len(axis))
    if stream.model["range_axis"][0] < 0:
        (at / "model/range_axis").fail(f"{stream.model['range_axis'][0]!r} is negative", 0)
    if stream.scan["map"].shape[1:] != tuple(shape):
        (at / "scan/map").fail(f"is {stream.scan['map'].shape[1:]} a scan, the axes {tuple(shape)}")


def _polar(stream: Stream) -> tuple[Array, Array, tuple[str, str]]:
    """Ranges and azimuths of the detections, and the columns that say so."""
    rows = stream.rows
    if stream.kind == "range_bearing":
        return rows["range"], rows["azimuth"], ("range", "azimuth")
    x, y = rows["x"], rows["y"]
    return np.hypot(np.hypot(x, y), rows.get("z", 0.0)), np.arctan2(y, x), ("x", "y")


def _slack(stream: Stream, distance: Array) -> tuple[Array, Array]:
    """How far outside its view [m], [rad] each detection may stand."""
    rows = stream.rows

    def std(name: str) -> Array:
        value = rows.get(name, stream.model.get(name, 0.0))
        known = np.asarray(value) if np.ndim(value) == 0 or name in rows else np.zeros(())
        return np.maximum(known.astype(float), 0.0) if known.dtype.kind in "iuf" else np.zeros(())

    if stream.kind == "range_bearing":
        both = std("std_range"), std("std_azimuth")
    else:
        each = [np.sqrt(rows[key]) for key in ("cov_xx", "cov_yy", "cov_zz") if key in rows]
        across = np.maximum.reduce(each) if each else std("std_position")
        both = across, across / np.maximum(distance, ROUNDING)
    slack, slip = (ROUNDING + SPREAD * np.broadcast_to(v, distance.shape) for v in both)
    return slack, np.minimum(slip, pi)
