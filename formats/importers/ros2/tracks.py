"""``radar_msgs/RadarTracks`` as estimates: those of the tracker in a radar, scored as any are.

Places and velocities are turned into the fixed frame, with their covariances. A track is called by
its identifier, numbered in the order in which they come; classes by the names of the message's
constants, and those of makers by their number.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ....models.geometry.poses import pose_at
from ....models.records import Array, Objects, Sensor

TRACKS = "radar_msgs/RadarTracks"
STATE = ("x", "y", "z", "vx", "vy", "vz")
UNITS = ("m", "m", "m", "m s-1", "m s-1", "m s-1")
_CLASSES = {0: "none", 1: "static", 2: "dynamic"}
_UPPER = np.array([[0, 1, 2], [1, 3, 4], [2, 4, 5]])
"""Where the entries of a covariance stand in its upper triangle."""


@dataclass
class Tracks:
    """The tracks of messages, in the order in which these came."""

    time: list[int] = field(default_factory=list)
    count: list[int] = field(default_factory=list)
    label: list[int] = field(default_factory=list)
    state: list[Array] = field(default_factory=list)
    covariance: list[Array] = field(default_factory=list)
    kind: list[str] = field(default_factory=list)
    known: dict[bytes, int] = field(default_factory=dict)

    def add(self, time: int, message: Any, sensor: Sensor) -> None:
        """The tracks of a message at ``time`` [ns], in the frame of the ``sensor``."""
        place, R = pose_at(sensor, time)
        turn = np.zeros((6, 6))
        turn[:3, :3] = turn[3:, 3:] = R
        for track in message.tracks:
            p, v = track.position, track.velocity
            name = np.asarray(track.uuid.uuid, np.uint8).tobytes()
            self.label.append(self.known.setdefault(name, len(self.known)))
            own = turn @ np.array([p.x, p.y, p.z, v.x, v.y, v.z], float)
            self.state.append(own + np.append(place, np.zeros(3)))
            P = np.zeros((6, 6))
            P[:3, :3] = np.asarray(track.position_covariance, float)[_UPPER]
            P[3:, 3:] = np.asarray(track.velocity_covariance, float)[_UPPER]
            S = turn @ P @ turn.T
            self.covariance.append((S + S.T) / 2)
            code = int(track.classification)
            self.kind.append(_CLASSES.get(code, str(code)))
        self.time.append(time)
        self.count.append(len(message.tracks))

    def objects(self) -> tuple[Objects, Mapping[str, Array]]:
        """The objects in the order of time, and how many there are at each.

        Covariances that are zero throughout are none.
        """
        time = np.array(self.time, np.int64)
        m = len(self.label)
        kinds = tuple(sorted(set(self.kind)))
        P = np.array(self.covariance).reshape(m, 6, 6)
        offset = np.concatenate([[0], np.cumsum(self.count)]).astype(np.int64)
        found = Objects(
            time,
            offset,
            np.array(self.label, np.int64),
            STATE,
            UNITS,
            np.array(self.state).reshape(m, 6),
            P if P.any() else None,
            class_names=kinds,
            class_index=np.array([kinds.index(k) for k in self.kind], np.int64),
        )
        sorted_ = found.at(np.argsort(time, kind="stable"))
        return sorted_, {"cardinality_mean": np.diff(sorted_.row_offset).astype(float)}
