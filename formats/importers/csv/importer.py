"""Importer of delimited text logs, driven by a small YAML mapping.

The mapping says what the columns of a log mean. ``kind`` and ``columns`` are needed, and for UWB
``anchors``; all else has a default. For a log of UWB ranges it can be as short as ::

    kind: uwb
    columns: {time: t, anchor: id, distance: {column: range, unit: cm}}
    anchors: {A1: [0, 0], A2: [4.2, 0], A3: [4.2, 3.1]}

All keys stand in docs/recordings.md. The modules, in the order of the work: ``mapping`` reads the
YAML and the further files that it names; ``columns`` says what may be said of a column, ``table``
takes the rows of a log and ``skip`` leaves some out; ``times`` and ``units`` turn text into
nanoseconds and SI; ``poses``, ``uwb``, ``radar`` and ``truth`` make sensors, streams and the truth.
"""

from __future__ import annotations

import logging
import re
from collections import abc
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ....models.checks import NAME, check
from ....models.columns import MODEL
from ....models.errors import InputError, ParameterError
from ....models.geometry.poses import said
from ....models.parameters import parameter, require, suggestion
from ....models.records import Meta, Recording, Sensor, Stream
from ....models.registry import parameters
from ..text import TextFile
from . import columns, geodetic, plausible, truth
from .align import align
from .log import Log
from .mapping import MATLAB, MEASUREMENT, OPTIONAL, UNUSED, Mapping, Tables, load
from .odometry import odometry
from .radar import radar
from .times import epoch_ns
from .units import axes
from .uwb import uwb

_log = logging.getLogger(__name__)
SUMMARY = "delimited text logs of UWB ranges or radar points, described by a YAML mapping"


@dataclass(frozen=True, slots=True)
class Params:
    """Where the mapping is."""

    mapping: Any = parameter("", "", "YAML file (or its content) that says what columns mean")

    def __post_init__(self) -> None:
        ok = isinstance(self.mapping, abc.Mapping) or self.mapping
        require(bool(ok), "mapping", "the path of a YAML file", self.mapping)


def read(paths: Sequence[Path], params: Params) -> Recording:
    """The recording in one log and the further files of its mapping.

    Raises
    ------
    ParameterError : the mapping is wrong
    FormatError : a file is unreadable or contradicts the mapping, with line and column
    """
    if len(paths) != 1:
        raise InputError("csv reads one log: name its further files in the mapping")
    content, folder = load(params.mapping)
    return build(content, folder, paths[0], {}, "csv", params.mapping if folder else "")


def build(
    content: dict[str, Any],
    folder: Path | None,
    path: Path,
    files: dict[Path, TextFile],
    importer: str,
    source: object = "",
) -> Recording:
    """The recording that the mapping ``content`` makes of the log at ``path``.

    Of further files those in ``files`` are known already; others lie in ``folder``, by default
    that of the log.
    """
    parts = _parts(content, source)
    mapping = next(iter(parts.values()))
    folder = path.parent if folder is None else folder
    F = axes(mapping.frame, "frame")
    plane = geodetic.Plane.of(mapping.origin, F)
    tables = Tables(folder, mapping, epoch_ns(mapping.epoch), plane, files)
    logs = {name: _rows(name, part, path, tables, len(parts) > 1) for name, part in parts.items()}
    true = None if mapping.truth is None else truth.read(mapping.truth, F, tables)
    carried = true is not None and "device_x" in true.objects.state_names
    sensors: dict[str, Sensor] = {}
    streams: dict[str, Stream] = {}
    for name, part in parts.items():
        _check_model(part.model, path)
        build = BUILD.get(part.kind, radar)
        own = replace(tables, dialect=part)
        nodes, found = build(part, logs[name], F, own, carried, name)
        for node, sensor in nodes.items():
            if node in sensors and not _same(sensor, sensors[node]):
                raise ParameterError(f"streams.{name}: {node!r} is elsewhere in another stream")
            sensors.setdefault(node, sensor)
        for stream in found:
            if stream in streams:
                raise ParameterError(f"streams.{name}: a second stream {stream!r}")
        streams |= found
    for moved in streams.values():
        if moved.kind == "odometry":
            sensors.setdefault(moved.nodes[0], Sensor.device())
    aligned: dict[str, Any] = {}
    if true is not None and mapping.truth.get("align"):
        uwb_streams = [stream for stream in streams.values() if stream.kind == "uwb"]
        if len(uwb_streams) != 1:
            raise InputError("truth: align needs one stream of ranges")
        true, aligned = align(true, uwb_streams[0], sensors, mapping.truth["align"])
        _log.warning("%s: the truth was fitted to the ranges: %s", path, _fitted(aligned))
    plausible.doppler(path, streams)
    if true is not None:
        plausible.overlap(path, true, streams)
        plausible.against_ranges(path, true, streams, sensors)
        plausible.against_points(path, true, streams, sensors)
    sensors, streams = _named(sensors, streams)
    provenance = {
        "importer": importer,
        "files": [file.provenance for file in tables.files.values()],
        "parameters": {"mapping": content},
    }
    if tables.skipped:
        provenance["left_out"] = tables.skipped
    if aligned:
        provenance["truth_aligned"] = aligned
    meta = Meta(path.stem, mapping.epoch, origin=plane.text, provenance=provenance)
    recording = Recording(meta, sensors, streams, true)
    check(recording, path)
    return recording


