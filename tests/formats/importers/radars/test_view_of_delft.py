"""Frames of View-of-Delft in their published layout, read back by the layout's definition."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from support.damage import refused_in_a_line

from echoset.formats.importers.radars import view_of_delft
from echoset.models.errors import FormatError, InputError, ParameterError
from echoset.models.geometry.poses import pose_at
from echoset.models.records import Recording

AHEAD = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]])
"""From x ahead, y left, z up to a camera's x right, y down, z ahead."""
HEIGHT = {"radar": 0.5, "lidar": 2.0}
CAMERA = np.array([1.0, 0.0, 1.5])
"""Where the camera is on the car; radar and lidar stand at x = 3 and 0."""
BOX = {"width": 1.8, "length": 4.5, "height": 1.5}


def to_camera(sensor: str) -> np.ndarray:
    """Radar or lidar, level on the car, to the camera, which is level here, too."""
    T = np.eye(4)
    T[:3, :3] = AHEAD
    T[:3, 3] = AHEAD @ (np.array([3.0 if sensor == "radar" else 0.0, 0, HEIGHT[sensor]]) - CAMERA)
    return T


def car(frame: int) -> np.ndarray:
    """The car in the odometry's frame: it goes at 5 m/s, and turns."""
    T = np.eye(4)
    T[:3, :3] = Rotation.from_euler("z", 0.05 * frame).as_matrix()
    T[:3, 3] = [0.5 * frame, 0.02 * frame**2, 0.0]
    return T


def frames(root: Path, count: int = 4, jump: int = 99) -> list[np.ndarray]:
    """Radar points, calibrations, poses and labels of frames 10, 11, ..."""
    rng = np.random.default_rng(3)
    camera = np.eye(4)
    camera[:3, :3], camera[:3, 3] = AHEAD.T, CAMERA
    written = []
    for folder in ("radar/training/velodyne", "radar/training/calib", "lidar/training/calib",
                   "lidar/training/pose", "label_2_with_track_ids/label_2"):  # fmt: skip
        (root / folder).mkdir(parents=True)
    for k in range(count):
        name = f"{10 + k:05d}"
        points = rng.normal(0, 10, (0 if k == 2 else 6, 7)).astype("<f4")
        points[:, 0] = np.abs(points[:, 0]) + 20
        points[:, 6] = 0
        points[4:, 6] = -1
        (root / f"radar/training/velodyne/{name}.bin").write_bytes(points.tobytes())
        written.append(points)
        for sensor in HEIGHT:
            rows = [f"P{i}: {' '.join(['1'] * 12)}" for i in range(4)]
            rows += ["R0_rect: 1 0 0 0 1 0 0 0 1"]
            values = " ".join(repr(float(v)) for v in to_camera(sensor)[:3].ravel())
            rows += [f"Tr_velo_to_cam: {values}"]
            (root / f"{sensor}/training/calib/{name}.txt").write_text("\n".join(rows) + "\n")
        T = car(k)
        T[0, 3] += 1000 if k >= jump else 0
        pose = [{"odomToCamera": (T @ camera).ravel().tolist()}]
        pose += [{key: np.eye(4).ravel().tolist()} for key in ("mapToCamera", "UTMToCamera")]
        text = "\n".join(map(json.dumps, pose)) + "\n"
        (root / f"lidar/training/pose/{name}.json").write_text(text)
        labels = [label(k, 7, "Car", np.array([20.0, 3.0, 0.0]), 0.4)]
        if k > 1:
            labels.append(label(k, 12, "Cyclist", np.array([12.0, -2.0, 0.0]), -1.0))
        path = root / f"label_2_with_track_ids/label_2/{name}.txt"
        path.write_text("\n".join(labels) + "\n")
    return written


def label(frame: int, track: int, kind: str, foot: np.ndarray, yaw: float) -> str:
    """An object whose foot is at a place of the odometry's frame, by KITTI's definition."""
    on_car = np.linalg.inv(car(frame)) @ [*foot, 1.0]
    at = AHEAD @ (on_car[:3] - CAMERA)
    turn = -(yaw - 0.05 * frame) - np.pi / 2
    sizes = [BOX["height"], BOX["width"], BOX["length"]]
    numbers = [track, 0, 0.0, 0.0, 0.0, 10.0, 10.0, *sizes, *at, turn, 1]
    return " ".join([kind, *(repr(float(v)) for v in numbers)])


def imported(root: Path, **params: Any) -> Recording:
    return view_of_delft.read([root], view_of_delft.Params(**params))


