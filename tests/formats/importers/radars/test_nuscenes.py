"""A scene of nuScenes in its published layout, read by us and by the set's own devkit."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from support.damage import refused_in_a_line

from echoset.formats.importers.radars import nuscenes
from echoset.models.errors import FormatError, InputError, ParameterError
from echoset.models.geometry.poses import pose_at
from echoset.models.records import Recording

FIELDS = [
    "x", "y", "z", "dyn_prop", "id", "rcs", "vx", "vy", "vx_comp", "vy_comp", "is_quality_valid",
    "ambig_state", "x_rms", "y_rms", "invalid_state", "pdh0", "vx_rms", "vy_rms",
]  # fmt: skip
SIZES = [4, 4, 4, 1, 2, 4, 4, 4, 4, 4, 1, 1, 1, 1, 1, 1, 1, 1]
KINDS = list("FFFIIFFFFFIIIIIIII")
POINT = np.dtype([(n, f"<{k.lower()}{s}") for n, k, s in zip(FIELDS, KINDS, SIZES, strict=True)])
T0 = 1_532_402_927_000_000
MOUNTS = {"RADAR_FRONT": ([3.4, 0.0, 0.5], 0.0), "RADAR_BACK_LEFT": ([-0.6, 0.6, 0.5], 1.6)}


def pcd(points: np.ndarray) -> bytes:
    header = (
        "# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\n"
        f"FIELDS {' '.join(FIELDS)}\nSIZE {' '.join(map(str, SIZES))}\nTYPE {' '.join(KINDS)}\n"
        f"COUNT {' '.join('1' * 18)}\nWIDTH {len(points)}\nHEIGHT 1\n"
        f"VIEWPOINT 0 0 0 1 0 0 0\nPOINTS {len(points)}\nDATA binary\n"
    )
    return header.encode() + points.tobytes() + b"\n"


def quaternion(yaw: float) -> list[float]:
    return [float(np.cos(yaw / 2)), 0.0, 0.0, float(np.sin(yaw / 2))]


def scene(root: Path) -> dict[str, np.ndarray]:
    """Two samples half a second apart, a sweep between; two radars; two objects, one of them late.

    The second file of the radar ahead is empty, as the set says it: a point that is not finite.
    """
    rng = np.random.default_rng(6)
    version = root / "v1.0-mini"
    version.mkdir(parents=True)
    tables: dict[str, list[dict[str, Any]]] = {
        "scene": [{"token": "s", "name": "scene-0061"}, {"token": "o", "name": "scene-0103"}],
        "sample": [
            {"token": f"sample{k}", "scene_token": "s", "timestamp": T0 + 500_000 * k}
            for k in range(2)
        ],
        "sensor": [{"token": f"of-{c}", "channel": c, "modality": "radar"} for c in MOUNTS],
        "calibrated_sensor": [
            {"token": f"cal-{c}", "sensor_token": f"of-{c}", "translation": p,
             "rotation": quaternion(a)}
            for c, (p, a) in MOUNTS.items()
        ],
        "category": [{"token": "c1", "name": "vehicle.car"}, {"token": "c2", "name": "human"}],
        "instance": [
            {"token": "i1", "category_token": "c1"}, {"token": "i2", "category_token": "c2"}
        ],
        "sample_annotation": [
            {"token": "a1", "sample_token": "sample0", "instance_token": "i1",
             "translation": [410.0, 1180.0, 1.0], "size": [1.9, 4.6, 1.7],
             "rotation": quaternion(0.7)},
            {"token": "a2", "sample_token": "sample1", "instance_token": "i1",
             "translation": [412.0, 1181.0, 1.0], "size": [1.9, 4.6, 1.7],
             "rotation": quaternion(-2.0)},
            {"token": "a3", "sample_token": "sample1", "instance_token": "i2",
             "translation": [420.0, 1170.0, 0.9], "size": [0.6, 0.7, 1.8],
             "rotation": quaternion(0.1)},
        ],
        "sample_data": [], "ego_pose": [],
    }  # fmt: skip
    tables["sensor"].append({"token": "cam", "channel": "CAM_FRONT", "modality": "camera"})
    written = {}
    for channel in MOUNTS:
        for k in range(3):
            stamp = T0 + 250_000 * k + (3_000 if "BACK" in channel else 0)
            folder = "samples" if k != 1 else "sweeps"
            name = f"{folder}/{channel}/n015__{channel}__{stamp}.pcd"
            points = np.zeros(6, POINT)
            for field in ("x", "y", "rcs", "vx", "vy"):
                points[field] = rng.normal(0, 12, 6)
            points["x"] = np.abs(points["x"]) + 20
            points["ambig_state"], points["dyn_prop"] = 3, [0, 1, 2, 7, 3, 6]
            points["invalid_state"] = [0, 0, 4, 0, 0, 0]
            points["ambig_state"][4] = 4
            if k == 1 and channel == "RADAR_FRONT":
                points = points[:1]
                points["x"] = np.nan
            path = root / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(pcd(points))
            written[name] = points
            token = f"{channel}-{k}"
            tables["ego_pose"].append(
                {"token": token, "timestamp": stamp, "rotation": quaternion(0.5 + 0.1 * k),
                 "translation": [400.0 + 3 * k, 1180.0, 0.0]}
            )  # fmt: skip
            tables["sample_data"].append(
                {"token": token, "sample_token": "sample1" if k == 2 else "sample0",
                 "ego_pose_token": token, "calibrated_sensor_token": f"cal-{channel}",
                 "timestamp": stamp, "filename": name, "is_key_frame": k != 1}
            )  # fmt: skip
    for name, records in tables.items():
        (version / f"{name}.json").write_text(json.dumps(records))
    return written


def imported(root: Path, **params: Any) -> Recording:
    return nuscenes.read([root], nuscenes.Params(**{"scene": "scene-0061", **params}))


def test_points_of_each_radar(tmp_path: Path):
    """Doppler is the radial part of vx, vy: by the direction's angle, not by components."""
    written = scene(tmp_path)
    found = imported(tmp_path, valid=False)
    assert found.meta.name == "scene-0061"
    assert sorted(found.streams) == sorted(MOUNTS)
    for channel in MOUNTS:
        stream = found.streams[channel]
        late = 3_000 if "BACK" in channel else 0
        np.testing.assert_array_equal(
            stream.time_ns, [(T0 + 250_000 * k + late) * 1000 for k in range(3)]
        )
        own = [p for name, p in written.items() if f"/{channel}/" in name]
        own = np.concatenate([p[np.isfinite(p["x"])] for p in own])
        np.testing.assert_array_equal(stream.rows["x"], own["x"].astype(float))
        np.testing.assert_array_equal(stream.rows["y"], own["y"].astype(float))
        np.testing.assert_allclose(10 * np.log10(stream.rows["rcs"]), own["rcs"], rtol=1e-9)
        vx, vy, x, y = (own[k].astype(float) for k in ("vx", "vy", "x", "y"))
        speed, between = np.hypot(vx, vy), np.arctan2(vy, vx) - np.arctan2(y, x)
        np.testing.assert_allclose(stream.rows["doppler"], speed * np.cos(between), atol=1e-9)
    empty = [6, 0, 6]
    np.testing.assert_array_equal(np.diff(found.streams["RADAR_FRONT"].row_offset), empty)