BUILD = {"uwb": uwb, "odometry": odometry}
"""What makes a stream of a kind that is not a radar's."""
GENERAL = True
"""Other importers come first, where a file may be for them."""


def recognises(path: Path, head: bytes) -> bool:
    """Whether a file, from its first bytes, is a table of text or of MATLAB."""
    if path.suffix in (MATLAB, ".json"):
        return path.suffix == MATLAB
    try:
        text = head.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        text = head[: error.start].decode("utf-8-sig") if error.start > len(head) - 4 else ""
    return "".join(text.split()).isprintable() and any(d in text for d in ",;\t| ")


def _parts(content: dict[str, Any], source: object) -> dict[str, Mapping]:
    """The mapping of each stream by its name: the common part and what it says of its own."""
    spec = content.get("streams", {})
    if not spec:
        mapping = Mapping.of(content, source)
        return {mapping.kind if mapping.kind in BUILD else "radar": mapping}
    ok = isinstance(spec, abc.Mapping) and all(isinstance(v, abc.Mapping) for v in spec.values())
    require(ok, "streams", "a mapping of names to what each stream is", spec)
    common = {key: value for key, value in content.items() if key != "streams"}
    parts = {}
    for name, own in spec.items():
        for key in ("epoch", "frame", "origin", "truth", "streams"):
            if key in own:
                raise ParameterError(f"streams.{name}: {key!r} is common to all streams")
        kind = str(own.get("kind", common.get("kind", "")))
        merged = {k: v for k, v in common.items() if k not in UNUSED.get(kind, ())} | dict(own)
        if kind not in BUILD:
            merged.setdefault("sensors", {name: [0.0, 0.0]})
        try:
            parts[name] = Mapping.of(merged)
        except ParameterError as error:
            place = f"{source}: " if source else ""
            raise ParameterError(f"{place}streams.{name}: {error}") from None
    return parts


def _rows(name: str, mapping: Mapping, path: Path, tables: Tables, several: bool) -> Log:
    """The rows of one stream: of the log itself and what continues it, or of files of its own."""
    where = f"streams.{name}.columns" if several else "mapping: columns"
    needed = ("time", *MEASUREMENT[mapping.kind])
    quantities = geodetic.instead(mapping.columns, needed, OPTIONAL[mapping.kind])
    found = columns.fields(mapping.columns, *quantities, where)
    more = (
        mapping.file if isinstance(mapping.file, list) else [mapping.file] if mapping.file else []
    )
    ok = all(isinstance(file, str) and file for file in more)
    require(ok, "file", "the name of a file, or a list of them", mapping.file)
    own = [tables.folder / file for file in more]
    files = [tables.file(file) for file in (own if several and own else [path, *own])]
    return tables.table(files, mapping, found, where)


def _fitted(found: dict[str, Any]) -> str:
    return f"{said(found)}, {found['fitted']} numbers from {found['ranges']} ranges"


def _check_model(model: abc.Mapping[str, Any], path: Path) -> None:
    """Warn of each name in a sensor model that nothing takes, with the nearest that something does.

    The recording keeps it: an estimator to come may know it.
    """
    known = parameters("echoset.estimators", "echoset.metrics") if model else ()
    for name in model:
        if name not in known and name not in MODEL:
            hint = suggestion(name, known)
            _log.warning("%s: model: no estimator or metric takes %r%s", path, name, hint)


def _same(a: Sensor, b: Sensor) -> bool:
    pairs = ((a.time_ns, b.time_ns), (a.position, b.position), (a.quaternion, b.quaternion))
    return a.kind == b.kind and a.object == b.object and all(np.array_equal(*p) for p in pairs)


def _named(
    sensors: dict[str, Sensor], streams: dict[str, Stream]
) -> tuple[dict[str, Sensor], dict[str, Stream]]:
    """Sensors and streams by legal names: marks such as colons become ``_``."""
    names: dict[str, str] = {}
    for name in (*sensors, *streams):
        legal = re.sub(r"[^A-Za-z0-9_.+\-\s]", "_", name)
        legal = re.sub(r"^[.+-]", "_", legal)
        rule = "made of letters, digits and marks, without blanks"
        require(bool(NAME.fullmatch(legal)), "the name of a sensor", rule, name)
        names[name] = legal
    for group in (sensors, streams):
        taken: dict[str, str] = {}
        for name in group:
            other = taken.setdefault(names[name], name)
            if other != name:
                reason = f"{other!r} and {name!r} are both called {names[name]!r}: 'rename' one"
                raise ParameterError(reason)
    return (
        {names[name]: sensor for name, sensor in sensors.items()},
        {
            names[name]: replace(stream, nodes=tuple(names[node] for node in stream.nodes))
            for name, stream in streams.items()
        },
    )
