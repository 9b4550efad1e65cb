"""Importer of ROS 2 bags: radars' topics as streams, transforms as their poses, a topic as truth.

Without a mapping each topic of point clouds, radar scans or single ranges is a stream, called as
the topic. A mapping may say more of them, ::

    topics:
      /radar/points:
        columns: {power: {field: snr, unit: dB}}
        model: {p_detect: 0.9}
        sensor: [1.2, 0, 0.5]

or describe messages of any type as a text log is described: with ``topic`` for ``file``, and paths
into the messages, such as ``ranges[].distance``, for columns (:mod:`.messages`).
"""

from __future__ import annotations

import logging
from collections import abc
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from ....models.checks import WindowChecks
from ....models.errors import FormatError, InputError, ParameterError
from ....models.parameters import parameter, require, resolve, shown, suggestion
from ....models.records import (
    Array,
    Estimates,
    Meta,
    Objects,
    Recording,
    Sensor,
    Stream,
    Truth,
)
from ...leaves import content_digest, observed_digest
from ...windows import concatenate
from ..csv.mapping import load
from ..csv.units import check_unit
from .bag import Bag, Topic, stamp
from .clouds import KINDS, NAMES, Wanted, columns
from .frames import Frames
from .messages import described
from .tracks import TRACKS, Tracks

_log = logging.getLogger(__name__)
SUMMARY = "ROS 2 bags (MCAP, sqlite3): point clouds, radar scans, ranges, transforms, any message"
TRANSFORMS = "tf2_msgs/TFMessage"
ODOMETRY = "nav_msgs/Odometry"
POSES = ("geometry_msgs/PoseStamped", "geometry_msgs/PoseWithCovarianceStamped", ODOMETRY)
_ROWS = 200_000
"""Points that are kept before a window is passed on."""
_SCANS = 4096
_LATE = 10**9
"""By how much a stamp may be earlier than one before it [ns]."""


@dataclass(frozen=True, slots=True)
class Params:
    """What a bag does not say of itself."""

    mapping: Any = parameter("", "", "YAML file (or its content) that says what messages mean")
    time: str = parameter("header", "", "times of scans: header, stamps of the messages, or log")
    frame: str = parameter("", "", "the fixed frame; by default map, odom, or the only root")
    topics: tuple[str, ...] = parameter((), "", "topics that come in; by default all that can")
    truth: str = parameter("", "", "topic of the true pose of one object")
    tracks: str = parameter(
        "", "", "topic of tracks (radar_msgs/RadarTracks), which are written as estimates"
    )
    definitions: tuple[str, ...] = parameter((), "", ".msg files of types, PACKAGE/msg/TYPE.msg")
    recover: bool = parameter(False, "", "of a damaged bag, take what comes before the damage")

    def __post_init__(self) -> None:
        require(self.time in ("header", "log"), "time", "header or log", self.time)


def recognises(path: Path, head: bytes) -> bool:
    """Whether a file or folder is a bag of ROS 2."""
    if path.is_dir():
        return (path / "metadata.yaml").is_file() and any(
            any(path.glob(f"*{suffix}")) for suffix in (".mcap", ".db3", ".zstd")
        )
    return path.suffix == ".db3" or (head.startswith(b"\x89MCAP") and b"ros2" in head[:64])


def listing(path: Path) -> dict[str, Any]:
    """The topics of a bag: type, messages, messages a second, and what will become of them."""
    with Bag(path, prove=False) as bag:
        span = max(bag.duration * 1e-9, 1e-9)
        found = {
            t.name: {
                "type": t.type,
                "messages": t.count,
                "rate": round((t.count - 1) / span, 3) if t.count > 1 else None,
                "use": _use(t),
            }
            for t in bag.topics.values()
        }
    return {"kind": "bag of ROS 2", "topics": found}


def read(paths: Sequence[Path], params: Params) -> Recording | Estimates:
    """The recording in one bag, whole; or with ``tracks`` these as estimates, beside it."""
    if params.tracks:
        return _tracked(_one(paths), params)
    content, folder = load(params.mapping) if params.mapping else ({}, None)
    if content.keys() & {"kind", "streams", "columns"}:
        with _opened(_one(paths), params) as bag:
            return described(bag, content, folder, params.time)
    return concatenate(list(_whole(paths, params)))


def windows(paths: Sequence[Path], params: Params) -> Iterator[Recording] | None:
    """The recording in one bag in windows of time, one at least; None of estimates.

    Raises
    ------
    ParameterError : the mapping is wrong, or rosbags is not installed
    FormatError : the bag is damaged, or stamps are out of order
    InputError : nothing in it can come in
    """
    return None if params.tracks else _whole(paths, params)


