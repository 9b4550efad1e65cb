"""Pieces of recordings: what ``echoset cut`` takes out of one, and ``echoset join`` appends."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import ExitStack, closing
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from .. import formats
from ..formats.windows import between, times
from ..models.errors import InputError, ParameterError
from ..models.parameters import require, suggestion
from ..models.records import Array, Meta, Recording, Sensor, Stream, Truth
from .batch import resume
from .batch.execution import Execution
from .files.inputs import label, spooled
from .files.outputs import Target

_FIRST, _LAST = -(1 << 62), 1 << 62


@dataclass(frozen=True, slots=True)
class Selection:
    """What is taken: a span of time [s], streams, sensors, each ``every``-th scan; all if not told.

    With ``relative`` the span counts from the first scan. Of a network, events are taken whose
    ends are all among ``sensors``; if no device is named, that of every device.
    """

    start: float | None = None
    stop: float | None = None
    relative: bool = False
    streams: tuple[str, ...] = ()
    sensors: tuple[str, ...] = ()
    every: int = 1

    def __post_init__(self) -> None:
        if self.start is not None and self.stop is not None:
            require(self.start <= self.stop, "stop", "start or later", self.stop)
        require(self.every >= 1, "every", "at least 1", self.every)

    @property
    def told(self) -> dict[str, Any]:
        """What was asked for, for provenance."""
        named = {name: getattr(self, name) for name in self.__slots__}
        return {k: list(v) if isinstance(v, tuple) else v for k, v in named.items()}

    def of(self, recording: Recording) -> dict[str, list[bool]]:
        """The streams that are taken, and which of their nodes.

        Raises
        ------
        ParameterError : a stream or sensor is not in the recording
        """
        for asked, known, kind in (
            (self.streams, recording.streams, "stream"),
            (self.sensors, recording.sensors, "sensor"),
        ):
            for name in asked:
                if name not in known:
                    hint = suggestion(name, known)
                    raise ParameterError(f"{recording.meta.name}: no {kind} {name!r}{hint}")
        devices = {n for n, s in recording.sensors.items() if s.kind == "device"}
        wanted = set(self.sensors) or set(recording.sensors)
        if not wanted & devices:
            wanted |= devices
        found = {}
        for name, stream in recording.streams.items():
            taken = [node in wanted for node in stream.nodes]
            if (not self.streams or name in self.streams) and (
                any(taken) if stream.kind == "uwb" else all(taken)
            ):
                found[name] = taken
        if not found:
            raise InputError(f"{recording.meta.name}: none of its streams is taken")
        return found


@dataclass(frozen=True, slots=True)
class Cut:
    """A piece of a file to be written."""

    label: str
    target: Target
    selection: Selection

    @property
    def sources(self) -> tuple[str]:
        """The file."""
        return (self.label,)

    def placed(self, execution: Execution) -> Cut:
        """The task with the paths of the workers."""
        target = execution.target(self.target)
        return replace(self, label=execution.place(self.label), target=target)

    def decide(self) -> resume.Decision:
        """It is always done."""
        return resume.decide(replace(self.target, resume=False), dict)

    def run(self) -> None:
        """Write the piece; InputError where it is empty."""
        with spooled(self.label) as path, self.target.open() as opened:
            _write(cut(path, label(self.label), self.selection), opened, self.target.format)


@dataclass(frozen=True, slots=True)
class Join:
    """Recordings to be appended to one another."""

    labels: tuple[str, ...]
    target: Target

    @property
    def label(self) -> str:
        """The first file."""
        return self.labels[0]

    @property
    def sources(self) -> tuple[str, ...]:
        """The files."""
        return self.labels

    def placed(self, execution: Execution) -> Join:
        """The task with the paths of the workers."""
        return replace(
            self, labels=execution.places(self.labels), target=execution.target(self.target)
        )

    def decide(self) -> resume.Decision:
        """It is always done."""
        return resume.decide(replace(self.target, resume=False), dict)

    def run(self) -> None:
        """Write them as one."""
        with ExitStack() as stack:
            paths = [stack.enter_context(spooled(source)) for source in self.labels]
            opened = stack.enter_context(self.target.open())
            _write(join(paths, [label(s) for s in self.labels]), opened, self.target.format)


def cut(path: Path, name: str, selection: Selection) -> Iterator[Recording]:
    """The windows of a piece of a recording, one at least.

    Raises
    ------
    InputError : it is no recording, or nothing of it is taken
    """
    first, last = _span(path, name, selection)
    with closing(formats.open_windows(path, name)) as windows:
        head = _recording(windows.head, name)
        taken = selection.of(head)
        nodes = {node for stream in taken for node in head.streams[stream].nodes}
        sensors = {n: s for n, s in head.sensors.items() if n in nodes}
        digest = formats.header(path)["content_digest"]
        told = {**selection.told, "input": {"name": head.meta.name, "digest": digest}}
        before = head.meta.provenance
        provenance = {**before, "cut": [*before.get("cut", []), told]}
        meta = replace(head.meta, provenance=provenance)
        seen = dict.fromkeys(taken, 0)
        latest = dict.fromkeys(taken, _FIRST)
        any_scan = False
        for window in windows:
            part = between(window, first, last)
            streams = {}
            for key, ends in taken.items():
                stream = _ended(part.streams[key], ends)
                stream, seen[key], latest[key] = _thinned(
                    stream, selection.every, seen[key], latest[key]
                )
                streams[key] = stream
                any_scan |= len(stream) > 0
            truth = part.truth
            if truth is not None and not any(s.kind == "uwb" for s in streams.values()):
                truth = Truth(truth.objects)
            yield Recording(meta, sensors, streams, truth)
    if not any_scan:
        raise InputError(f"{name}: no scan is in the piece")


def join(paths: Sequence[Path], names: Sequence[str]) -> Iterator[Recording]:
    """The windows of recordings that follow one another, as those of one.

    Raises
    ------
    InputError : they have other streams or sensors, or overlap in time
    """
    with ExitStack() as stack:
        parts = [
            stack.enter_context(closing(formats.open_windows(path, name)))
            for path, name in zip(paths, names, strict=True)
        ]
        heads = [_recording(p.head, name) for p, name in zip(parts, names, strict=True)]
        first = heads[0]
        for head, name in zip(heads[1:], names[1:], strict=True):
            _alike(first, head, name)
        sensors = {n: _joined([h.sensors[n] for h in heads], n, names) for n in first.sensors}
        pieces = [
            {"name": h.meta.name, "digest": formats.header(path)["content_digest"]}
            for h, path in zip(heads, paths, strict=True)
        ]
        provenance = {**first.meta.provenance, "joined": pieces}
        meta: Meta = replace(first.meta, provenance=provenance)
        latest, before = _FIRST, _FIRST
        for part, name in zip(parts, names, strict=True):
            before = latest
            for window in part:
                known = [t for t in times(window) if len(t)]
                if known and min(int(t[0]) for t in known) <= before:
                    raise InputError(f"{name}: begins before the end of the one before it")
                latest = max([latest, *(int(t[-1]) for t in known)])
                yield replace(window, meta=meta, sensors=sensors)


def _write(windows: Iterator[Recording], opened: Any, form: str) -> None:
    writer: Any = None
    try:
        meta = None
        for window in windows:
            writer = writer or formats.writer(opened, form)
            writer.append(window)
            meta = window.meta
        writer.close(meta)
    finally:
        if writer is not None:
            writer.abort()


def _recording(head: object, name: str) -> Recording:
    if not isinstance(head, Recording):
        raise InputError(f"{name}: holds estimates, not a recording")
    return head


def _span(path: Path, name: str, selection: Selection) -> tuple[int, int]:
    """First and last time [ns] that are taken."""
    origin = 0
    if selection.relative:
        with closing(formats.open_windows(path, name)) as windows:
            head = _recording(windows.head, name)
            known = [s.time_ns[0] for s in head.streams.values() if len(s)]
            for window in windows:
                known += [s.time_ns[0] for s in window.streams.values() if len(s)]
                if known:
                    break
        origin = int(min(known, default=0))
    bounds = []
    for value, default in ((selection.start, _FIRST), (selection.stop, _LAST)):
        bounds.append(default if value is None else origin + round(value * 1e9))
    return bounds[0], bounds[1]


def _ended(stream: Stream, ends: Sequence[bool]) -> Stream:
    """The link events whose ends are all taken; any other stream as it is."""
    if stream.kind != "uwb" or all(ends):
        return stream
    inside = np.append(ends, True)  # -1, no reference, is taken
    keep = np.ones(len(stream), bool)
    for key in ("tx", "rx", "reference"):
        if key in stream.scan:
            keep &= inside[stream.scan[key]]
    return _taken(stream, keep)


def _thinned(stream: Stream, every: int, seen: int, latest: int) -> tuple[Stream, int, int]:
    """Each ``every``-th time of a stream, of which ``seen`` were before, up to ``latest``.

    Odometry is whole: a row of it tells of all the time since the one before.
    """
    if not len(stream) or stream.kind == "odometry":
        return stream, seen, latest
    new = np.diff(stream.time_ns, prepend=latest) > 0
    number = seen + np.cumsum(new)
    return _taken(stream, (number - 1) % every == 0), int(number[-1]), int(stream.time_ns[-1])


def _taken(stream: Stream, keep: Array) -> Stream:
    """The scans that are kept (n,), with their rows."""
    if keep.all():
        return stream
    count = np.diff(stream.row_offset)
    rows = np.repeat(keep, count)
    return replace(
        stream,
        time_ns=stream.time_ns[keep],
        row_offset=np.append(np.int64(0), np.cumsum(count[keep])),
        scan={k: v[keep] for k, v in stream.scan.items()},
        rows={k: v[rows] for k, v in stream.rows.items()},
    )


def _alike(a: Recording, b: Recording, name: str) -> None:
    """Raise InputError unless ``b`` can follow ``a``."""
    for what, one, other in (
        ("epoch", a.meta.epoch, b.meta.epoch),
        ("frame", a.meta.frame, b.meta.frame),
        ("origin", a.meta.origin, b.meta.origin),
        ("streams", sorted(a.streams), sorted(b.streams)),
        ("sensors", sorted(a.sensors), sorted(b.sensors)),
        ("truth", a.truth is None, b.truth is None),
    ):
        if one != other:
            raise InputError(f"{name}: its {what} are not those of {a.meta.name}: {other}")
    for key, stream in a.streams.items():
        other_stream = b.streams[key]
        same = (stream.kind, stream.nodes) == (other_stream.kind, other_stream.nodes)
        same &= stream.model.keys() == other_stream.model.keys()
        same = same and all(
            np.array_equal(np.asarray(v), np.asarray(other_stream.model[k]))
            for k, v in stream.model.items()
        )
        if not same:
            raise InputError(f"{name}: its stream {key!r} is of another kind, nodes or model")


def _joined(parts: Sequence[Sensor], name: str, names: Sequence[str]) -> Sensor:
    """One sensor with the poses of all, if they can follow one another."""
    first = parts[0]
    if all(
        len(p.time_ns) <= 1
        and np.array_equal(p.position, first.position)
        and np.array_equal(p.quaternion, first.quaternion)
        for p in parts
    ):
        return first
    time = np.concatenate([p.time_ns for p in parts])
    if (np.diff(time) <= 0).any() or any(len(p.time_ns) == 1 for p in parts):
        raise InputError(f"{names[-1]}: the sensor {name!r} is elsewhere, or its poses overlap")
    position = np.concatenate([p.position for p in parts])
    return replace(
        first,
        time_ns=time,
        position=position,
        quaternion=np.concatenate([p.quaternion for p in parts]),
    )
