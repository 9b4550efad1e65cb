"""JSON schemas of the MCAP topics that have no well-known Foxglove type."""

from __future__ import annotations

from typing import Any

_STAMP = {
    "type": "object",
    "description": "time after the recording's epoch; equals log_time",
    "properties": {"sec": {"type": "integer"}, "nsec": {"type": "integer"}},
    "required": ["sec", "nsec"],
}


def _schema(title: str, description: str, **properties: Any) -> dict[str, Any]:
    return {
        "title": title,
        "description": description,
        "type": "object",
        "properties": {"stamp": _STAMP, **properties},
        "required": ["stamp", *properties],
    }


_NUMBERS = {"type": "array", "items": {"type": ["number", "null"]}}

SCHEMAS: dict[str, dict[str, Any]] = {
    "echoset.UwbMeasurement": _schema(
        "echoset.UwbMeasurement",
        "One link event: path lengths [m] and amplitudes [square root of the SNR] of its paths; "
        "further arrays are declared columns of the same length.",
        mode={"enum": ["active", "passive", "tdoa"]},
        tx={"type": "string"},
        rx={"type": "string"},
        distance=_NUMBERS,
    ),
    "echoset.Odometry": _schema(
        "echoset.Odometry",
        "Velocity [m/s] in the body's frame, turn rate [rad/s] and heading [rad] since the event "
        "before; null where not told.",
    ),
    "echoset.Scan": _schema(
        "echoset.Scan", "Values of the scan whose detections follow, such as its field of view."
    ),
    "echoset.ObjectSet": _schema(
        "echoset.ObjectSet",
        "Objects of one time as columns: labels, states and what else the header declares.",
        label={"type": "array", "items": {"type": "integer"}},
        state={"type": "array", "items": _NUMBERS},
    ),
    "echoset.BlockedLink": _schema(
        "echoset.BlockedLink",
        "An active link that delivered nothing because something stood in the way.",
        tx={"type": "integer"},
        rx={"type": "integer"},
    ),
}
