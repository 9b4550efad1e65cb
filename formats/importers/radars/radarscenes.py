"""Importer of RadarScenes: four radars of a car, its odometry, and points labelled by track.

Schumann et al., RadarScenes: a real-world radar point cloud data set for automotive applications,
FUSION 2021. A sequence is a folder with ``radar_data.h5``, whose compound datasets are read by the
names of their fields::

    radar_data: timestamp [us] sensor_id range_sc [m] azimuth_sc [rad] rcs [dBsm] vr [m/s]
                track_id label_id (and others)
    odometry: timestamp [us] x_seq y_seq [m] yaw_seq [rad] (and others)

and ``scenes.json``, which lists the scans: the time of each, its sensor and its rows, none if it
saw nothing. ``sensors.json`` in the folder above tells where the radars are; without it they are
where the set's documentation says. Each radar is a stream ``radar_1`` to ``radar_4`` with its pose
in the frame of the sequence; azimuths turn to the left and ``vr`` is positive when receding, the
car's own speed in it, as our columns say.

The truth is what the labels tell: at each scan the objects of which it has points, at the middle of
these in the plane, which lies on the side that the radar sees. ``origin_id`` of a point is the
number of its object, -1 without a track.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from ....models.checks import check
from ....models.errors import FormatError, InputError
from ....models.parameters import as_dict, parameter
from ....models.records import Array, Meta, Objects, Recording, Sensor, Truth
from ...damage import damage
from ...plain_json import parse
from ..text import read_text
from .scans import mounted, provenance, read_bytes, square_metres, stream

SUMMARY = "four radars of a car and their labelled points: a sequence of RadarScenes"
MOUNTS = {
    1: (3.663, -0.873, -1.48418552),
    2: (3.86, -0.70, -0.436185662),
    3: (3.86, 0.70, 0.436),
    4: (3.663, 0.873, 1.484),
}
"""x, y [m] and yaw [rad] of the radars on the car, from the middle of its rear axle."""
CLASSES = (
    "car", "large_vehicle", "truck", "bus", "train", "bicycle", "motorized_two_wheeler",
    "pedestrian", "pedestrian_group", "animal", "other", "static",
)  # fmt: skip
_NEEDED = {
    "radar_data": ("range_sc", "azimuth_sc", "rcs", "vr", "track_id", "label_id"),
    "odometry": ("timestamp", "x_seq", "y_seq", "yaw_seq"),
}
_LARGEST = 1 << 33
"""Bytes that a dataset may have."""


@dataclass(frozen=True, slots=True)
class Params:
    """What the files leave open."""

    half_view: float = parameter(
        60.0, "deg", "half the width of the fields of view", within="[0, 180]"
    )
    max_range: float = parameter(
        100.0, "m", "range of the fields of view; 0: not known", within="[0, inf)"
    )


def recognises(path: Path, head: bytes) -> bool:
    """Whether a folder is a sequence, or a file its data."""
    if path.is_dir():
        return (path / "radar_data.h5").is_file()
    return path.name == "radar_data.h5"


def read(paths: Sequence[Path], params: Params) -> Recording:
    """The recording in the folder of one sequence, or in its ``radar_data.h5``.

    Raises
    ------
    FormatError : a file is unreadable or breaks the format
    InputError : it is not one sequence
    """
    if len(paths) != 1:
        raise InputError("radarscenes reads one sequence, a folder")
    folder = paths[0] if paths[0].is_dir() else paths[0].parent
    data = folder / "radar_data.h5"
    listed = read_text(folder / "scenes.json", of_lines=False)
    points, odometry = _tables(data)
    scenes = parse(listed.text, listed.path)
    with damage(listed.path, "scenes"):
        scans = {int(t): _scene(t, s, len(points)) for t, s in scenes["scenes"].items()}
    files = [provenance(data, read_bytes(data)), listed.provenance]
    mounts = _mounts(folder.parent / "sensors.json", files)
    tracks = _tracks(points)
    view = np.radians(params.half_view), params.max_range
    sensors, streams = {}, {}
    rows = _rows(points, tracks)
    for number in sorted({s for s, _, _ in scans.values()}):
        if number not in mounts:
            raise FormatError(listed.path, "scenes", f"sensor {number} is not one of the car")
        name = f"radar_{number}"
        own = {t: slice(a, b) for t, (s, a, b) in scans.items() if s == number}
        made = [{k: v[part] for k, v in rows.items()} for part in own.values()]
        times = [t * 1000 for t in own]
        streams[name] = stream(name, "range_bearing", times, made, list(rows), view, {})
        sensors[name] = Sensor("radar", odometry[0], *mounted(*odometry[1:], mounts[number]))
    meta = Meta(
        str(scenes.get("sequence_name") or folder.name),
        frame="sequence",
        provenance={"importer": "radarscenes", "files": files, "parameters": as_dict(params)},
    )
    truth = _truth(points, odometry, scans, mounts, tracks)
    recording = Recording(meta, sensors, streams, Truth(truth))
    check(recording, folder)
    return recording


def _scene(time: str, scene: Any, rows: int) -> tuple[int, int, int]:
    """Sensor, first row and the row behind the last of a scan."""
    first, stop = (int(k) for k in scene["radar_indices"])
    if not 0 <= first <= stop <= rows:
        raise ValueError(f"scene {time}: rows {first} to {stop} are not among {rows}")
    return int(scene["sensor_id"]), first, stop


def _tables(path: Path) -> tuple[Array, tuple[Array, Array, Array]]:
    """The points, and times [ns], places (n, 2) and yaws (n,) of the car."""
    place = "superblock"
    with damage(path, lambda: place), h5py.File(path, "r") as file:
        found = {}
        for place, fields in _NEEDED.items():
            data = (
                file.get(place)
                if isinstance(file.get(place, getlink=True), h5py.HardLink)
                else None
            )
            if not isinstance(data, h5py.Dataset) or data.dtype.names is None or data.ndim != 1:
                raise ValueError("is missing, or no table")
            if data.nbytes > _LARGEST or data.external or data.is_virtual:
                raise ValueError("is too large, or lies in other files")
            for name in fields:
                if name not in data.dtype.names:
                    raise ValueError(f"has no field {name}")
            found[place] = data[:]
        table = found["odometry"]
        time, last = np.unique(table["timestamp"].astype(np.int64)[::-1], return_index=True)
        table = table[::-1][last]
        if not len(time):
            raise ValueError("has no rows")
        xy = np.column_stack([table["x_seq"], table["y_seq"]]).astype(float)
        return found["radar_data"], (time * 1000, xy, table["yaw_seq"].astype(float))


def _mounts(path: Path, files: list[dict[str, str]]) -> Mapping[int, tuple[float, float, float]]:
    """Where the radars are on the car."""
    if not path.is_file():
        return MOUNTS
    file = read_text(path, of_lines=False)
    files.append(file.provenance)
    told = parse(file.text, path)
    with damage(path, "radars"):
        return {
            int(name.removeprefix("radar_")): (float(m["x"]), float(m["y"]), float(m["yaw"]))
            for name, m in told.items()
            if name.startswith("radar_")
        }


def _tracks(points: Array) -> Array:
    """The number of the track of each point, in the order in which they come, -1 without one."""
    names, first, which = np.unique(points["track_id"], return_index=True, return_inverse=True)
    known = np.array([bool(name) for name in names.tolist()], bool)
    order = np.full(len(names), len(points))
    order[known] = first[known]
    number = np.full(len(names), -1, np.int64)
    number[np.argsort(order, kind="stable")[: known.sum()]] = np.arange(known.sum())
    return np.asarray(number[which.reshape(-1)])


def _rows(points: Array, tracks: Array) -> dict[str, Array]:
    names = {"range": "range_sc", "azimuth": "azimuth_sc", "doppler": "vr"}
    rows = {column: points[field].astype(float) for column, field in names.items()}
    return {**rows, "rcs": square_metres(points["rcs"]), "origin_id": tracks}


def _truth(
    points: Array,
    odometry: tuple[Array, Array, Array],
    scans: Mapping[int, tuple[int, int, int]],
    mounts: Mapping[int, tuple[float, float, float]],
    tracks: Array,
) -> Objects:
    """The objects of which a scan has points, at the middle of these."""
    time, xy, yaw = odometry
    yaw = np.unwrap(yaw)
    times = sorted(scans)
    label, state, kind, counts = [], [], [], []
    for t in times:
        number, first, stop = scans[t]
        own = tracks[first:stop]
        place = np.array([[np.interp(t * 1000, time, xy[:, k]) for k in range(2)]])
        turn = np.array([np.interp(t * 1000, time, yaw)])
        at, q = mounted(place, turn, mounts[number])
        angle = 2 * np.arctan2(q[0, 2], q[0, 3]) + points["azimuth_sc"][first:stop].astype(float)
        r = points["range_sc"][first:stop].astype(float)
        map_xy = at[0, :2] + np.column_stack([r * np.cos(angle), r * np.sin(angle)])
        seen = np.unique(own[own >= 0])
        for track in seen.tolist():
            mine = own == track
            label.append(track)
            state.append(map_xy[mine].mean(axis=0))
            kind.append(int(points["label_id"][first:stop][mine][0]))
        counts.append(len(seen))
    bad = [k for k in kind if not 0 <= k < len(CLASSES)]
    if bad:
        raise FormatError("radar_data", "label_id", f"{bad[0]} is not one of {len(CLASSES)} labels")
    return Objects(
        np.array(times, np.int64) * 1000,
        np.concatenate([[0], np.cumsum(counts)]).astype(np.int64),
        np.array(label, np.int64),
        ("x", "y"),
        ("m", "m"),
        np.array(state, float).reshape(-1, 2),
        class_names=CLASSES,
        class_index=np.array(kind, np.int64),
    )
