"""What MCAP files hold for the eye only: sensor frames and objects as shapes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from foxglove_schemas_protobuf.FrameTransform_pb2 import FrameTransform
from foxglove_schemas_protobuf.Grid_pb2 import Grid
from foxglove_schemas_protobuf.PointCloud_pb2 import PointCloud
from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate
from google.protobuf.duration_pb2 import Duration

from ..models.records import Objects, Sensor
from .tables import serialize, timestamp

MESSAGES: dict[str, Any] = {
    "foxglove.FrameTransform": FrameTransform,
    "foxglove.Grid": Grid,
    "foxglove.PointCloud": PointCloud,
    "foxglove.SceneUpdate": SceneUpdate,
}
_COLOURS = {"truth": (0.0, 0.45, 0.70, 0.5), "estimates": (0.90, 0.62, 0.0, 0.5)}
_LIFETIME_NS, _HEIGHT, _POINT = 200_000_000, 0.1, 0.1


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


def shapes(objects: Objects, frame: str, kind: str) -> Iterator[tuple[int, bytes]]:
    """Times and messages of the objects as flat ellipses, devices as points."""
    places = [c for c in (("x", "y"), ("device_x", "device_y")) if set(c) <= {*objects.state_names}]
    xy = [objects.columns(*c) for c in places]
    for k, t in enumerate(objects.time_ns.tolist()):
        update = SceneUpdate()
        for row in range(objects.row_offset[k], objects.row_offset[k + 1]):
            entity = update.entities.add(
                timestamp=timestamp(t),
                frame_id=frame,
                id=f"{kind}-{objects.label[row]}",
                lifetime=Duration(nanos=_LIFETIME_NS),
            )
            for place, at in zip(places, xy, strict=True):
                sphere = entity.spheres.add()
                sphere.pose.position.x, sphere.pose.position.y = at[row].tolist()
                sphere.size.x = sphere.size.y = sphere.size.z = _POINT
                sphere.pose.orientation.w = 1.0
                if place == ("x", "y") and objects.semi_axes is not None:
                    _stretch(sphere, objects, row)
                sphere.color.r, sphere.color.g, sphere.color.b, sphere.color.a = _COLOURS[kind]
        yield t, serialize(update)


def _stretch(sphere: Any, objects: Objects, row: int) -> None:
    assert objects.semi_axes is not None
    axes = 2 * objects.semi_axes[row]
    sphere.size.x, sphere.size.y = axes[:2].tolist()
    sphere.size.z = float(axes[2]) if len(axes) > 2 else _HEIGHT
    if objects.rotation is not None:
        turn = objects.rotation[row]
        half = np.array([0.0, 0.0, np.sin(turn / 2), np.cos(turn / 2)]) if turn.ndim == 0 else turn
        o = sphere.pose.orientation
        o.x, o.y, o.z, o.w = half.tolist()