def test_only_valid_points_by_default(tmp_path: Path):
    """Of six points one is invalid, one stopped (7) and one ambiguous."""
    scene(tmp_path)
    stream = imported(tmp_path).streams["RADAR_BACK_LEFT"]
    np.testing.assert_array_equal(np.diff(stream.row_offset), [3, 3, 3])


def test_poses_by_another_way(tmp_path: Path):
    """A point of the radar on the map: turned and shifted twice, by scipy's rotations."""
    scene(tmp_path)
    sensor = imported(tmp_path).sensors["RADAR_BACK_LEFT"]
    place, yaw = MOUNTS["RADAR_BACK_LEFT"]
    point = np.array([7.0, -2.0, 0.5])
    for k in range(3):
        position, R = pose_at(sensor, int(sensor.time_ns[k]))
        on_car = Rotation.from_euler("z", yaw).apply(point) + place
        turn = Rotation.from_euler("z", 0.5 + 0.1 * k)
        expected = turn.apply(on_car) + np.array([400.0 + 3 * k, 1180.0, 0.0])
        np.testing.assert_allclose(position + R @ point, expected, atol=1e-9)


def test_the_truth_by_instance(tmp_path: Path):
    scene(tmp_path)
    o = imported(tmp_path).truth.objects
    np.testing.assert_array_equal(o.time_ns, [T0 * 1000, (T0 + 500_000) * 1000])
    np.testing.assert_array_equal(o.row_offset, [0, 1, 3])
    np.testing.assert_array_equal(o.label, [0, 0, 1])
    assert [o.class_names[k] for k in o.class_index] == ["vehicle.car", "vehicle.car", "human"]
    np.testing.assert_array_equal(o.state[1], [412.0, 1181.0, 1.0])
    np.testing.assert_allclose(o.semi_axes, [[2.3, 0.95], [2.3, 0.95], [0.35, 0.3]])
    np.testing.assert_allclose(o.rotation, [0.7, -2.0, 0.1], atol=1e-12)


