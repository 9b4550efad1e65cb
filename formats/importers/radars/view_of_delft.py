"""Importer of View-of-Delft: the radar of a car through a run of frames, and annotated objects.

Palffy et al., Multi-class road user detection with 3+1D radar in the View-of-Delft dataset, RA-L
2022. In the folder of the set::

    radar/training/velodyne/NNNNN.bin   float32 x 7: x y z [m], RCS [dBsm], v_r and v_r_compensated
                                        [m/s], time (0: this scan, -1: the one before, ...)
    radar/training/calib/NNNNN.txt      a line Tr_velo_to_cam: radar to camera, 3 x 4
    lidar/training/calib/NNNNN.txt      the same of the lidar, about whose axis boxes turn
    lidar/training/pose/NNNNN.json      a line {"odomToCamera": 16 values}: camera to odometry
    label_2_with_track_ids/label_2/NNNNN.txt   KITTI's fields, the track in place of truncation;
                                        or lidar/training/label_2, without tracks: no truth

``v_r`` is the radial speed as measured, the car's own in it, positive when receding. Points of
earlier scans are left out. Frames are numbered at the lidar's ten a second, from which the times
come (``rate``), since the files hold no stamps; a run in which the car jumps is of several drives,
and refused. Boxes stand at the bottom of the object in the camera's frame and are turned about the
lidar's axis; the truth has their middle, in the frame of the odometry.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ....models.checks import check
from ....models.errors import FormatError, InputError, ParameterError
from ....models.parameters import as_dict, parameter, require
from ....models.records import Array, Meta, Recording, Sensor, Truth
from ...damage import damage
from ...plain_json import parse
from ..text import read_text
from .scans import Box, boxes, provenance, read_bytes, square_metres, stream

SUMMARY = "the radar of View-of-Delft through a run of frames, and its annotated objects"
_COLUMNS = ("x", "y", "z", "doppler", "rcs")
_TRAINING = Path("radar", "training", "velodyne")
_TRACKS = Path("label_2_with_track_ids", "label_2")
_FASTEST = 60.0
"""Speed [m/s] from which on frames are of another drive."""


@dataclass(frozen=True, slots=True)
class Params:
    """Which frames, and what the files leave open."""

    first: int = parameter(0, "", "number of the first frame", within="[0, inf)")
    last: int | None = parameter(None, "", "number of the last frame; by default that of the set")
    rate: float = parameter(10.0, "Hz", "frames a second", within="(0, inf)")
    half_view: float = parameter(
        60.0, "deg", "half the width of the field of view", within="[0, 180]"
    )
    max_range: float = parameter(
        100.0, "m", "range of the field of view; 0: not known", within="[0, inf)"
    )

    def __post_init__(self) -> None:
        ok = self.last is None or self.last >= self.first
        require(ok, "last", f"a frame from {self.first} on", self.last)


def recognises(path: Path, head: bytes) -> bool:
    """Whether a folder is that of the set."""
    return (path / _TRAINING).is_dir()


def read(paths: Sequence[Path], params: Params) -> Recording:
    """The recording of a run of frames in the folder of the set.

    Raises
    ------
    ParameterError : there is no such frame
    FormatError : a file is missing or breaks the format, or the car jumps
    InputError : it is not the folder of the set
    """
    if len(paths) != 1 or not (paths[0] / _TRAINING).is_dir():
        raise InputError(f"view-of-delft reads the folder of the set, in which lies {_TRAINING}")
    root = paths[0]
    known = sorted(int(p.stem) for p in (root / _TRAINING).glob("*.bin") if p.stem.isdecimal())
    frames = [n for n in known if params.first <= n and (params.last is None or n <= params.last)]
    if not frames:
        there = f"{known[0]} to {known[-1]}" if known else "none"
        raise ParameterError(f"first, last: there are no such frames, there are {there}")
    files: list[dict[str, str]] = []
    scans, poses, true = [], [], dict[int, list[Box]]()
    times = [round(n / params.rate * 1e9) for n in frames]
    for frame, time in zip(frames, times, strict=True):
        scans.append(_points(root / _TRAINING / f"{frame:05d}.bin", files))
        camera = _camera(root, frame, files)
        poses.append(camera @ _calibration(root, "radar", frame, files))
        labels = root / _TRACKS / f"{frame:05d}.txt"
        if labels.is_file():
            lidar = _calibration(root, "lidar", frame, files)
            true[time] = list(_boxes(labels, camera, lidar, files))
    _one_drive(frames, poses, params.rate, root)
    view = np.radians(params.half_view), params.max_range
    made = stream("radar", "position", times, scans, _COLUMNS, view, {})
    place = np.array([T[:3, 3] for T in poses])
    turns = np.array([_quaternion(T[:3, :3]) for T in poses])
    sensor = Sensor("radar", np.array(times, np.int64), place, turns)
    said = {"importer": "view-of-delft", "files": files, "parameters": as_dict(params)}
    meta = Meta(f"frames-{frames[0]:05d}-{frames[-1]:05d}", frame="odom", provenance=said)
    truth = None
    if true:
        with damage(root / _TRACKS, "tracks"):
            truth = Truth(boxes(true))
    recording = Recording(meta, {"radar": sensor}, {"radar": made}, truth)
    check(recording, root)
    return recording


def _points(path: Path, files: list[dict[str, str]]) -> Mapping[str, Array]:
    """The points of this scan."""
    data = read_bytes(path)
    files.append(provenance(path, data))
    if len(data) % 28:
        raise FormatError(path, "", f"{len(data)} bytes are no points of seven numbers")
    table = np.frombuffer(data, "<f4").reshape(-1, 7).astype(float)
    if not np.isfinite(table).all():
        row = int((~np.isfinite(table)).any(axis=1).argmax())
        raise FormatError(path, f"point {row}", "holds what is not finite")
    x, y, z, rcs, v = table[table[:, 6] == 0, :5].T
    return {"x": x, "y": y, "z": z, "doppler": v, "rcs": square_metres(rcs)}


def _calibration(root: Path, sensor: str, frame: int, files: list[dict[str, str]]) -> Array:
    """From the sensor to the camera (4, 4)."""
    file = read_text(root / sensor / "training" / "calib" / f"{frame:05d}.txt")
    files.append(file.provenance)
    with damage(file.path, "Tr_velo_to_cam"):
        lines = dict(line.split(":", 1) for line in file.lines() if ":" in line)
        return _matrix([float(word) for word in lines["Tr_velo_to_cam"].split()])


def _camera(root: Path, frame: int, files: list[dict[str, str]]) -> Array:
    """From the camera to the odometry (4, 4)."""
    file = read_text(root / "lidar" / "training" / "pose" / f"{frame:05d}.json")
    files.append(file.provenance)
    with damage(file.path, "odomToCamera"):
        found = [parse(line, file.path) for line in file.lines() if line.strip()]
        return _matrix(next(d["odomToCamera"] for d in found if "odomToCamera" in d))


def _matrix(values: Sequence[float]) -> Array:
    """A rigid transform of 12 or 16 values."""
    T = np.eye(4)
    T[: len(values) // 4] = np.array(values, float).reshape(-1, 4)
    R = T[:3, :3]
    if not (np.isfinite(T).all() and np.allclose(R @ R.T, np.eye(3), atol=1e-3)):
        raise ValueError("is no rotation and translation")
    return T


def _quaternion(R: Array) -> Array:
    """The unit quaternion of a rotation that single precision has rounded."""
    from scipy.spatial.transform import Rotation

    q = Rotation.from_matrix(R).as_quat()
    return np.asarray(q / np.linalg.norm(q))


def _boxes(path: Path, camera: Array, lidar: Array, files: list[dict[str, str]]) -> Iterator[Box]:
    """The objects of a frame in the odometry's frame; ``camera`` and ``lidar`` as transforms."""
    file = read_text(path)
    files.append(file.provenance)
    up = camera @ lidar
    for number, line in enumerate(file.text.splitlines(), 1):
        words = line.split()
        if not words:
            continue
        with damage(path, f"line {number}"):
            kind, track = words[0], str(int(float(words[1])))
            height, width, length, x, y, z, turn = (float(w) for w in words[8:15])
            at = camera @ np.array([x, y, z, 1.0])
            centre = at[:3] + up[:3, :3] @ np.array([0.0, 0.0, height / 2])
            yaw = -(turn + np.pi / 2)
            ahead = up[:3, :3] @ np.array([np.cos(yaw), np.sin(yaw), 0.0])
            cx, cy, cz = centre.tolist()
            heading = float(np.arctan2(ahead[1], ahead[0]))
            yield Box(track, kind, (cx, cy, cz), (length, width), heading)


def _one_drive(frames: Sequence[int], poses: Sequence[Array], rate: float, root: Path) -> None:
    """Refuse frames between which the car jumps."""
    for k in range(1, len(frames)):
        span = (frames[k] - frames[k - 1]) / rate
        if np.linalg.norm(poses[k][:3, 3] - poses[k - 1][:3, 3]) > _FASTEST * span:
            reason = "another drive begins: take one by --set first= and --set last="
            raise FormatError(root, f"frame {frames[k]}", reason)