def test_points_and_times(tmp_path: Path):
    """The points of this scan alone, by ``numpy.fromfile`` as the set's own reader has it."""
    frames(tmp_path)
    found = imported(tmp_path)
    stream = found.streams["radar"]
    np.testing.assert_array_equal(stream.time_ns, [10**9 + k * 10**8 for k in range(4)])
    np.testing.assert_array_equal(np.diff(stream.row_offset), [4, 4, 0, 4])
    read = [
        np.fromfile(tmp_path / f"radar/training/velodyne/000{n}.bin", np.float32).reshape(-1, 7)
        for n in range(10, 14)
    ]
    own = np.concatenate([points[points[:, 6] == 0] for points in read])
    for k, name in enumerate(("x", "y", "z")):
        np.testing.assert_array_equal(stream.rows[name], own[:, k].astype(float))
    np.testing.assert_array_equal(stream.rows["doppler"], own[:, 4].astype(float))
    np.testing.assert_allclose(10 * np.log10(stream.rows["rcs"]), own[:, 3], rtol=1e-9)
    assert stream.scan["view_range_max"][0] == 100.0
    some = imported(tmp_path, first=11, last=12).streams["radar"]
    np.testing.assert_array_equal(some.time_ns, stream.time_ns[1:3])


def test_the_radar_is_where_the_car_carries_it(tmp_path: Path):
    frames(tmp_path)
    sensor = imported(tmp_path).sensors["radar"]
    for k in range(4):
        position, R = pose_at(sensor, int(sensor.time_ns[k]))
        np.testing.assert_allclose(position, (car(k) @ [3.0, 0.0, 0.5, 1.0])[:3], atol=1e-9)
        np.testing.assert_allclose(R, car(k)[:3, :3], atol=1e-9)


def test_poses_beside_the_radar(tmp_path: Path):
    """Where the folder of the radar has poses, too, they are those."""
    frames(tmp_path)
    usual = imported(tmp_path).sensors["radar"].position
    (tmp_path / "lidar/training/pose").rename(tmp_path / "radar/training/pose")
    np.testing.assert_array_equal(imported(tmp_path).sensors["radar"].position, usual)


def test_the_truth_by_track(tmp_path: Path):
    """Middles of boxes at rest in the odometry's frame, while the car turns."""
    frames(tmp_path)
    o = imported(tmp_path).truth.objects
    np.testing.assert_array_equal(np.diff(o.row_offset), [1, 1, 2, 2])
    np.testing.assert_array_equal(o.label, [0, 0, 0, 1, 0, 1])
    cars = o.label == 0
    np.testing.assert_allclose(o.state[cars], np.tile([20.0, 3.0, 0.75], (4, 1)), atol=1e-9)
    np.testing.assert_allclose(o.state[~cars], np.tile([12.0, -2.0, 0.75], (2, 1)), atol=1e-9)
    np.testing.assert_allclose(o.rotation, np.where(cars, 0.4, -1.0), atol=1e-9)
    np.testing.assert_allclose(o.semi_axes, np.tile([2.25, 0.9], (6, 1)))
    assert [o.class_names[k] for k in o.class_index[2:4]] == ["Car", "Cyclist"]


def test_without_tracks_there_is_no_truth(tmp_path: Path):
    frames(tmp_path)
    (tmp_path / "label_2_with_track_ids").rename(tmp_path / "other")
    assert imported(tmp_path).truth is None


def test_what_cannot_be_is_refused(tmp_path: Path):
    frames(tmp_path, jump=2)
    with pytest.raises(FormatError, match="frame 12: another drive begins"):
        imported(tmp_path)
    assert len(imported(tmp_path, last=11).streams["radar"]) == 2
    with pytest.raises(ParameterError, match="no such frames, there are 10 to 13"):
        imported(tmp_path, first=20)
    with pytest.raises(ParameterError, match="last"):
        imported(tmp_path, first=5, last=4)
    with pytest.raises(InputError, match="reads the folder of the set"):
        imported(tmp_path / "radar")
    pose = tmp_path / "lidar/training/pose/00010.json"
    mirrored = np.diag([1.0, 1.0, -1.0, 1.0]).ravel().tolist()
    for values in ([2.0] * 16, mirrored):
        pose.write_text(json.dumps({"odomToCamera": values}) + "\n")
        with pytest.raises(FormatError, match=r"00010\.json.*is no rotation"):
            imported(tmp_path)
    pose.unlink()
    with pytest.raises(FormatError, match=r"00010\.json.*No such file"):
        imported(tmp_path)


def test_damaged_frames_are_refused_in_a_line(tmp_path: Path):
    frames(tmp_path)
    files = (
        "radar/training/velodyne/00011.bin",
        "radar/training/calib/00011.txt",
        "lidar/training/pose/00011.json",
        "label_2_with_track_ids/label_2/00012.txt",
    )
    refused_in_a_line([tmp_path / name for name in files], lambda: imported(tmp_path))
