"""What MCAP files hold for the eye only: sensor frames and objects as shapes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from foxglove_schemas_protobuf.FrameTransform_pb2 import FrameTransform
from foxglove_schemas_protobuf.Grid_pb2 import Grid
from foxglove_schemas_protobuf.PointCloud_pb2 import PointCloud
from foxglove_schemas_protobuf.SceneEntityDeletion_pb2 import SceneEntityDeletion
from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate

from ....models.records import Array, Objects, Sensor
from ..tables import serialize, timestamp

MESSAGES: dict[str, Any] = {
    "foxglove.FrameTransform": FrameTransform,
    "foxglove.Grid": Grid,
    "foxglove.PointCloud": PointCloud,
    "foxglove.SceneUpdate": SceneUpdate,
}
COLOURS = {"truth": (0.0, 0.45, 0.70, 0.5), "estimates": (0.90, 0.62, 0.0, 0.5)}
POINT, _HEIGHT, _LETTERS = 0.1, 0.1, 14.0
"""Sizes of what has none of its own [m], and of letters [pixels]."""


def transforms(sensors: Mapping[str, Sensor], frame: str) -> Iterator[tuple[int, bytes]]:
    """Times and messages of all sensor poses, sensor by sensor."""
    for name, sensor in sensors.items():
        for t, p, q in zip(
            sensor.time_ns.tolist(),
            sensor.position.tolist(),
            sensor.quaternion.tolist(),
            strict=True,
        ):
            message = FrameTransform(
                timestamp=timestamp(t), parent_frame_id=frame, child_frame_id=name
            )
            message.translation.x, message.translation.y, message.translation.z = p
            r = message.rotation
            r.x, r.y, r.z, r.w = q
            yield t, serialize(message)


def sensors(known: Mapping[str, Sensor]) -> Iterator[tuple[int, bytes]]:
    """One message with all sensors whose pose is known, as named cubes that move with them."""
    placed = {name: s for name, s in known.items() if len(s.time_ns)}
    if not placed:
        return
    start = min(int(s.time_ns[0]) for s in placed.values())
    update = SceneUpdate()
    for name in placed:
        entity = update.entities.add(
            timestamp=timestamp(start), frame_id=name, id=f"sensor-{name}", frame_locked=True
        )
        cube = entity.cubes.add()
        cube.pose.orientation.w = 1.0
        cube.size.x = cube.size.y = cube.size.z = 2 * POINT
        cube.color.a = 1.0
        _label(entity, name, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))
    yield start, serialize(update)


def shapes(objects: Objects, frame: str, kind: str) -> Iterator[tuple[int, bytes]]:
    """Times and messages of the objects as flat ellipses or ellipsoids, devices as points.

    Each message takes away what the one before has drawn: an object stays until the next step,
    however long that takes, and no longer.
    """
    found = places(objects)
    for k, t in enumerate(objects.time_ns.tolist()):
        update = SceneUpdate()
        update.deletions.add(timestamp=timestamp(t), type=SceneEntityDeletion.ALL)
        for row in range(objects.row_offset[k], objects.row_offset[k + 1]):
            entity = update.entities.add(
                timestamp=timestamp(t), frame_id=frame, id=f"{kind}-{objects.label[row]}"
            )
            for place, xyz in found.items():
                sphere = entity.spheres.add()
                at = sphere.pose.position
                at.x, at.y, at.z = xyz[row].tolist()
                sphere.size.x = sphere.size.y = sphere.size.z = POINT
                sphere.pose.orientation.w = 1.0
                if place == "centre" and objects.semi_axes is not None:
                    _stretch(sphere, objects, row)
                sphere.color.r, sphere.color.g, sphere.color.b, sphere.color.a = COLOURS[kind]
            if "centre" in found:
                label = str(objects.label[row])
                _label(entity, label, found["centre"][row].tolist(), COLOURS[kind])
        yield t, serialize(update)


def places(objects: Objects) -> dict[str, Array]:
    """Positions (m, 3) [m] of the parts of the objects that have one: ``centre``, ``device``."""
    found = {}
    for name, prefix in (("centre", ""), ("device", "device_")):
        if {f"{prefix}x", f"{prefix}y"} <= set(objects.state_names):
            xyz = np.zeros((len(objects.label), 3))
            for i, axis in enumerate("xyz"):
                if f"{prefix}{axis}" in objects.state_names:
                    xyz[:, i] = objects.columns(f"{prefix}{axis}")[:, 0]
            found[name] = xyz
    return found


def half_turn(objects: Objects, row: int) -> Array:
    """The quaternion (4,) x, y, z, w of the extent of a row."""
    turn = np.zeros(()) if objects.rotation is None else objects.rotation[row]
    if turn.ndim:
        return np.asarray(turn)
    return np.array([0.0, 0.0, np.sin(turn / 2), np.cos(turn / 2)])


def _label(entity: Any, text: str, at: Sequence[float], colour: Sequence[float]) -> None:
    """A text of the same size at every distance."""
    label = entity.texts.add(text=text, billboard=True, scale_invariant=True, font_size=_LETTERS)
    label.pose.position.x, label.pose.position.y, label.pose.position.z = at
    label.pose.orientation.w = 1.0
    label.color.r, label.color.g, label.color.b, _ = colour
    label.color.a = 1.0


def _stretch(sphere: Any, objects: Objects, row: int) -> None:
    assert objects.semi_axes is not None
    axes = 2 * objects.semi_axes[row]
    sphere.size.x, sphere.size.y = np.resize(axes[:2], 2).tolist()
    sphere.size.z = float(axes[2]) if len(axes) > 2 else _HEIGHT
    o = sphere.pose.orientation
    o.x, o.y, o.z, o.w = half_turn(objects, row).tolist()
