"""Frames of a bag: which moves in which, and where a sensor is in the fixed one over time."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ....models.errors import FormatError
from ....models.geometry.poses import slerp
from ....models.records import Array, Sensor

FIXED = ("map", "odom", "world", "earth")
"""What the fixed frame is called if it is not told, the first that there is."""


@dataclass
class Edge:
    """Poses of a child in its parent: times [ns], places [m], quaternions x y z w."""

    parent: str
    time: list[int] = field(default_factory=list)
    place: list[tuple[float, float, float]] = field(default_factory=list)
    turn: list[tuple[float, float, float, float]] = field(default_factory=list)
    fixed: bool = False

    def arrays(self) -> tuple[Array, Array, Array]:
        """Sorted, the last of equal times."""
        time = np.array(self.time, np.int64)
        order = np.argsort(time, kind="stable")
        last = np.append(np.diff(time[order]) > 0, True)
        q = np.array(self.turn)[order[last]]
        return time[order[last]], np.array(self.place)[order[last]], q


class Frames:
    """The tree of frames, filled with transforms and odometry."""

    def __init__(self) -> None:
        self.edges: dict[str, Edge] = {}

    def add(self, parent: str, child: str, time: int, pose: Any, fixed: bool = False) -> None:
        """A pose with ``translation`` and ``rotation``, or ``position`` and ``orientation``."""
        p = getattr(pose, "translation", None) or pose.position
        q = getattr(pose, "rotation", None) or pose.orientation
        edge = self.edges.setdefault(child.lstrip("/"), Edge(parent.lstrip("/"), fixed=fixed))
        edge.time.append(time)
        edge.place.append((float(p.x), float(p.y), float(p.z)))
        edge.turn.append((float(q.x), float(q.y), float(q.z), float(q.w)))

    def fixed(self, told: str) -> str:
        """The fixed frame: the one told, or a usual one, or the only root."""
        parents = {edge.parent for edge in self.edges.values()}
        if told:
            return told.lstrip("/")
        known = parents | self.edges.keys()
        return next((name for name in FIXED if name in known), min(parents - self.edges.keys()))

    def sensor(self, name: str, fixed: str, path: object) -> Sensor:
        """The radar in the frame ``name``, its poses in the ``fixed`` one.

        Raises
        ------
        FormatError : no transforms lead there
        """
        with np.errstate(over="ignore", invalid="ignore"):
            return self._sensor(name, fixed, path)

    def _sensor(self, name: str, fixed: str, path: object) -> Sensor:
        chain: list[Edge] = []
        at = name.lstrip("/")
        while at != fixed:
            edge = self.edges.get(at)
            if edge is None or len(chain) > 100:
                reason = f"no transform leads from {name!r} to {fixed!r}: {at!r} has no parent"
                raise FormatError(path, "", f"{reason}; tell another 'frame', or 'sensors'")
            chain.append(edge)
            at = edge.parent
        known = [edge.arrays() for edge in chain]
        moving = [t for (t, _, _), edge in zip(known, chain, strict=True) if not edge.fixed]
        time = np.unique(np.concatenate(moving)) if moving else np.zeros(1, np.int64)
        place, turn = np.zeros((len(time), 3)), np.tile([0.0, 0.0, 0.0, 1.0], (len(time), 1))
        for t, p, q in known:
            q = q / np.linalg.norm(q, axis=1)[:, None]
            shift = np.column_stack([np.interp(time, t, p[:, k]) for k in range(3)])
            here = _between(time, t, q)
            place, turn = _turned(here, place) + shift, _times(here, turn)
        return Sensor("radar", time, place, turn)


def _between(time: Array, t: Array, q: Array) -> Array:
    after = np.clip(np.searchsorted(t, time), 1, max(len(t) - 1, 1))
    if len(t) == 1:
        return np.tile(q, (len(time), 1))
    share = np.clip((time - t[after - 1]) / (t[after] - t[after - 1]), 0, 1)
    return np.array(
        [slerp(q[k - 1], q[k], float(w)) for k, w in zip(after.tolist(), share, strict=True)]
    )


def _turned(q: Array, v: Array) -> Array:
    u, w = q[:, :3], q[:, 3:]
    t = 2 * np.cross(u, v)
    return np.asarray(v + w * t + np.cross(u, t))


def _times(a: Array, b: Array) -> Array:
    u, v, s, t = a[:, :3], b[:, :3], a[:, 3:], b[:, 3:]
    vector = s * v + t * u + np.cross(u, v)
    scalar = s * t - np.sum(u * v, axis=1, keepdims=True)
    q = np.concatenate([vector, scalar], axis=1)
    return np.asarray(q / np.linalg.norm(q, axis=1)[:, None])
