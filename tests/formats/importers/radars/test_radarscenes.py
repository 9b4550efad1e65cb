"""A sequence of RadarScenes in its published layout, read by us and by the set's own devkit."""

from __future__ import annotations

import json
from pathlib import Path

import h5py
import numpy as np
import pytest
from support.damage import refused_in_a_line

from echoset.formats.importers.radars import radarscenes
from echoset.models.errors import FormatError
from echoset.models.geometry.poses import pose_at, velocity_at
from echoset.models.records import Recording

POINTS = np.dtype([
    ("timestamp", "i8"), ("sensor_id", "u1"), ("range_sc", "f4"), ("azimuth_sc", "f4"),
    ("rcs", "f4"), ("vr", "f4"), ("vr_compensated", "f4"), ("x_cc", "f4"), ("y_cc", "f4"),
    ("x_seq", "f4"), ("y_seq", "f4"), ("uuid", "S32"), ("track_id", "S32"), ("label_id", "u1"),
])  # fmt: skip
ODOMETRY = np.dtype([
    ("timestamp", "i8"), ("x_seq", "f4"), ("y_seq", "f4"), ("yaw_seq", "f4"), ("vx", "f4"),
    ("yaw_rate", "f4"),
])  # fmt: skip
MOUNT = {1: (3.663, -0.873, -1.48418552), 3: (3.86, 0.70, 0.436)}
SPEED, TURN = 8.0, 0.2
"""The car goes round on a circle."""
CAR = np.array([25.0, 8.0])
"""Where a car stands, of which points come; all else stands still, too."""


def body(t: float) -> tuple[np.ndarray, float, np.ndarray]:
    """Place, yaw and velocity of the car at ``t`` [s]."""
    yaw, radius = TURN * t, SPEED / TURN
    place = radius * np.array([np.sin(yaw), 1 - np.cos(yaw)])
    return place, yaw, SPEED * np.array([np.cos(yaw), np.sin(yaw)])


def sequence(folder: Path) -> np.ndarray:
    """Radars 1 and 3 in turn, every 40 ms; the fourth scan is empty."""
    rng = np.random.default_rng(2)
    times = 1_000_000 + 40_000 * np.arange(8)
    odometry = np.zeros(200, ODOMETRY)
    odometry["timestamp"] = 900_000 + 2_500 * np.arange(200)
    for row in odometry:
        place, yaw, _ = body((row["timestamp"] - 1_000_000) * 1e-6)
        row["x_seq"], row["y_seq"], row["yaw_seq"] = *place, yaw
    scenes, points = {}, []
    for k, t in enumerate(times.tolist()):
        number, first = (1, 3)[k % 2], len(points)
        place, yaw, v = body((t - 1_000_000) * 1e-6)
        x, y, turn = MOUNT[number]
        c, s = np.cos(yaw), np.sin(yaw)
        at = place + np.array([c * x - s * y, s * x + c * y])
        w = v + TURN * np.array([-(at - place)[1], (at - place)[0]])
        for i in range(0 if k == 3 else 5):
            spot = CAR + rng.normal(0, 0.5, 2) if i < 3 else rng.uniform(-40, 40, 2)
            u = (spot - at) / np.linalg.norm(spot - at)
            angle = np.arctan2(u[1], u[0]) - yaw - turn
            row = np.zeros((), POINTS)
            row["timestamp"], row["sensor_id"] = t, number
            row["range_sc"] = np.linalg.norm(spot - at)
            row["azimuth_sc"] = np.arctan2(np.sin(angle), np.cos(angle))
            row["rcs"], row["vr"] = rng.normal(0, 10), -u @ w
            row["x_seq"], row["y_seq"] = spot
            row["uuid"] = f"{k}-{i}".encode()
            row["track_id"] = b"abc" if i < 3 else b""
            row["label_id"] = 0 if i < 3 else 11
            points.append(row)
        scenes[str(t)] = {
            "sensor_id": number, "prev_timestamp": None, "prev_timestamp_same_sensor": None,
            "next_timestamp": int(times[k + 1]) if k < 7 else None,
            "next_timestamp_same_sensor": int(times[k + 2]) if k < 6 else None,
            "odometry_timestamp": t, "odometry_index": (t - 900_000) // 2500,
            "image_name": "none.jpg", "radar_indices": [first, len(points)],
        }  # fmt: skip
    folder.mkdir(parents=True)
    table = np.array(points, POINTS)
    with h5py.File(folder / "radar_data.h5", "w") as file:
        file["radar_data"], file["odometry"] = table, odometry
    about = {
        "sequence_name": folder.name, "category": "train", "scenes": scenes,
        "first_timestamp": int(times[0]), "last_timestamp": int(times[-1]),
    }  # fmt: skip
    (folder / "scenes.json").write_text(json.dumps(about))
    return table


def imported(folder: Path, **params: float) -> Recording:
    return radarscenes.read([folder], radarscenes.Params(**params))


def test_points_to_the_last_bit_and_empty_scans(tmp_path: Path):
    table = sequence(tmp_path / "sequence_7")
    found = imported(tmp_path / "sequence_7")
    assert found.meta.name == "sequence_7"
    assert sorted(found.streams) == ["radar_1", "radar_3"]
    for number in (1, 3):
        stream, own = found.streams[f"radar_{number}"], table[table["sensor_id"] == number]
        offset = 0 if number == 1 else 1
        times = (1_000_000 + 40_000 * np.arange(offset, 8, 2)) * 1000
        np.testing.assert_array_equal(stream.time_ns, times)
        empty = [5, 0, 5, 5] if number == 3 else [5, 5, 5, 5]
        np.testing.assert_array_equal(np.diff(stream.row_offset), empty)
        names = {"range": "range_sc", "azimuth": "azimuth_sc", "doppler": "vr"}
        for ours, theirs in names.items():
            np.testing.assert_array_equal(stream.rows[ours], own[theirs].astype(float))
        np.testing.assert_allclose(10 * np.log10(stream.rows["rcs"]), own["rcs"], rtol=1e-12)
        np.testing.assert_array_equal(stream.rows["origin_id"], np.where(own["track_id"], 0, -1))
        assert stream.scan["view_range_max"][0] == 100.0
        assert stream.scan["view_azimuth_max"][0] >= np.radians(60) - 1e-12


