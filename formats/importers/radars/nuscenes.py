"""Importer of nuScenes: the radars of a car in one scene, and the objects annotated in it.

Caesar et al., nuScenes: a multimodal dataset for autonomous driving, CVPR 2020. Tables in JSON lie
in a folder such as ``v1.0-mini``, the points beside it in ``.pcd`` files (version 0.7, binary) with
fields by name: ``x`` ahead and ``y`` to the left of the radar [m], ``rcs`` [dBsm], and ``vx vy``
[m/s], which are parts of the radial speed, the car's own in it: along the direction to the point
they give Doppler, positive when receding. ``z`` is 0 throughout: these radars have no elevation.

Points are taken that the devkit takes by default: ``invalid_state`` 0, ``dyn_prop`` below 7,
``ambig_state`` 3; ``valid: false`` takes all. A file whose first point is not finite is an empty
scan. Each radar is a stream called as its channel, with its pose in the map at each of its scans.

The truth are the annotations, at two samples a second, as rectangles with classes; the objects of a
sample without any are known to be absent.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ....models.checks import check
from ....models.errors import FormatError, InputError, ParameterError
from ....models.parameters import as_dict, parameter, suggestion
from ....models.records import Array, Meta, Recording, Sensor, Truth
from ...damage import damage
from ...plain_json import parse
from ..text import read_text
from .scans import Box, boxes, provenance, read_bytes, square_metres, stream

SUMMARY = "the radars of a scene of nuScenes, and its annotated objects"
TABLES = ("scene", "sample", "sample_data", "calibrated_sensor", "ego_pose", "sensor")
TRUTH = ("sample_annotation", "instance", "category")
_TYPES = {"F": "f", "I": "i", "U": "u"}
_COLUMNS = ("x", "y", "doppler", "rcs")
_NEEDED = ("x", "y", "rcs", "vx", "vy", "invalid_state", "dyn_prop", "ambig_state")
_POINTS = 1 << 20
"""Points of one file."""


@dataclass(frozen=True, slots=True)
class Params:
    """Which scene, and what is taken from it."""

    scene: str = parameter("", "", "name of the scene, such as scene-0061; may be empty for one")
    valid: bool = parameter(True, "", "only points that are valid by the devkit's default")
    half_view: float = parameter(
        60.0, "deg", "half the width of the fields of view", within="[0, 180]"
    )
    max_range: float = parameter(
        250.0, "m", "range of the fields of view; 0: not known", within="[0, inf)"
    )


def recognises(path: Path, head: bytes) -> bool:
    """Whether a folder holds the tables, or a folder with them."""
    return path.is_dir() and any(_versions(path))


def read(paths: Sequence[Path], params: Params) -> Recording:
    """The recording of one scene in the folder of the set, or of one version of its tables.

    Raises
    ------
    ParameterError : there are several scenes, and none or another is told
    FormatError : a file is unreadable or breaks the format
    InputError : there are no tables, or those of several versions
    """
    folder = len(paths) == 1 and paths[0].is_dir()
    versions = list(_versions(paths[0])) if folder else []
    if len(versions) != 1:
        reason = f"{len(versions)} folders with tables: nuscenes reads one"
        raise InputError(f"{paths[0]}: {reason}")
    (version,) = versions
    files: list[dict[str, str]] = []
    tables = {name: _table(version / f"{name}.json", files) for name in TABLES}
    with damage(version, "scene.json"):
        scene = _scene(list(tables["scene"].values()), params.scene)
    samples = {k: v for k, v in tables["sample"].items() if v.get("scene_token") == scene["token"]}
    sensors, streams = {}, {}
    view = np.radians(params.half_view), params.max_range
    radars = _radars(tables, samples)
    if not radars:
        raise FormatError(version / "sample_data.json", "", f"{scene['name']} has no radar")
    for name, found in sorted(radars.items()):
        scans = []
        for record in found:
            path = version.parent / str(record["filename"])
            data = read_bytes(path)
            files.append(provenance(path, data))
            scans.append(_columns(_pcd(data, path), params.valid))
        with damage(version / "sample_data.json", name):
            times = [int(record["timestamp"]) * 1000 for record in found]
            sensors[name] = _sensor(found, times, tables)
            streams[name] = stream(name, "position", times, scans, _COLUMNS, view, {})
    truth = None
    if all((version / f"{name}.json").is_file() for name in TRUTH):
        tables |= {name: _table(version / f"{name}.json", files) for name in TRUTH}
        with damage(version / "sample_annotation.json", ""):
            truth = Truth(boxes(_annotated(tables, samples)))
    said = {"importer": "nuscenes", "files": files, "parameters": as_dict(params)}
    recording = Recording(Meta(str(scene["name"]), provenance=said), sensors, streams, truth)
    check(recording, version)
    return recording


def _versions(path: Path) -> Iterator[Path]:
    for folder in (path, *sorted(p for p in path.iterdir() if p.is_dir())):
        if all((folder / f"{name}.json").is_file() for name in TABLES):
            yield folder


def _table(path: Path, files: list[dict[str, str]]) -> dict[str, dict[str, Any]]:
    """The records of a table by their tokens."""
    file = read_text(path, of_lines=False)
    files.append(file.provenance)
    found = parse(file.text, path)
    with damage(path, "records"):
        return {str(record["token"]): record for record in found}


def _scene(scenes: Sequence[Mapping[str, Any]], name: str) -> Mapping[str, Any]:
    known = {str(scene["name"]): scene for scene in scenes}
    if name in known:
        return known[name]
    if not name and len(known) == 1:
        return next(iter(known.values()))
    if name:
        raise ParameterError(f"there is no scene {name!r}{suggestion(name, known)}")
    listed = " ".join(sorted(known)[:8]) + (" ..." if len(known) > 8 else "")
    raise ParameterError(f"tell one of {len(known)} scenes by --set scene=: {listed}")


def _radars(
    tables: Mapping[str, Mapping[str, Any]], samples: Mapping[str, Any]
) -> dict[str, list[Mapping[str, Any]]]:
    """The files of each radar by its channel, in the order of time."""
    channels = {
        token: str(tables["sensor"][record["sensor_token"]]["channel"])
        for token, record in tables["calibrated_sensor"].items()
        if tables["sensor"].get(record.get("sensor_token"), {}).get("modality") == "radar"
    }
    found: dict[str, list[Mapping[str, Any]]] = {}
    for record in tables["sample_data"].values():
        channel = channels.get(record.get("calibrated_sensor_token", ""))
        if channel is not None and record.get("sample_token") in samples:
            found.setdefault(channel, []).append(record)
    return {name: sorted(v, key=lambda r: r.get("timestamp", 0)) for name, v in found.items()}


def _sensor(
    records: Sequence[Mapping[str, Any]],
    times: Sequence[int],
    tables: Mapping[str, Mapping[str, Any]],
) -> Sensor:
    """The radar at its pose in the map at each scan: on the car, at the car's pose."""
    car = [tables["ego_pose"][r["ego_pose_token"]] for r in records]
    own = [tables["calibrated_sensor"][r["calibrated_sensor_token"]] for r in records]
    turn, mount = (_rotations(poses) for poses in (car, own))
    place = np.array([p["translation"] for p in car], float)
    place = place + turn.apply(np.array([p["translation"] for p in own], float))
    q = np.asarray((turn * mount).as_quat())
    time = np.array(times, np.int64)
    return Sensor("radar", time, place, q / np.linalg.norm(q, axis=1)[:, None])