def _whole(paths: Sequence[Path], params: Params) -> Iterator[Recording]:
    path = _one(paths)
    content, folder = load(params.mapping) if params.mapping else ({}, None)
    if content.keys() & {"kind", "streams", "columns"}:
        with _opened(path, params) as bag:
            yield described(bag, content, folder, params.time)
        return
    told = _told(content)
    with _opened(path, params) as bag:
        chosen = _chosen(bag, params, told)
        sensors, truth = _around(bag, chosen, params, told)
        meta = Meta(path.stem, provenance=_provenance(bag, params, content))
        checks = WindowChecks(path)
        for window in _windows(bag, chosen, params, told, Recording(meta, sensors, {}, truth)):
            checks.check(window)
            yield window


def _provenance(bag: Bag, params: Params, content: Mapping[str, Any]) -> dict[str, Any]:
    said = {key: getattr(params, key) for key in ("time", "frame", "truth")}
    return {
        "importer": "ros2",
        "files": bag.provenance,
        "parameters": said | ({"mapping": content} if content else {}),
    } | ({"recovered": {"messages": bag.held, "damage": bag.damage}} if bag.damage else {})


def _tracked(path: Path, params: Params) -> Estimates:
    """The tracks in a bag; the recording beside them has the truth, and radars if these are told.

    Raises
    ------
    ParameterError : the topic is not there, or has other messages
    FormatError : the bag is damaged, or a transform is missing
    """
    content, _ = load(params.mapping) if params.mapping else ({}, None)
    told = _told(content)
    with _opened(path, params) as bag:
        topic = bag.topics.get(params.tracks)
        if topic is None or topic.type != TRACKS:
            kind = "is not there" if topic is None else f"is {topic.type}, not {TRACKS}"
            hint = suggestion(
                params.tracks, [t.name for t in bag.topics.values() if t.type == TRACKS]
            )
            raise ParameterError(f"tracks: the topic {params.tracks!r} {kind}{hint}")
        chosen = _chosen(bag, params, told) if params.topics else {}
        sensors, truth = _around(bag, {**chosen, topic.name: topic}, params, told)
        sensor = sensors.pop(legal(topic.name))
        meta = Meta(path.stem, provenance=_provenance(bag, params, content))
        beside = Recording(meta, sensors, {}, truth)
        if chosen:
            beside = concatenate(list(_windows(bag, chosen, params, told, beside)))
        found = Tracks()
        for _, log, message in bag.messages({topic.name}):
            found.add(stamp(message, log, params.time), message, sensor)
    if not found.time:
        raise InputError(f"{path}: {topic.name} has no messages")
    objects, steps = found.objects()
    made = {
        "estimator": legal(topic.name),
        "parameters": {**meta.provenance["parameters"], "tracks": topic.name},
        "input": {
            "name": meta.name,
            "digest": observed_digest(beside),
            "content_digest": content_digest(beside),
        },
    }
    return Estimates(replace(meta, provenance={**meta.provenance, **made}), objects, steps, beside)


def _one(paths: Sequence[Path]) -> Path:
    if len(paths) != 1:
        raise InputError("ros2 reads one bag, a file or a folder")
    return paths[0]


def _opened(path: Path, params: Params) -> Bag:
    return Bag(path, [Path(d) for d in params.definitions], params.recover)


def _use(topic: Topic) -> str:
    if topic.type in KINDS:
        return f"stream {legal(topic.name)} ({KINDS[topic.type]})"
    if topic.type == TRACKS:
        return f"estimates, by --set tracks={topic.name}"
    if topic.type in (TRANSFORMS, ODOMETRY):
        return "poses"
    return "left out, unless it is the truth or a mapping describes it"


def legal(topic: str) -> str:
    """The name of the stream of a topic."""
    return topic.strip("/").replace("/", "_").replace("~", "_") or "radar"


