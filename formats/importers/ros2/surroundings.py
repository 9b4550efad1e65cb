"""Where the radars of a bag are, and the truth: from all topics that are no radar's."""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ....models.errors import ParameterError
from ....models.parameters import require
from ....models.records import Objects, Sensor, Truth
from .bag import Bag, Topic, stamp
from .frames import Frames
from .params import Params
from .topics import ODOMETRY, TRANSFORMS, legal

POSES = ("geometry_msgs/PoseStamped", "geometry_msgs/PoseWithCovarianceStamped", ODOMETRY)
_log = logging.getLogger(__name__)


def surroundings(
    bag: Bag, chosen: Mapping[str, Topic], params: Params, told: Mapping[str, Any]
) -> tuple[dict[str, Sensor], Truth | None, str]:
    """The radars at their poses, the truth, and the frame that both are in."""
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
    fixed = frames.fixed(params.frame) if frames.edges else "map"
    return sensors, _truth(true, bag, params) if params.truth else None, fixed


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
