"""All streams of recordings, calibrated."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from ...models.errors import InputError
from ...models.records import Recording
from . import radar, uwb
from .quantities import Calibration
from .seen import RadarParams

RADARS = ("position", "range_bearing")


@dataclass(frozen=True)
class Params(RadarParams, uwb.UwbParams):
    """What is looked at, of radars and of UWB."""


def calibrate(
    recordings: Sequence[Recording], params: Params, names: Sequence[str] = ()
) -> list[Calibration]:
    """What the streams ``names`` of recordings are like, or all streams of radars or UWB.

    Each recording has the same streams.

    Raises
    ------
    InputError : streams differ or are missing, there is no truth, or too little is seen of it
    """
    kinds = {n: s.kind for n, s in recordings[0].streams.items() if s.kind in (*RADARS, "uwb")}
    for name in names:
        if name not in kinds:
            known = ", ".join(sorted(kinds)) or "none"
            raise InputError(f"{name!r}: no stream to calibrate; there are {known}")
    chosen = sorted(names or kinds)
    if not chosen:
        raise InputError(f"{recordings[0].meta.name}: has no detections and no ranges")
    if len({kinds[name] == "uwb" for name in chosen}) > 1:
        raise InputError("radars and UWB have parameters of their own: choose by --stream")
    for recording in recordings[1:]:
        for name in chosen:
            if name not in recording.streams or recording.streams[name].kind != kinds[name]:
                raise InputError(f"{recording.meta.name}: has no stream {name!r} of its kind")
    return [
        uwb.calibrate(recordings, name, params)
        if kinds[name] == "uwb"
        else radar.calibrate(recordings, name, params)
        for name in chosen
    ]