def _told(content: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
    """What the mapping says of each topic."""
    for key in content:
        if key != "topics":
            raise ParameterError(f"mapping: unknown key {shown(key)}{suggestion(key, ['topics'])}")
    topics = content.get("topics", {})
    ok = isinstance(topics, abc.Mapping)
    ok = ok and all(isinstance(v, abc.Mapping) for v in topics.values())
    require(ok, "topics", "a mapping of topics to what they are", topics)
    for name, own in topics.items():
        for key, value in own.items():
            known = ("columns", "model", "sensor")
            if key not in known:
                hint = suggestion(key, known)
                raise ParameterError(f"topics.{name}: unknown key {shown(key)}{hint}")
            if key != "sensor":
                require(isinstance(value, abc.Mapping), f"topics.{name}.{key}", "a mapping", value)
        for key in own.get("columns", {}):
            if key not in NAMES:
                hint = suggestion(key, NAMES)
                raise ParameterError(f"topics.{name}.columns: unknown {shown(key)}{hint}")
    found = {}
    for name, own in topics.items():
        wanted = {k: _wanted(k, v, name) for k, v in own.get("columns", {}).items()}
        found[name] = {**own, "columns": wanted}
    return found


def _wanted(key: str, value: Any, topic: str) -> Wanted:
    where = f"topics.{topic}.columns.{key}"
    said = value if isinstance(value, abc.Mapping) else {"field": value}
    found = resolve(Wanted, (where, said))
    check_unit(found.unit, key, where)
    require(found.scale != 0, f"{where}: scale", "other than 0", found.scale)
    return found


def _chosen(bag: Bag, params: Params, told: Mapping[str, Any]) -> dict[str, Topic]:
    """The topics that become streams; what is left out is said."""
    for name in (*params.topics, *told, *([params.truth] if params.truth else [])):
        if name not in bag.topics:
            hint = suggestion(name, bag.topics)
            raise ParameterError(f"the bag has no topic {name!r}{hint}")
    wanted = params.topics or tuple(bag.topics)
    chosen = {n: t for n, t in bag.topics.items() if n in wanted and t.type in KINDS and t.count}
    if not chosen:
        types = ", ".join(f"{t.name} ({t.type})" for t in bag.topics.values()) or "no topics"
        raise InputError(f"{bag.path}: nothing of a radar in it, there are {types[:300]}")
    used = {TRANSFORMS, ODOMETRY}
    left = [
        f"{t.name} ({t.type}, {t.count})"
        for t in bag.topics.values()
        if t.name not in chosen and t.type not in used and t.name != params.truth
    ]
    if left:
        _log.warning("%s: left out %s", bag.path, ", ".join(left))
    return chosen


def _around(
    bag: Bag, chosen: Mapping[str, Topic], params: Params, told: Mapping[str, Any]
) -> tuple[dict[str, Sensor], Truth | None]:
    """The radars at their poses, and the truth, from all topics that are no radar's."""
    frames, odometry = Frames(), list[tuple[str, str, int, Any]]()
    true: list[tuple[int, Any, Any]] = []
    small = {t.name for t in bag.topics.values() if t.type in (TRANSFORMS, ODOMETRY)}
    for topic, log, message in bag.messages(small | ({params.truth} if params.truth else set())):
        kind = bag.topics[topic].type
        if topic == params.truth:
            true.append((stamp(message, log, params.time), message, kind))
        elif kind == TRANSFORMS:
            for t in message.transforms:
                time = int(t.header.stamp.sec) * 10**9 + int(t.header.stamp.nanosec)
                rest = topic.endswith("_static")
                frames.add(t.header.frame_id, t.child_frame_id, time, t.transform, rest)
        else:
            time = stamp(message, log, params.time)
            told_by = message.header.frame_id, message.child_frame_id
            odometry.append((*told_by, time, message.pose.pose))
    known = set(frames.edges)
    for parent, child, time, pose in odometry:
        if child and child.lstrip("/") not in known:
            frames.add(parent, child, time, pose)
    sensors = {}
    for name in chosen:
        first = next(iter(bag.messages({name})), None)
        frame = "" if first is None else str(first[2].header.frame_id)
        own = told.get(name, {})
        if "sensor" in own:
            place = own["sensor"]
            ok = isinstance(place, list | tuple) and len(place) in (2, 3)
            ok = ok and all(isinstance(v, int | float) for v in place)
            require(ok, f"topics.{name}.sensor", "a position [x, y] or [x, y, z]", place)
            sensors[legal(name)] = Sensor.static("radar", np.array(place, float))
        elif frames.edges:
            sensors[legal(name)] = frames.sensor(frame, frames.fixed(params.frame), bag.path)
        else:
            _log.warning("%s: no transforms: %s stands at the origin", bag.path, name)
            sensors[legal(name)] = Sensor.static("radar", np.zeros(3))
    return sensors, _truth(true, bag, params) if params.truth else None


def _truth(found: Sequence[tuple[int, Any, str]], bag: Bag, params: Params) -> Truth:
    """One object at the poses of a topic."""
    kind = bag.topics[params.truth].type
    if kind not in POSES:
        raise ParameterError(f"truth: {params.truth} is {kind}, not one of {' '.join(POSES)}")
    rows: dict[int, list[float]] = {}
    for time, message, _ in found:
        pose = message.pose if kind == POSES[0] else message.pose.pose
        rows[time] = [float(pose.position.x), float(pose.position.y), float(pose.position.z)]
    times = np.array(sorted(rows), np.int64)
    state = np.array([rows[t] for t in times.tolist()]).reshape(-1, 3)
    n = len(times)
    label, offset = np.zeros(n, np.int64), np.arange(n + 1)
    return Truth(Objects(times, offset, label, ("x", "y", "z"), ("m", "m", "m"), state))


@dataclass
class _Pending:
    """Scans of a stream that are not passed on yet."""

    time: list[int] = field(default_factory=list)
    rows: list[dict[str, Array]] = field(default_factory=list)

    def upto(self, last: int, kind: str, name: str, model: Mapping[str, Any]) -> Stream:
        """The scans up to ``last`` [ns], which are forgotten."""
        order = sorted(range(len(self.time)), key=self.time.__getitem__)
        out = [k for k in order if self.time[k] <= last]
        keys = list(self.rows[0]) if self.rows else []
        count = np.array([len(self.rows[k][keys[0]]) if keys else 0 for k in out], np.int64)
        rows = {
            key: np.concatenate([np.zeros(0), *(self.rows[k][key] for k in out)]) for key in keys
        }
        time = np.array([self.time[k] for k in out], np.int64)
        kept = [k for k in order if self.time[k] > last]
        self.time, self.rows = [self.time[k] for k in kept], [self.rows[k] for k in kept]
        offset = np.concatenate([[0], np.cumsum(count)]).astype(np.int64)
        return Stream(kind, (name,), model, time, offset, {}, rows)


def _windows(
    bag: Bag,
    chosen: Mapping[str, Topic],
    params: Params,
    told: Mapping[str, Any],
    head: Recording,
) -> Iterator[Recording]:
    """Windows with the scans, the truth of their times, and all that ``head`` says."""
    pending = {name: _Pending() for name in chosen}
    keys: dict[str, list[str]] = {}
    held, scans, newest, given = 0, 0, -(1 << 62), -(1 << 62)
    dropped: dict[str, int] = {}

    def window(last: int) -> Recording:
        streams = {}
        for name, topic in chosen.items():
            model = told.get(name, {}).get("model", {})
            stream = pending[name].upto(last, KINDS[topic.type], legal(name), model)
            if not stream.rows:
                empty = {key: np.zeros(0) for key in keys.get(name, _least(topic))}
                stream = replace(stream, rows=empty)
            streams[legal(name)] = stream
        return replace(head, streams=streams, truth=_part(head.truth, given, last))

    for name, log, message in bag.messages(set(chosen)):
        time = stamp(message, log, params.time)
        wanted = told.get(name, {}).get("columns", {})
        rows, nan = columns(chosen[name].type, message, wanted, bag.path)
        if nan:
            dropped[name] = dropped.get(name, 0) + nan
        if list(rows) != keys.setdefault(name, list(rows)):
            raise FormatError(bag.path, name, f"fields change at {time} ns: {' '.join(rows)}")
        if time <= given:
            reason = f"the stamp {time} ns is more than {_LATE / 1e9:g} s before others"
            raise FormatError(bag.path, name, f"{reason}: take log times by time=log")
        pending[name].time.append(time)
        pending[name].rows.append(rows)
        held, scans, newest = held + len(rows[keys[name][0]]), scans + 1, max(newest, time)
        if (held >= _ROWS or scans >= _SCANS) and newest - _LATE > given:
            yield window(newest - _LATE)
            given = newest - _LATE
            held = sum(len(next(iter(r.values()))) for p in pending.values() for r in p.rows)
            scans = sum(len(p.time) for p in pending.values())
    for name, count in dropped.items():
        _log.warning("%s: %s: left out %d points that are not finite", bag.path, name, count)
    yield window(1 << 62)


def _least(topic: Topic) -> tuple[str, ...]:
    return ("x", "y") if KINDS[topic.type] == "position" else ("range", "azimuth")


def _part(truth: Truth | None, after: int, last: int) -> Truth | None:
    if truth is None:
        return None
    time = truth.objects.time_ns
    start, stop = np.searchsorted(time, [after, last], "right").tolist()
    return Truth(truth.objects.part(start, stop))
