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

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from ....models.checks import WindowChecks
from ....models.errors import InputError, ParameterError
from ....models.parameters import suggestion
from ....models.records import Estimates, Meta, Recording
from ...leaves import content_digest, observed_digest
from ...windows import concatenate
from ..csv.mapping import load
from .bag import Bag, stamp
from .messages import described
from .params import Params
from .scans import windowed
from .surroundings import surroundings
from .topics import chosen, descriptions, legal, use
from .tracks import TRACKS, Tracks

SUMMARY = "ROS 2 bags (MCAP, sqlite3): point clouds, radar scans, ranges, transforms, any message"


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
                "use": use(t),
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
    told = descriptions(content)
    with _opened(path, params) as bag:
        streams = chosen(bag, params, told)
        sensors, truth, frame = surroundings(bag, streams, params, told)
        meta = Meta(path.stem, frame=frame, provenance=_provenance(bag, params, content))
        checks = WindowChecks(path)
        for window in windowed(bag, streams, params, told, Recording(meta, sensors, {}, truth)):
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
    told = descriptions(content)
    with _opened(path, params) as bag:
        topic = bag.topics.get(params.tracks)
        if topic is None or topic.type != TRACKS:
            kind = "is not there" if topic is None else f"is {topic.type}, not {TRACKS}"
            hint = suggestion(
                params.tracks, [t.name for t in bag.topics.values() if t.type == TRACKS]
            )
            raise ParameterError(f"tracks: the topic {params.tracks!r} {kind}{hint}")
        streams = chosen(bag, params, told) if params.topics else {}
        sensors, truth, frame = surroundings(bag, {**streams, topic.name: topic}, params, told)
        sensor = sensors.pop(legal(topic.name))
        meta = Meta(path.stem, frame=frame, provenance=_provenance(bag, params, content))
        beside = Recording(meta, sensors, {}, truth)
        if streams:
            beside = concatenate(list(windowed(bag, streams, params, told, beside)))
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
