"""The data model: recordings, truth, estimates and scores as frozen records of arrays.

SI units, radians, right-handed frames, x forward or east, y left or north. Time is int64
nanoseconds after ``Meta.epoch``. Ragged data are columns plus ``row_offset``: the rows of scan
``k`` are ``row_offset[k]:row_offset[k + 1]``. The arrays are trusted once
:func:`echoset.models.checks.check` has passed, which every reader and writer calls.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from heapq import merge
from typing import Any

import numpy as np

from .columns import COLUMNS
from .runs import Runs

Array = np.ndarray[Any, Any]
Model = Mapping[str, Any]
"""A sensor model: floats, strings, lists of floats or (tables on grids) arrays, by name."""


@dataclass(frozen=True, slots=True, eq=False)
class Meta:
    """Name and origin of a record.

    ``name`` is the base name of the recording: it keys random streams and fills the column
    ``recording`` of scores. ``provenance`` is plain JSON: generator, parameters, seed, versions.
    """

    name: str
    epoch: str = "1970-01-01T00:00:00Z"
    frame: str = "map"
    origin: str = ""
    provenance: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, eq=False)
class Sensor:
    """A radar, UWB anchor or UWB device and its pose over time.

    ``time_ns`` (k,), ``position`` (k, 3) [m], ``quaternion`` (k, 4) as x, y, z, w, sensor to map;
    interpolated between the samples, constant outside; k = 0 where the pose is not known (a
    device). ``object`` is the label of the truth object that carries it, -1 for none.
    """

    kind: str
    time_ns: Array
    position: Array
    quaternion: Array
    object: int = -1

    @staticmethod
    def static(kind: str, position: Array) -> Sensor:
        """A sensor at rest at ``position`` (2,) or (3,), its axes along those of the map."""
        p = np.zeros((1, 3))
        p[0, : len(position)] = position
        return Sensor(kind, np.zeros(1, np.int64), p, np.array([[0.0, 0.0, 0.0, 1.0]]))

    @staticmethod
    def device(label: int = -1) -> Sensor:
        """A UWB device, whose pose nobody knows, carried by the object ``label``."""
        return Sensor("device", np.zeros(0, np.int64), np.zeros((0, 3)), np.zeros((0, 4)), label)


@dataclass(frozen=True, slots=True, eq=False)
class Stream:
    """Scans of one kind from one radar, or the link events of a UWB network.

    ``nodes`` names the sensors: one radar, or the UWB nodes that ``tx`` and ``rx`` count into.
    ``time_ns`` (n,), ``row_offset`` (n + 1,), ``scan`` columns (n,), ``rows`` columns (m,); what
    the columns mean stands in :mod:`echoset.models.columns`. A kind with maps holds them in
    ``scan`` as (n, n_range, n_angle) and their axes in ``model``. A scan without a detection has
    no rows; what was not operated or delivered nothing has no scan.
    """

    kind: str
    nodes: tuple[str, ...]
    model: Model
    time_ns: Array
    row_offset: Array
    scan: Mapping[str, Array]
    rows: Mapping[str, Array]

    def __len__(self) -> int:
        return len(self.time_ns)

    def part(self, start: int, stop: int) -> Stream:
        """The scans ``start:stop`` as a stream of their own."""
        first, last = self.row_offset[start], self.row_offset[stop]
        return replace(
            self,
            time_ns=self.time_ns[start:stop],
            row_offset=self.row_offset[start : stop + 1] - first,
            scan={k: v[start:stop] for k, v in self.scan.items()},
            rows={k: v[first:last] for k, v in self.rows.items()},
        )

    def observed(self) -> Stream:
        """The stream without its evaluation columns."""
        return replace(self, rows={k: v for k, v in self.rows.items() if not COLUMNS[k].evaluation})

    def scans(self, name: str) -> Iterator[Scan]:
        """The scans in order, without evaluation columns, as those of the stream ``name``."""
        seen, offset = self.observed(), self.row_offset
        for k, t in enumerate(self.time_ns.tolist()):
            rows = slice(offset[k], offset[k + 1])
            yield Scan(
                name,
                t,
                {c: v[k] for c, v in seen.scan.items()},
                {c: v[rows] for c, v in seen.rows.items()},
            )


@dataclass(frozen=True, slots=True, eq=False)
class Scan:
    """One scan or link event as an estimator sees it: scan values and row columns by name."""

    stream: str
    time_ns: int
    scan: Mapping[str, Any]
    rows: Mapping[str, Array]


PER_OBJECT = (
    "label",
    "state",
    "covariance",
    "existence",
    "class_index",
    "class_probability",
    "semi_axes",
    "rotation",
)
"""The arrays of :class:`Objects` that have a row for each object at each time."""


@dataclass(frozen=True, slots=True, eq=False)
class Objects:
    """A ragged set of extended objects over time: truth or estimates.

    ``time_ns`` (n,), ``row_offset`` (n + 1,), ``label`` (m,) int64, ``state`` (m, dx) with the
    columns ``state_names`` in ``state_units`` (``x y vx vy ...``; ``device_x device_y`` is the
    position of a device that the object carries). Optional: ``covariance`` (m, dx, dx),
    ``existence`` (m,), class indices (m,) into ``class_names`` with their probabilities (m, nc),
    and the extent: its kind (``circle ellipse ellipsoid rectangle``), ``semi_axes`` (m, k) [m] and
    ``rotation`` (m,) [rad] in the plane or (m, 4) as a quaternion.
    """

    time_ns: Array
    row_offset: Array
    label: Array
    state_names: tuple[str, ...]
    state_units: tuple[str, ...]
    state: Array
    covariance: Array | None = None
    existence: Array | None = None
    class_names: tuple[str, ...] = ()
    class_index: Array | None = None
    class_probability: Array | None = None
    extent_kind: str = ""
    semi_axes: Array | None = None
    rotation: Array | None = None

    def columns(self, *names: str) -> Array:
        """The state columns ``names`` as (m, len(names)); KeyError names what is absent."""
        absent = [n for n in names if n not in self.state_names]
        if absent:
            raise KeyError(f"no state column {' '.join(absent)}")
        return self.state[:, [self.state_names.index(n) for n in names]]

    def part(self, start: int, stop: int) -> Objects:
        """The objects of the times ``start:stop`` as a record of their own."""
        first, last = self.row_offset[start], self.row_offset[stop]
        found = self._rows(slice(first, last))
        offset = self.row_offset[start : stop + 1] - first
        return replace(found, time_ns=self.time_ns[start:stop], row_offset=offset)

    def take(self, rows: Array, time_ns: Array, count: Array | None = None) -> Objects:
        """The ``rows`` (k,) as the objects at ``time_ns`` (n,), ``count`` (n,) at each, or one."""
        counts = np.ones(len(rows), np.int64) if count is None else count
        offset = np.concatenate(([0], np.cumsum(counts)))
        return replace(self._rows(rows), time_ns=time_ns, row_offset=offset)

    def at(self, steps: Array) -> Objects:
        """The objects of the ``steps`` (k,), in that order."""
        rows, count = self.rows_of(steps)
        return self.take(rows, self.time_ns[steps], count)

    def rows_of(self, steps: Array) -> tuple[Array, Array]:
        """The rows of the ``steps`` (k,), one after the other, and how many each has (k,)."""
        count = np.diff(self.row_offset)[steps]
        first = self.row_offset[:-1][steps] - np.cumsum(count) + count
        return np.arange(count.sum()) + np.repeat(first, count), count

    def _rows(self, rows: Any) -> Objects:
        """Every column at ``rows``, with times and offsets as they are."""
        columns = {name: getattr(self, name) for name in PER_OBJECT}
        taken: dict[str, Any] = {k: None if c is None else c[rows] for k, c in columns.items()}
        return replace(self, **taken)

    @staticmethod
    def join(parts: Sequence[Objects]) -> Objects:
        """Objects of consecutive times as one record; at least one part."""
        if len(parts) == 1:
            return parts[0]
        first = parts[0]
        offsets = [np.zeros(1, np.int64), *(np.diff(o.row_offset) for o in parts)]
        columns: dict[str, Any] = {
            name: None
            if getattr(first, name) is None
            else np.concatenate([getattr(o, name) for o in parts])
            for name in ("time_ns", *PER_OBJECT)
        }
        return replace(first, row_offset=np.cumsum(np.concatenate(offsets)), **columns)


@dataclass(frozen=True, slots=True, eq=False)
class Truth:
    """The truth, for scoring: the objects, and the UWB links that were blocked.

    ``blocked_time_ns``, ``blocked_tx``, ``blocked_rx`` (b,): active link events that delivered
    nothing because something stood in the way.
    """

    objects: Objects
    blocked_time_ns: Array = field(default_factory=lambda: np.zeros(0, np.int64))
    blocked_tx: Array = field(default_factory=lambda: np.zeros(0, np.int32))
    blocked_rx: Array = field(default_factory=lambda: np.zeros(0, np.int32))


@dataclass(frozen=True, slots=True, eq=False)
class Recording:
    """Sensors by id, streams by name (``uwb``, a radar by its id) and, where known, the truth."""

    meta: Meta
    sensors: Mapping[str, Sensor]
    streams: Mapping[str, Stream]
    truth: Truth | None = None

    def observed(self) -> Recording:
        """The recording as an estimator may see it: no truth, origins, provenance or seed."""
        return Recording(
            replace(self.meta, provenance={}),
            self.sensors,
            {name: s.observed() for name, s in self.streams.items()},
        )

    def setup(self) -> Recording:
        """The observed recording with every stream emptied of its scans."""
        seen = self.observed()
        return replace(seen, streams={name: s.part(0, 0) for name, s in seen.streams.items()})

    def scans(self) -> Iterator[Scan]:
        """All observed scans in the order of (time, stream)."""
        return merge(
            *(s.scans(name) for name, s in sorted(self.streams.items())),
            key=lambda scan: (scan.time_ns, scan.stream),
        )


@dataclass(frozen=True, slots=True)
class Making:
    """How estimates were made: by which estimator and parameters, from which recording.

    ``digest`` is that of what can be seen of the recording. All is empty where nothing is said.
    """

    estimator: str
    parameters: Mapping[str, Any]
    digest: str

    @staticmethod
    def of(provenance: Any) -> Making:
        """What ``provenance`` says of it; what has another type than it should says nothing."""
        provenance = provenance if isinstance(provenance, Mapping) else {}
        estimator, parameters = provenance.get("estimator"), provenance.get("parameters")
        origin = provenance.get("input")
        digest = origin.get("digest") if isinstance(origin, Mapping) else None
        return Making(
            estimator if isinstance(estimator, str) else "",
            parameters if isinstance(parameters, Mapping) else {},
            digest if isinstance(digest, str) else "",
        )


@dataclass(frozen=True, slots=True, eq=False)
class Estimates:
    """The estimates of a recording, step by step.

    ``steps`` holds one value or array per time of ``objects``: ``cardinality_mean``,
    ``cardinality_variance`` and the estimator's diagnostics, (n, ...). ``recording`` is the
    recording itself where it travels along (through a pipe). ``making`` is what of the provenance
    anything depends on.
    """

    meta: Meta
    objects: Objects
    steps: Mapping[str, Array]
    recording: Recording | None = None
    making: Making = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "making", Making.of(self.meta.provenance))

    @property
    def estimator(self) -> str:
        """Name of the estimator."""
        return self.making.estimator


_NAMES = ("recording", "estimator", "metric", "part")
_NUMBERS = {"time": float, "value": float, "n": np.int64, "stderr": float}
Which = str | Callable[[str], bool] | None
"""A text, a test of texts, or any."""


@dataclass(frozen=True, slots=True, eq=False)
class Scores:
    """A long table of scores, one row a number.

    ``recording estimator metric part`` are sequences of strings; ``time`` [s] is NaN for the
    aggregate over a recording; ``n`` counts what entered; ``stderr`` is NaN where none is known.
    ``provenance`` is plain JSON: versions, metrics and their parameters.
    """

    recording: Sequence[str]
    estimator: Sequence[str]
    metric: Sequence[str]
    part: Sequence[str]
    time: Array
    value: Array
    n: Array
    stderr: Array
    provenance: Mapping[str, Any] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.recording)

    def take(self, rows: Array) -> Scores:
        """The ``rows`` (k,)."""
        columns: dict[str, Any] = {c: Runs.of(getattr(self, c)).take(rows) for c in _NAMES}
        columns |= {c: getattr(self, c)[rows] for c in _NUMBERS}
        return replace(self, **columns)

    def where(
        self,
        recording: Which = None,
        estimator: Which = None,
        metric: Which = None,
        part: Which = None,
        timed: bool | None = None,
    ) -> Scores:
        """The rows with these names, or that pass; if ``timed`` those per time, else aggregates."""
        found = np.ones(len(self), bool) if timed is None else np.isnan(self.time) != timed
        asked = (recording, estimator, metric, part)
        for column, which in zip(_NAMES, asked, strict=True):
            if which is not None:
                test = which if callable(which) else which.__eq__
                found &= Runs.of(getattr(self, column)).where(test)
        return self if found.all() else self.take(np.flatnonzero(found))

    @staticmethod
    def join(tables: Iterable[Scores]) -> Scores:
        """The rows of all ``tables`` in order.

        The provenance is theirs if it is one, otherwise the list of all different ones, ``inputs``.
        """
        parts = list(tables)
        if len(parts) == 1:
            return parts[0]
        columns: dict[str, Any] = {c: Runs.join(getattr(p, c) for p in parts) for c in _NAMES}
        for c, kind in _NUMBERS.items():
            numbers = [np.zeros(0, kind), *(getattr(p, c) for p in parts)]
            columns[c] = np.concatenate(numbers)
        known: list[dict[str, Any]] = []
        for p in parts:
            if p.provenance and dict(p.provenance) not in known:
                known.append(dict(p.provenance))
        columns["provenance"] = known[0] if len(known) == 1 else {"inputs": known} if known else {}
        return Scores(**columns)
