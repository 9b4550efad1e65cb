"""Ranges to beacons as lines of JSON, one message a line, as many a gateway logs them.

The first line tells where the beacons stand, ``{"beacons": {"B1": [0, 0], ..}}`` [m]; all others
are ranges at a time, ``{"ms": 1200, "ranges": {"B1": 312, ..}}`` [cm]. A beacon that was not heard
is not in the message.
"""

import json
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from echoset.models.checks import check
from echoset.models.errors import FormatError, InputError
from echoset.models.parameters import parameter
from echoset.models.records import Meta, Recording, Sensor, Stream

SUMMARY = "ranges to beacons as lines of JSON"


@dataclass(frozen=True, slots=True)
class Params:
    """What the log does not tell."""

    std: float = parameter(0.1, "m", "standard deviation of a range", within="(0, inf)")


def recognises(path: Path, head: bytes) -> bool:
    """Whether the first bytes of a file, or of nothing for a folder, are those of such a log."""
    return head.startswith(b'{"beacons"')


def read(paths: Sequence[Path], params: Params) -> Recording:
    """The recording in one log.

    Raises
    ------
    FormatError : a line is not what it should be, with its number
    """
    if len(paths) != 1:
        raise InputError("beacons reads one log")
    (path,) = paths
    messages = _messages(path)
    line, first = next(messages, (1, {}))
    beacons = first.get("beacons")
    if not isinstance(beacons, dict) or not beacons:
        raise FormatError(path, f"line {line}", "must tell the beacons")
    sensors = {name: Sensor.static("anchor", _place(path, p)) for name, p in beacons.items()}
    nodes = (*sensors, "tag")
    events: list[tuple[int, int, float]] = []
    for line, message in messages:
        ms, ranges = message.get("ms"), message.get("ranges")
        if not isinstance(ms, int) or not isinstance(ranges, dict):
            raise FormatError(path, f"line {line}", "needs ms and ranges")
        for name, distance in ranges.items():
            if name not in sensors:
                raise FormatError(path, f"line {line}", f"{name!r} is no beacon")
            if not _number(distance) or distance < 0:
                raise FormatError(path, f"line {line}", f"{distance!r} is no range")
            events.append((ms * 1_000_000, nodes.index(name), distance * 0.01))
    if not events:
        raise FormatError(path, "", "holds no range")
    events.sort(key=lambda event: event[:2])
    time, rx, distance = (np.array(column) for column in zip(*events, strict=True))
    n = len(events)
    stream = Stream(
        kind="uwb",
        nodes=nodes,
        model={"sigma": params.std, "mean_scatter": 0.0},
        time_ns=time.astype(np.int64),
        row_offset=np.arange(n + 1),
        scan={
            "mode": np.zeros(n, np.uint8),  # active: from the tag to a beacon
            "tx": np.full(n, len(beacons), np.int32),
            "rx": rx.astype(np.int32),
        },
        rows={"distance": distance},
    )
    about = Meta(path.stem, provenance={"importer": "beacons", "std": params.std})
    recording = Recording(about, {**sensors, "tag": Sensor.device()}, {"uwb": stream})
    check(recording, path)
    return recording


def _messages(path: Path) -> Iterator[tuple[int, dict[str, Any]]]:
    """The messages, and the lines on which they stand."""
    with path.open(encoding="utf-8") as file:
        for line, text in enumerate(file, 1):
            try:
                message = json.loads(text)
            except ValueError as error:
                raise FormatError(path, f"line {line}", f"is no JSON: {error}") from error
            if not isinstance(message, dict):
                raise FormatError(path, f"line {line}", "is no JSON object")
            yield line, message


def _place(path: Path, place: Any) -> np.ndarray:
    if not isinstance(place, list) or len(place) not in (2, 3) or not all(map(_number, place)):
        raise FormatError(path, "line 1", f"{place!r} is no place [x, y] or [x, y, z]")
    return np.array(place, float)


def _number(value: Any) -> bool:
    return isinstance(value, int | float) and math.isfinite(value)
