"""The scans of a bag's radars in windows of time, so that a bag may be larger than memory."""

from __future__ import annotations

import logging
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from ....models.errors import FormatError
from ....models.records import Array, Recording, Stream, Truth
from .bag import Bag, Topic, stamp
from .clouds import KINDS, columns
from .params import Params
from .topics import legal

_ROWS = 200_000
"""Points that are kept before a window is passed on."""
_SCANS = 4096
_LATE = 10**9
"""By how much a stamp may be earlier than one before it [ns]."""
_log = logging.getLogger(__name__)


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


def windowed(
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
