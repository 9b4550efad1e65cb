"""Bags of ROS 2, written by rosbags in the published layout, and read back."""

from __future__ import annotations

import os
import sqlite3
import sys
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.writer import Writer as McapWriter

from echoset.formats.importers import ros2
from echoset.models.errors import EchosetError, FormatError, InputError, ParameterError
from echoset.models.records import Recording

rosbags = pytest.importorskip("rosbags.rosbag2", reason="the extra echoset[ros] is not installed")
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer  # noqa: E402
from rosbags.typesys import Stores, get_types_from_msg, get_typestore  # noqa: E402

STORE = get_typestore(Stores.ROS2_HUMBLE)
STORE.register(
    get_types_from_msg(
        "float32 range\nfloat32 azimuth\nfloat32 elevation\nfloat32 doppler_velocity\n"
        "float32 amplitude\n",
        "radar_msgs/msg/RadarReturn",
    )
    | get_types_from_msg(
        "std_msgs/Header header\nradar_msgs/RadarReturn[] returns\n", "radar_msgs/msg/RadarScan"
    )
    | get_types_from_msg(
        "unique_identifier_msgs/UUID uuid\ngeometry_msgs/Point position\n"
        "geometry_msgs/Vector3 velocity\ngeometry_msgs/Vector3 acceleration\n"
        "geometry_msgs/Vector3 size\nuint16 classification\nfloat32[6] position_covariance\n"
        "float32[6] velocity_covariance\nfloat32[6] acceleration_covariance\n"
        "float32[6] size_covariance\n",
        "radar_msgs/msg/RadarTrack",
    )
    | get_types_from_msg(
        "std_msgs/Header header\nradar_msgs/RadarTrack[] tracks\n", "radar_msgs/msg/RadarTracks"
    )
    | get_types_from_msg("string id\nfloat32 distance\nfloat32 rssi\n", "tags/msg/Range")
    | get_types_from_msg("std_msgs/Header header\ntags/Range[] ranges\n", "tags/msg/Ranges")
)
T0 = 1_700_000_000 * 10**9


def make(kind: str, **fields: Any) -> Any:
    return STORE.types[kind](**fields)


