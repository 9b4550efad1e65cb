"""What importers of radars share: files as they stand, scans as a stream, views, poses, truth."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ....models.errors import FormatError
from ....models.geometry.poses import yaw_quaternion
from ....models.records import Array, Objects, Stream

VIEW = ("view_azimuth_min", "view_azimuth_max", "view_range_min", "view_range_max")


def read_bytes(path: Path) -> bytes:
    """The content of a file.

    Raises
    ------
    FormatError : it cannot be read
    """
    try:
        return path.read_bytes()
    except OSError as error:
        raise FormatError(path, "", error.strerror or str(error)) from error


def provenance(path: Path, data: bytes) -> dict[str, str]:
    """Name and digest of a file."""
    return {"name": path.name, "sha256": hashlib.sha256(data).hexdigest()}


def stream(
    name: str,
    kind: str,
    time_ns: Sequence[int],
    scans: Sequence[Mapping[str, Array]],
    columns: Sequence[str],
    view: tuple[float, float],
    model: Mapping[str, Any],
) -> Stream:
    """The ``scans``, each with its ``columns``, in the order of their times.

    ``view`` is half the width of the view [rad] and the farthest range [m]; 0 where that is not
    known. It is widened to what was seen, since noise carries points over its borders.
    """
    time = np.array(time_ns, np.int64)
    order = np.argsort(time, kind="stable")
    counts = [len(scans[k][columns[0]]) for k in order.tolist()]
    offset = np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
    rows = {
        column: np.concatenate([np.zeros(0), *(scans[k][column] for k in order.tolist())])
        for column in columns
    }
    if "origin_id" in rows:
        rows["origin_id"] = rows["origin_id"].astype(np.int32)
    scan = {key: np.full(len(time), value) for key, value in _view(rows, view).items()}
    return Stream(kind, (name,), dict(model), time[order], offset, scan, rows)


def _view(rows: Mapping[str, Array], view: tuple[float, float]) -> dict[str, float]:
    half, far = view
    if "range" in rows:
        distance, azimuth = rows["range"], rows["azimuth"]
    else:
        distance = np.hypot(np.hypot(rows["x"], rows["y"]), rows.get("z", 0.0))
        azimuth = np.arctan2(rows["y"], rows["x"])
    found: dict[str, float] = {}
    if half:
        half = min(max(half, float(np.abs(azimuth).max(initial=0.0))), np.pi)
        found |= {VIEW[0]: -half, VIEW[1]: half}
    if far:
        found |= {VIEW[2]: 0.0, VIEW[3]: max(far, float(distance.max(initial=0.0)))}
    return found


def square_metres(decibels: Array) -> Array:
    """A radar cross-section [m2] from dBsm; infinite where that is too large for a number."""
    with np.errstate(over="ignore"):
        return np.asarray(10.0 ** (np.asarray(decibels, float) / 10.0))


def mounted(place: Array, yaw: Array, mount: tuple[float, float, float]) -> tuple[Array, Array]:
    """Positions (n, 3) and quaternions (n, 4) of a sensor on a body in the plane.

    The body is at ``place`` (n, 2), turned by ``yaw`` (n,); ``mount`` is x, y and yaw on it.
    """
    x, y, turn = mount
    c, s = np.cos(yaw), np.sin(yaw)
    at = np.column_stack([c * x - s * y, s * x + c * y]) + place
    return np.column_stack([at, np.zeros(len(at))]), yaw_quaternion(yaw + turn)


@dataclass(frozen=True, slots=True)
class Box:
    """An object at one time: its track, class, centre (3,) [m], length and width [m], yaw [rad]."""

    track: str
    kind: str
    centre: tuple[float, float, float]
    size: tuple[float, float]
    yaw: float


def boxes(found: Mapping[int, Sequence[Box]]) -> Objects:
    """Objects at times [ns], by track numbered in the order in which they come; none is a set, too.

    Raises
    ------
    ValueError : a track is there twice at one time
    """
    times = sorted(found)
    flat = [box for t in times for box in found[t]]
    tracks: dict[str, int] = {}
    for box in flat:
        tracks.setdefault(box.track, len(tracks))
    for t in times:
        names = [box.track for box in found[t]]
        if len(set(names)) < len(names):
            twice = next(name for name in names if names.count(name) > 1)
            raise ValueError(f"the track {twice[:40]!r} is there twice at {t} ns")
    kinds = tuple(sorted({box.kind for box in flat}))
    m = len(flat)
    return Objects(
        np.array(times, np.int64),
        np.concatenate([[0], np.cumsum([len(found[t]) for t in times])]).astype(np.int64),
        np.array([tracks[box.track] for box in flat], np.int64),
        ("x", "y", "z"),
        ("m", "m", "m"),
        np.array([box.centre for box in flat], float).reshape(m, 3),
        class_names=kinds,
        class_index=np.array([kinds.index(box.kind) for box in flat], np.int64),
        extent_kind="rectangle",
        semi_axes=np.array([box.size for box in flat], float).reshape(m, 2) / 2,
        rotation=np.array([box.yaw for box in flat], float),
    )