def test_which_scene(tmp_path: Path):
    scene(tmp_path)
    with pytest.raises(ParameterError, match=r"tell one of 2 scenes .*scene-0061 scene-0103"):
        imported(tmp_path, scene="")
    with pytest.raises(ParameterError, match=r"no scene 'scene-0062' .did you mean"):
        imported(tmp_path, scene="scene-0062")
    with pytest.raises(FormatError, match="scene-0103 has no radar"):
        imported(tmp_path, scene="scene-0103")
    with pytest.raises(InputError, match="0 folders with tables"):
        imported(tmp_path / "samples")
    assert nuscenes.recognises(tmp_path, b"") and not nuscenes.recognises(tmp_path / "samples", b"")
    within = imported(tmp_path / "v1.0-mini")
    assert len(within.streams["RADAR_FRONT"]) == 3


def test_the_devkit_reads_the_same(tmp_path: Path):
    kit = pytest.importorskip("nuscenes.utils.data_classes", reason="nuscenes-devkit is missing")
    written = scene(tmp_path)
    found = imported(tmp_path)
    for channel in MOUNTS:
        rows = found.streams[channel].rows
        theirs = [
            kit.RadarPointCloud.from_file(str(tmp_path / name)).points
            for name in written
            if f"/{channel}/" in name
        ]
        points = np.concatenate(theirs, axis=1)
        x, y, rcs, vx, vy = points[[0, 1, 5, 6, 7]]
        np.testing.assert_array_equal(rows["x"], x)
        np.testing.assert_array_equal(rows["y"], y)
        np.testing.assert_allclose(10 * np.log10(rows["rcs"]), rcs, rtol=1e-9)
        np.testing.assert_allclose(rows["doppler"], (vx * x + vy * y) / np.hypot(x, y), rtol=1e-12)


@pytest.mark.parametrize(
    ("table", "old", "new"),
    [
        ("sample_data", '"filename"', '"file"'),
        ("sample_data", '"samples/', '"../samples/'),
        ("sample_data", '"samples/', '"/samples/'),
        ("sensor", '"channel"', '"chanel"'),
        ("ego_pose", '"rotation": [', '"rotation": [0, 0, '),
        ("sample_annotation", '"size": [', '"size": [1, '),
    ],
)
def test_tables_that_are_none_are_named(tmp_path: Path, table: str, old: str, new: str):
    scene(tmp_path)
    path = tmp_path / "v1.0-mini" / f"{table}.json"
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new))
    with pytest.raises(FormatError, match=r"\.json"):
        imported(tmp_path)


def test_damaged_scenes_are_refused_in_a_line(tmp_path: Path):
    files = next(iter(scene(tmp_path))), "v1.0-mini/sample_data.json", "v1.0-mini/instance.json"
    refused_in_a_line([tmp_path / name for name in files], lambda: imported(tmp_path))
    for path in (tmp_path / name for name in files):
        whole = path.read_bytes()
        path.write_bytes(whole[: len(whole) // 2])
        with pytest.raises(FormatError):
            imported(tmp_path)
        path.write_bytes(whole)
    imported(tmp_path)