def header(time: int, frame: str) -> Any:
    stamp = make("builtin_interfaces/msg/Time", sec=time // 10**9, nanosec=time % 10**9)
    return make("std_msgs/msg/Header", stamp=stamp, frame_id=frame)


def cloud(time: int, points: np.ndarray, frame: str = "radar", order: str = "<") -> Any:
    """Points (n, 5), x y z vel snr, with four bytes between z and vel that mean nothing."""
    names = ("x", "y", "z", "vel", "snr")
    offsets = (0, 4, 8, 16, 20)
    kind = np.dtype(
        {"names": names, "formats": [f"{order}f4"] * 5, "offsets": offsets, "itemsize": 24}
    )
    data = np.zeros(len(points), kind)
    for k, name in enumerate(names):
        data[name] = points[:, k]
    fields = [
        make("sensor_msgs/msg/PointField", name=n, offset=o, datatype=7, count=1)
        for n, o in zip(names, offsets, strict=True)
    ]
    return make(
        "sensor_msgs/msg/PointCloud2", header=header(time, frame), height=1, width=len(points),
        fields=fields, is_bigendian=order == ">", point_step=24, row_step=24 * len(points),
        data=np.frombuffer(data.tobytes(), np.uint8), is_dense=False,
    )  # fmt: skip


def transform(time: int, parent: str, child: str, p: Any, q: Any) -> Any:
    vector = make("geometry_msgs/msg/Vector3", x=float(p[0]), y=float(p[1]), z=float(p[2]))
    turn = make("geometry_msgs/msg/Quaternion", x=q[0], y=q[1], z=q[2], w=q[3])
    pose = make("geometry_msgs/msg/Transform", translation=vector, rotation=turn)
    return make(
        "geometry_msgs/msg/TransformStamped",
        header=header(time, parent),
        child_frame_id=child,
        transform=pose,
    )


def pose(time: int, x: float, y: float) -> Any:
    at = make("geometry_msgs/msg/Point", x=x, y=y, z=0.5)
    turn = make("geometry_msgs/msg/Quaternion", x=0.0, y=0.0, z=0.0, w=1.0)
    body = make("geometry_msgs/msg/Pose", position=at, orientation=turn)
    return make("geometry_msgs/msg/PoseStamped", header=header(time, "map"), pose=body)


def write(
    path: Path,
    messages: list[tuple[str, int, Any]],
    plugin: Any = StoragePlugin.MCAP,
    mode: Any = None,
) -> Path:
    with_mode = Writer(path, version=9, storage_plugin=plugin)
    if mode is not None:
        with_mode.set_compression(mode, CompressionFormat.ZSTD)
    with with_mode as writer:
        known: dict[str, Any] = {}
        for topic, time, message in messages:
            kind = message.__msgtype__
            if topic not in known:
                known[topic] = writer.add_connection(topic, kind, typestore=STORE)
            writer.write(known[topic], time, STORE.serialize_cdr(message, kind))
    return path


RNG = np.random.default_rng(3)
POINTS = [RNG.normal(0, 20, (n, 5)).astype(np.float32) for n in (3, 0, 5, 2)]
POINTS[2][1, 3] = np.nan


def drive(order: str = "<") -> list[tuple[str, int, Any]]:
    """A car at 10 m/s eastwards, its radar 2 m ahead of its centre, turned to the left."""
    half = 0.5**0.5
    out = [
        ("/tf_static", T0, make(
            "tf2_msgs/msg/TFMessage",
            transforms=[transform(T0, "base_link", "radar", (2, 0, 1), (0.0, 0.0, half, half))],
        ))
    ]  # fmt: skip
    for k in range(5):
        time = T0 + k * 10**8
        moved = transform(time, "map", "base_link", (k, 0, 0), (0.0, 0.0, 0.0, 1.0))
        out.append(("/tf", time + 10**6, make("tf2_msgs/msg/TFMessage", transforms=[moved])))
        out.append(("/truth", time + 10**6, pose(time, 3.0 * k, 1.0)))
        if k < 4:
            at = time + 5 * 10**7
            out.append(("/radar/points", at + 7, cloud(at, POINTS[k], order=order)))
    return out


def imported(path: Path, **params: Any) -> Recording:
    return ros2.read([path], ros2.Params(**params))


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize(
    ("plugin", "mode"),
    [
        (StoragePlugin.MCAP, None),
        (StoragePlugin.MCAP, CompressionMode.STORAGE),
        (StoragePlugin.MCAP, CompressionMode.FILE),
        (StoragePlugin.MCAP, CompressionMode.MESSAGE),
        (StoragePlugin.SQLITE3, None),
        (StoragePlugin.SQLITE3, CompressionMode.FILE),
        (StoragePlugin.SQLITE3, CompressionMode.MESSAGE),
    ],
)
def test_clouds_on_a_car(tmp_path: Path, plugin: Any, mode: Any, order: str, caplog):
    bag = write(tmp_path / "bag", drive(order), plugin, mode)
    power = {"power": {"field": "snr", "unit": "dB"}}
    said = {"topics": {"/radar/points": {"columns": power}}}
    found = imported(bag, truth="/truth", mapping=said)
    stream = found.streams["radar_points"]
    assert stream.kind == "position" and stream.nodes == ("radar_points",)
    time = T0 + np.arange(4) * 10**8 + 5 * 10**7
    np.testing.assert_array_equal(stream.time_ns, time)
    np.testing.assert_array_equal(np.diff(stream.row_offset), [3, 0, 4, 2])
    assert "left out 1 points that are not finite" in caplog.text
    whole = np.concatenate([POINTS[0], np.delete(POINTS[2], 1, 0), POINTS[3]])
    np.testing.assert_allclose(stream.rows["power"], 10 ** (whole[:, 4] / 10.0), rtol=1e-6)
    for k, name in enumerate(("x", "y", "z", "doppler")):
        np.testing.assert_array_equal(stream.rows[name], np.float64(whole[:, k]))
    # The radar at the times of transforms: car and its own place; turned to the left throughout.
    sensor = found.sensors["radar_points"]
    np.testing.assert_array_equal(sensor.time_ns, T0 + np.arange(5) * 10**8)
    np.testing.assert_allclose(sensor.position, [[k + 2, 0, 1] for k in range(5)], atol=1e-12)
    np.testing.assert_allclose(sensor.quaternion[:, 2:], 0.5**0.5, atol=1e-12)
    o = found.truth.objects
    np.testing.assert_array_equal(o.state, [[3.0 * k, 1.0, 0.5] for k in range(5)])
    log = imported(bag, time="log").streams["radar_points"]
    np.testing.assert_array_equal(log.time_ns, time + 7)


def test_scans_of_returns_and_single_ranges(tmp_path: Path):
    returns = [
        make("radar_msgs/msg/RadarReturn", range=10.0, azimuth=0.25, elevation=0.125,
             doppler_velocity=-1.5, amplitude=20.0)
    ]  # fmt: skip
    scan = make("radar_msgs/msg/RadarScan", header=header(T0, "r"), returns=returns)
    near = [
        make("sensor_msgs/msg/Range", header=header(T0 + k, "u"), radiation_type=0,
             field_of_view=0.5, min_range=0.25, max_range=4.0, range=value)
        for k, value in enumerate((1.5, float("inf"), 9.0))
    ]  # fmt: skip
    messages = [("/scan", T0, scan), *(("/sonar", T0 + k, m) for k, m in enumerate(near))]
    found = imported(write(tmp_path / "bag", messages))
    rows = found.streams["scan"].rows
    assert [rows[k][0] for k in ("range", "azimuth", "elevation", "doppler")] == [
        10.0, 0.25, 0.125, -1.5,
    ]  # fmt: skip
    assert rows["power"][0] == pytest.approx(100.0)
    sonar = found.streams["sonar"]
    np.testing.assert_array_equal(np.diff(sonar.row_offset), [1, 0, 0])
    assert sonar.rows["range"].tolist() == [1.5]
    assert sonar.rows["std_azimuth"][0] == pytest.approx(0.5 / 12**0.5)


def track(name: int, place: Any, speed: Any, kind: int) -> Any:
    """A track whose place varies by 4, 1 and 0.25 m2 along x, y and z, x with y by 1."""
    point, vector = "geometry_msgs/msg/Point", "geometry_msgs/msg/Vector3"
    still = make(vector, x=0.0, y=0.0, z=0.0)
    return make(
        "radar_msgs/msg/RadarTrack",
        uuid=make("unique_identifier_msgs/msg/UUID", uuid=np.full(16, name, np.uint8)),
        position=make(point, x=place[0], y=place[1], z=0.0),
        velocity=make(vector, x=speed[0], y=speed[1], z=0.0), acceleration=still, size=still,
        classification=kind, position_covariance=np.array([4, 1, 0, 1, 0, 0.25], np.float32),
        velocity_covariance=np.array([1, 0, 0, 1, 0, 1], np.float32),
        acceleration_covariance=np.zeros(6, np.float32), size_covariance=np.zeros(6, np.float32),
    )  # fmt: skip


def test_tracks_are_estimates(tmp_path: Path, capfd: pytest.CaptureFixture[str]):
    """The radar looks to the left of a car that drives east, 2 m ahead of its middle."""
    from echoset import formats
    from echoset.cli.main import main
    from echoset.models.records import Estimates

    messages = [m for m in drive() if m[0] != "/radar/points"]
    for k in range(4):
        time = T0 + k * 10**8 + 5 * 10**7
        found = [
            track(
                7,
                (
                    1.0,
                    -3.0 * (k + 0.5) + k + 2.5,
                ),
                (0.5, -30.0),
                32001,
            )
        ]
        found += [track(9, (5.0, 0.0), (0.0, 0.0), 1)] if k == 2 else []
        told = make("radar_msgs/msg/RadarTracks", header=header(time, "radar"), tracks=found)
        messages.append(("/radar/tracks", time, told))
    bag = write(tmp_path / "bag", sorted(messages, key=lambda m: m[1]))
    assert main(["info", str(bag)]) == 0
    assert "estimates, by --set tracks=/radar/tracks" in capfd.readouterr().out
    out = tmp_path / "tracks.h5"
    settings = ["--set", "tracks=/radar/tracks", "--set", "truth=/truth"]
    assert main(["convert", "--from", "ros2", str(bag), *settings, "-o", str(out)]) == 0
    assert main(["validate", str(out)]) == 0
    record = formats.read(out)
    assert isinstance(record, Estimates) and record.estimator == "radar_tracks"
    o = record.objects
    np.testing.assert_array_equal(o.row_offset, [0, 1, 2, 4, 5])
    np.testing.assert_array_equal(o.label, [0, 0, 0, 1, 0])
    assert [o.class_names[k] for k in o.class_index] == ["32001"] * 3 + ["static", "32001"]
    # x of the radar is north, y is west: the first is where the truth is, a metre to the north.
    first = o.label == 0
    x = 3.0 * (np.arange(4) + 0.5)
    np.testing.assert_allclose(o.state[first][:, 0], x, atol=1e-9)
    np.testing.assert_allclose(o.state[first][:, 1], 1.0, atol=1e-9)
    np.testing.assert_allclose(o.state[first][:, 3:5], np.tile([30.0, 0.5], (4, 1)), atol=1e-9)
    np.testing.assert_allclose(
        o.covariance[0][:3, :3], [[1, -1, 0], [-1, 4, 0], [0, 0, 0.25]], atol=1e-9
    )
    assert main(["score", str(out), "-m", "gospa", "-o", "-"]) == 0
    scores = capfd.readouterr().out
    assert "radar_tracks,gospa" in scores
    with pytest.raises(ParameterError, match=r"tracks: the topic '/truth' is geometry_msgs"):
        imported(bag, tracks="/truth")
    with pytest.raises(ParameterError, match=r"'/radar/track' is not there .did you mean"):
        imported(bag, tracks="/radar/track")


def test_any_message_by_paths(tmp_path: Path):
    """Ranges of a tag in messages of a type of its own, and its truth from another topic."""

    def ranges(k: int) -> Any:
        found = [
            make("tags/msg/Range", id=name, distance=1500.0 + 250 * k + j, rssi=-80.0 + 30 * j)
            for j, name in enumerate("AB")
        ]
        return make("tags/msg/Ranges", header=header(T0 + k * 10**8, "t"), ranges=found)

    messages: list[tuple[str, int, Any]] = []
    for k in range(3):
        messages.append(("/uwb", T0 + k * 10**8, ranges(k)))
        messages.append(("/truth", T0 + k * 10**8, pose(T0 + k * 10**8, 0.5 * k, 1.0)))
    said = {
        "kind": "uwb",
        "topic": "/uwb",
        "columns": {
            "time": "time",
            "anchor": "ranges[].id",
            "distance": {"column": "ranges[].distance", "unit": "mm"},
        },
        "skip": "`ranges[].rssi` > -60 and anchor == 'A'",
        "anchors": {"A": [0, 0], "B": [4, 0]},
        "truth": {
            "topic": "/truth",
            "columns": {
                "time": "time", "device_x": "pose.position.x", "device_y": "pose.position.y"
            },
        },
    }  # fmt: skip
    found = imported(write(tmp_path / "bag", messages), mapping=said)
    assert found.meta.name == "bag"
    stream = found.streams["uwb"]
    np.testing.assert_array_equal(stream.time_ns, T0 + np.repeat([0, 1, 2], 2) * 10**8)
    np.testing.assert_allclose(
        stream.rows["distance"], [1.5, 1.501, 1.75, 1.751, 2.0, 2.001], rtol=1e-12
    )
    np.testing.assert_array_equal(found.truth.objects.state, [[0.5 * k, 1.0] for k in range(3)])
    wrong = {**said, "columns": {**said["columns"], "distance": "ranges[].dist"}}
    with pytest.raises(ParameterError, match=r"/uwb .*did you mean 'distance'"):
        imported(tmp_path / "bag", mapping=wrong)


def test_types_that_the_bag_does_not_define(tmp_path: Path):
    """Old bags have no definitions, and then ``.msg`` files tell them."""
    ranges = [make("tags/msg/Range", id="A", distance=1.5, rssi=-80.0)]
    message = make("tags/msg/Ranges", header=header(T0, "t"), ranges=ranges)
    bag = write(tmp_path / "bag", [("/uwb", T0, message)], StoragePlugin.SQLITE3)
    with closing(sqlite3.connect(bag / "bag.db3")) as database:
        database.execute("DELETE FROM message_definitions")
        database.commit()
    columns = {"time": "time", "anchor": "ranges[].id", "distance": "ranges[].distance"}
    said = {"kind": "uwb", "topic": "/uwb", "columns": columns, "anchors": {"A": [0, 0]}}
    with pytest.raises(ParameterError, match=r"tags/Ranges is not defined in the bag: .*definit"):
        imported(bag, mapping=said)
    folder = tmp_path / "tags" / "msg"
    folder.mkdir(parents=True)
    (folder / "Range.msg").write_text("string id\nfloat32 distance\nfloat32 rssi\n")
    (folder / "Ranges.msg").write_text("std_msgs/Header header\nRange[] ranges\n")
    told = (str(folder / "Range.msg"), str(folder / "Ranges.msg"))
    found = imported(bag, mapping=said, definitions=told)
    assert found.streams["uwb"].rows["distance"].tolist() == [1.5]
    (folder / "Range.msg").write_text("string id\nfloat distance\n")
    with pytest.raises(ParameterError, match=r"the type tags/msg/float is not defined: tell its"):
        imported(bag, mapping=said, definitions=told)


def test_the_frame_of_the_bag_is_that_of_the_recording(tmp_path: Path):
    """So that viewers show both in one frame, whatever it is called."""
    bag = write(tmp_path / "bag", drive())
    assert imported(bag).meta.frame == "map"
    moved = [
        m if m[0] != "/tf" else (m[0], m[1], make("tf2_msgs/msg/TFMessage", transforms=[
            transform(T0, "odom", "base_link", (1, 2, 3), (0.0, 0.0, 0.0, 1.0))
        ]))
        for m in drive()
    ]  # fmt: skip
    found = imported(write(tmp_path / "other", moved))
    assert found.meta.frame == "odom"
    np.testing.assert_allclose(found.sensors["radar_points"].position, [[3, 2, 4]])


def test_a_missing_transform_is_named(tmp_path: Path):
    messages = [m for m in drive() if m[0] != "/tf_static"]
    with pytest.raises(FormatError, match=r"no transform leads from 'radar' to 'map'"):
        imported(write(tmp_path / "bag", messages))
    found = imported(
        tmp_path / "bag", mapping={"topics": {"/radar/points": {"sensor": [1.0, 2.0, 3.0]}}}
    )
    np.testing.assert_array_equal(found.sensors["radar_points"].position, [[1.0, 2.0, 3.0]])


@pytest.mark.parametrize(
    ("params", "error", "message"),
    [
        ({"topics": ("/radar",)}, ParameterError, "no topic '/radar'"),
        ({"topics": ("/truth",)}, InputError, "nothing of a radar"),
        ({"truth": "/tf"}, ParameterError, "/tf is tf2_msgs/TFMessage"),
        ({"time": "stamp"}, ParameterError, "time must be header or log"),
        ({"mapping": {"topic": {}}}, ParameterError, "unknown key 'topic'.*'topics'"),
        (
            {"mapping": {"topics": {"/radar/points": {"columns": {"doppler": "v"}}}}},
            ParameterError,
            "'v' is no field of the points: x y z vel snr",
        ),
    ],
)
def test_what_cannot_be_is_refused(tmp_path: Path, params, error, message):
    bag = write(tmp_path / "bag", drive())
    with pytest.raises(error, match=message):
        imported(bag, **params)


def test_windows_are_the_whole(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """Scans late by less than a second are sorted, whatever the windows."""
    from echoset.formats.importers.ros2 import scans

    rng = np.random.default_rng(1)
    messages: list[tuple[str, int, Any]] = []
    for k in range(60):
        stamp = T0 + k * 10**8 + int(rng.integers(-3, 3)) * 10**8 + k
        points = rng.normal(0, 5, (int(rng.integers(0, 4)), 5)).astype(np.float32)
        messages.append(("/a", T0 + (k + 9) * 10**8, cloud(stamp, points)))
    bag = write(tmp_path / "bag", messages)
    whole = imported(bag)
    monkeypatch.setattr(scans, "_SCANS", 15)
    parts = list(ros2.windows([bag], ros2.Params()))
    assert len(parts) > 3
    for a, b in zip(
        (whole.streams["a"].time_ns, whole.streams["a"].rows["x"]),
        (
            np.concatenate([p.streams["a"].time_ns for p in parts]),
            np.concatenate([p.streams["a"].rows["x"] for p in parts]),
        ),
        strict=True,
    ):
        np.testing.assert_array_equal(a, b)
    messages.append(("/a", T0 + 90 * 10**8, cloud(T0, np.zeros((1, 5), np.float32))))
    late = write(tmp_path / "late", messages)
    with pytest.raises(FormatError, match="take log times by time=log"):
        imported(late)


def clouds(count: int) -> list[tuple[str, int, Any]]:
    """Clouds of 40 points that all have the number of the cloud as coordinates."""
    points = [np.full((40, 5), float(k), np.float32) for k in range(count)]
    return [("/a", T0 + k * 10**7, cloud(T0 + k * 10**7, p)) for k, p in enumerate(points)]


def checked(bag: Path, out: Path, per_chunk: int) -> bytes:
    """The messages of a bag in a file with all checksums, as recorders write it."""
    with out.open("wb") as file, (next(bag.glob("*.mcap"))).open("rb") as source:
        writer = McapWriter(file, chunk_size=per_chunk, enable_data_crcs=True)
        writer.start("ros2", "test")
        channels: dict[str, int] = {}
        for schema, channel, message in make_reader(source).iter_messages():
            if channel.topic not in channels:
                known = writer.register_schema(schema.name, schema.encoding, schema.data)
                channels[channel.topic] = writer.register_channel(channel.topic, "cdr", known)
            at = message.log_time
            writer.add_message(channels[channel.topic], at, message.data, at)
        writer.finish()
    return out.read_bytes()


@pytest.mark.parametrize("count", [60, pytest.param(1100, marks=pytest.mark.verification)])
def test_damaged_bags_with_checksums(tmp_path: Path, count: int):
    """Cut or changed anywhere: refused in a line; with ``recover``, the messages before it."""
    data = checked(write(tmp_path / "bag", clouds(100)), tmp_path / "whole.mcap", 5000)
    whole = imported(tmp_path / "whole.mcap").streams["a"]
    rng = np.random.default_rng(5)
    broken = tmp_path / "broken.mcap"
    part = 0
    for k in range(count):
        if k % 11 == 0:
            broken.write_bytes(data[: int(rng.integers(len(data)))])
        else:
            changed = bytearray(data)
            changed[int(rng.integers(len(data)))] ^= int(rng.integers(1, 256))
            broken.write_bytes(changed)
        try:
            found = imported(broken).streams["a"]
            # What is not covered by a checksum says nothing: the library's name, say.
            np.testing.assert_array_equal(found.rows["x"], whole.rows["x"])
            np.testing.assert_array_equal(found.time_ns, whole.time_ns)
        except EchosetError as error:
            assert "\n" not in str(error)
        try:
            found = imported(broken, recover=True)
            stream = found.streams["a"]
            np.testing.assert_array_equal(stream.time_ns, whole.time_ns[: len(stream)])
            m = stream.row_offset[-1]
            np.testing.assert_array_equal(stream.rows["x"], whole.rows["x"][:m])
            part += len(stream) < len(whole)
        except EchosetError as error:
            assert "\n" not in str(error)
    assert part > count / 3


@pytest.mark.parametrize("plugin", [StoragePlugin.MCAP, StoragePlugin.SQLITE3])
@pytest.mark.parametrize("count", [15, pytest.param(1100, marks=pytest.mark.verification)])
def test_damaged_bags_without_checksums(tmp_path: Path, plugin: Any, count: int):
    """Numbers may be others, since nothing tells; all else is refused in a line."""
    bag = write(tmp_path / "bag", drive(), plugin)
    (file,) = (p for p in bag.iterdir() if p.suffix in (".mcap", ".db3"))
    data = file.read_bytes()
    rng = np.random.default_rng(5)
    broken = tmp_path / f"broken{file.suffix}"
    for k in range(count):
        if k % 11 == 0:
            broken.write_bytes(data[: int(rng.integers(len(data)))])
        else:
            changed = bytearray(data)
            changed[int(rng.integers(len(data)))] ^= int(rng.integers(1, 256))
            broken.write_bytes(changed)
        for recover in (False, True):
            try:
                imported(broken, recover=recover)
            except EchosetError as error:
                assert "\n" not in str(error)


@pytest.mark.parametrize("plugin", [StoragePlugin.MCAP, StoragePlugin.SQLITE3])
def test_a_bag_that_was_cut(tmp_path: Path, plugin: Any, capfd: pytest.CaptureFixture[str]):
    """The commands: exit code 4 and no output, or what is whole and exit code 3."""
    from echoset import formats
    from echoset.cli.main import main

    bag = write(tmp_path / "bag", clouds(400), plugin)
    if plugin == StoragePlugin.MCAP:
        path = tmp_path / "cut.mcap"
        checked(bag, path, 20_000)
    else:
        path = tmp_path / "cut.db3"
        path.write_bytes((bag / "bag.db3").read_bytes())
    os.truncate(path, path.stat().st_size * 6 // 10)
    out = tmp_path / "a.h5"
    command = ["convert", "--from", "ros2", str(path), "-o", str(out)]
    assert main(command) == 4 and not out.exists()
    assert capfd.readouterr().err.count("\n") == 1
    assert main([*command, "--recover"]) == 3
    assert "recovered" in capfd.readouterr().err
    record = formats.read(out)
    stream, told = record.streams["a"], record.meta.provenance["recovered"]
    assert 100 < len(stream) == told["messages"] < 400 and told["damage"]
    np.testing.assert_array_equal(stream.rows["x"], np.repeat(np.arange(len(stream)), 40))
    assert main(["validate", "--strict", str(out)]) == 0
    whole = ["convert", "--from", "ros2", str(bag), "-o", str(out), "--overwrite", "--recover"]
    assert main(whole) == 0
    assert "recovered" not in formats.read(out).meta.provenance


@pytest.mark.verification
def test_a_long_bag_takes_little_memory(tmp_path: Path):
    """A GiB of points in a process of its own, whose most resident memory the system tells."""
    noise = np.random.default_rng(1).normal(0, 20, (4000, 5)).astype(np.float32)
    count = 2**30 // (24 * len(noise))
    kind = "sensor_msgs/msg/PointCloud2"
    with Writer(tmp_path / "bag", version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        connection = writer.add_connection("/a", kind, typestore=STORE)
        for k in range(count):
            at = T0 + k * 10**8
            writer.write(connection, at, STORE.serialize_cdr(cloud(at, noise), kind))
    text = "import sys; from echoset.cli.main import main; sys.exit(main(sys.argv[1:]))"
    words = ["convert", "--from", "ros2", str(tmp_path / "bag"), "-o", str(tmp_path / "a.h5")]
    pid = os.spawnv(os.P_NOWAIT, sys.executable, [sys.executable, "-c", text, *words])
    _, status, usage = os.wait4(pid, 0)
    assert status == 0
    assert usage.ru_maxrss <= 400 * 1024


def test_without_rosbags_the_command_that_installs_it_is_said(tmp_path: Path, monkeypatch):
    bag = write(tmp_path / "bag", drive())
    monkeypatch.setitem(sys.modules, "rosbags.rosbag2", None)
    with pytest.raises(ParameterError, match=r"pip install 'echoset\[ros\]'"):
        imported(bag)


def test_the_commands(tmp_path: Path, capfd: pytest.CaptureFixture[str]):
    from echoset.cli.main import main

    bag = write(tmp_path / "bag", drive())
    assert main(["info", str(bag)]) == 0
    out = capfd.readouterr().out
    assert "bag: bag of ROS 2" in out
    assert "/radar/points" in out and "4 messages" in out and "stream radar_points" in out
    for suffix in ("h5", "mcap"):
        target = tmp_path / f"a.{suffix}"
        assert main(["convert", "--from", "ros2", str(bag), "-o", str(target)]) == 0
        assert main(["validate", "--strict", str(target)]) == 0
    # Viewers show it over the bag's own times: those of the headers.
    with (tmp_path / "a.mcap").open("rb") as made:
        told = make_reader(made).iter_messages(topics="/radar/radar_points/detections")
        stamps = [message.log_time for _, _, message in told]
    assert stamps == [T0 + k * 10**8 + 5 * 10**7 for k in range(4)]
    (file,) = bag.glob("*.mcap")
    assert main(["validate", str(file)]) == 4
    assert "try echoset convert --from ros2" in capfd.readouterr().err
    broken = tmp_path / "b.mcap"
    broken.write_bytes(file.read_bytes()[:3000])
    assert main(["convert", "--from", "ros2", str(broken), "-o", str(tmp_path / "b.h5")]) == 4
    assert not (tmp_path / "b.h5").exists()
    assert capfd.readouterr().err.count("error:") == 1