def test_points_lie_on_the_map_where_the_set_says(tmp_path: Path):
    """Ranges and azimuths from the radars' poses are ``x_seq, y_seq``, in single precision."""
    table = sequence(tmp_path / "s")
    found = imported(tmp_path / "s")
    for number in (1, 3):
        stream, own = found.streams[f"radar_{number}"], table[table["sensor_id"] == number]
        sensor = found.sensors[f"radar_{number}"]
        places = []
        for scan in stream.scans("radar"):
            r, a = scan.rows["range"], scan.rows["azimuth"]
            position, R = pose_at(sensor, scan.time_ns)
            local = np.column_stack([r * np.cos(a), r * np.sin(a), np.zeros(len(r))])
            places.append(position + local @ R.T)
        at = np.concatenate(places)
        np.testing.assert_allclose(at[:, 0], own["x_seq"], atol=1e-4)
        np.testing.assert_allclose(at[:, 1], own["y_seq"], atol=1e-4)


def test_doppler_of_what_stands_still_is_that_of_the_radar(tmp_path: Path):
    """Its velocity along the ray, backwards: positive is receding, and the car's speed in it."""
    sequence(tmp_path / "s")
    found = imported(tmp_path / "s")
    for name, stream in found.streams.items():
        sensor = found.sensors[name]
        for scan in stream.scans(name):
            _, R = pose_at(sensor, scan.time_ns)
            w = velocity_at(sensor, scan.time_ns)
            a = scan.rows["azimuth"]
            u = np.column_stack([np.cos(a), np.sin(a), np.zeros(len(a))]) @ R.T
            np.testing.assert_allclose(scan.rows["doppler"], -u @ w, atol=2e-2)


def test_the_truth_by_track(tmp_path: Path):
    table = sequence(tmp_path / "s")
    o = imported(tmp_path / "s").truth.objects
    np.testing.assert_array_equal(np.diff(o.row_offset), [1, 1, 1, 0, 1, 1, 1, 1])
    assert {o.class_names[k] for k in o.class_index} == {"car"}
    np.testing.assert_array_equal(o.label, np.zeros(7))
    own = table[table["track_id"] == b"abc"]
    for i, t in enumerate(np.unique(own["timestamp"])):
        mine = own[own["timestamp"] == t]
        middle = [mine["x_seq"].mean(dtype=float), mine["y_seq"].mean(dtype=float)]
        np.testing.assert_allclose(o.state[i], middle, atol=1e-4)


def test_sensors_json_tells_where_the_radars_are(tmp_path: Path):
    sequence(tmp_path / "s")
    usual = imported(tmp_path / "s").sensors["radar_1"].position
    moved = {f"radar_{k}": {"x": x + 1.0, "y": y, "yaw": a} for k, (x, y, a) in MOUNT.items()}
    (tmp_path / "sensors.json").write_text(json.dumps(moved))
    shift = np.linalg.norm(imported(tmp_path / "s").sensors["radar_1"].position - usual, axis=1)
    np.testing.assert_allclose(shift, 1.0, atol=1e-6)


def test_the_devkit_reads_the_same(tmp_path: Path):
    kit = pytest.importorskip("radar_scenes.sequence", reason="radar_scenes is not installed")
    sequence(tmp_path / "s")
    theirs = kit.Sequence.from_json(str(tmp_path / "s" / "scenes.json"))
    found = imported(tmp_path / "s")
    for scene in theirs.scenes():
        stream = found.streams[f"radar_{scene.sensor_id}"]
        k = stream.time_ns.tolist().index(scene.timestamp * 1000)
        rows = slice(stream.row_offset[k], stream.row_offset[k + 1])
        for ours, field in (("range", "range_sc"), ("azimuth", "azimuth_sc"), ("doppler", "vr")):
            np.testing.assert_array_equal(stream.rows[ours][rows], scene.radar_data[field])
    assert len(theirs) == sum(len(s) for s in found.streams.values())


def test_commands_say_what_reads_it(tmp_path: Path, capfd: pytest.CaptureFixture[str]):
    from echoset.cli.main import main

    sequence(tmp_path / "s")
    for source in (tmp_path / "s", tmp_path / "s" / "radar_data.h5"):
        for words in (["info"], ["estimate", "-e", "phd", "-o", str(tmp_path / "o.h5")]):
            assert main([words[0], str(source), *words[1:]]) == 4
            assert f"try echoset convert --from radarscenes {source} -o" in capfd.readouterr().err
    out = tmp_path / "s.h5"
    command = ["convert", "--from", "radarscenes", str(tmp_path / "s"), "-o", str(out)]
    assert main(command) == 0 and main(["validate", "--strict", str(out)]) == 0


def test_damaged_sequences_are_refused_in_a_line(tmp_path: Path):
    folder = tmp_path / "s"
    sequence(folder)
    files = "radar_data.h5", "scenes.json"
    refused_in_a_line([folder / name for name in files], lambda: imported(folder))
    for path in (folder / name for name in files):
        whole = path.read_bytes()
        path.write_bytes(whole[: len(whole) // 2])
        with pytest.raises(FormatError, match=path.name.replace(".", r"\.")):
            imported(folder)
        path.write_bytes(whole)