def _rotations(poses: Sequence[Mapping[str, Any]]) -> Any:
    """Rotations of quaternions that stand as w, x, y, z."""
    from scipy.spatial.transform import Rotation

    return Rotation.from_quat([[*p["rotation"][1:], p["rotation"][0]] for p in poses])


def _pcd(data: bytes, path: Path) -> Array:
    """The points of a file as a structured array."""
    with damage(path, "header"):
        header: dict[str, list[str]] = {}
        start = 0
        while "DATA" not in header:
            end = data.index(b"\n", start)
            words = data[start:end].decode("ascii").split()
            start = end + 1
            if words and not words[0].startswith("#"):
                header[words[0]] = words[1:]
        fields, sizes, kinds = header["FIELDS"], header["SIZE"], header["TYPE"]
        count = int(header["POINTS"][0])
        if header["DATA"] != ["binary"] or set(header.get("COUNT", ["1"])) != {"1"}:
            raise ValueError("the points are not binary, or have fields of several values")
        if not 0 <= count <= _POINTS:
            raise ValueError(f"there are {count} points")
        absent = [name for name in _NEEDED if name not in fields]
        if absent:
            raise ValueError(f"the points have no field {absent[0]}")
        formats = [f"<{_TYPES[k]}{int(s)}" for k, s in zip(kinds, sizes, strict=True)]
        kind = np.dtype(list(zip(fields, formats, strict=True)))
        if len(data) - start < count * kind.itemsize:
            raise ValueError(f"{count} points do not fit {len(data) - start} bytes")
        return np.frombuffer(data, kind, count, start)


def _columns(points: Array, valid: bool) -> dict[str, Array]:
    """The columns of a scan, of points that are there, and perhaps only of those that are valid."""
    x, y, vx, vy = (points[name].astype(float) for name in ("x", "y", "vx", "vy"))
    there = np.isfinite(x) & np.isfinite(y) & np.isfinite(vx) & np.isfinite(vy)
    there &= np.isfinite(points["rcs"])
    if valid:
        there &= (points["invalid_state"] == 0) & (points["ambig_state"] == 3)
        there &= (points["dyn_prop"] >= 0) & (points["dyn_prop"] < 7)
    distance = np.maximum(np.hypot(x, y), 1e-9)
    with np.errstate(invalid="ignore", over="ignore"):
        doppler = (vx * x + vy * y) / distance
        found = {"x": x, "y": y, "doppler": doppler, "rcs": square_metres(points["rcs"])}
    return {name: values[there] for name, values in found.items()}


def _annotated(
    tables: Mapping[str, Mapping[str, Any]], samples: Mapping[str, Any]
) -> dict[int, list[Box]]:
    """The boxes at the time of each sample [ns]."""
    found: dict[int, list[Box]] = {int(s["timestamp"]) * 1000: [] for s in samples.values()}
    for record in tables["sample_annotation"].values():
        if record["sample_token"] not in samples:
            continue
        time = int(samples[record["sample_token"]]["timestamp"]) * 1000
        instance = tables["instance"][record["instance_token"]]
        kind = str(tables["category"][instance["category_token"]]["name"])
        w, x, y, z = (float(v) for v in record["rotation"])
        yaw = float(np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)))
        width, length, _ = (float(v) for v in record["size"])
        cx, cy, cz = (float(v) for v in record["translation"])
        box = Box(str(record["instance_token"]), kind, (cx, cy, cz), (length, width), yaw)
        found[time].append(box)
    return found
