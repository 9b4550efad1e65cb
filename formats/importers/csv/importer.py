"""Importer of delimited text logs, driven by a small YAML mapping.

The mapping says what the columns of a log mean. ``kind`` and ``columns`` are needed, and for UWB
``anchors``; all else has a default. For a log of UWB ranges it can be as short as ::

    kind: uwb
    columns: {time: t, anchor: id, distance: {column: range, unit: cm}}
    anchors: {A1: [0, 0], A2: [4.2, 0], A3: [4.2, 3.1]}

**Columns.** ``columns`` maps quantities to columns of the log. A column is given by its name in
the header or by its number from 1, in SI units; as ``{column: NAME, unit: UNIT, scale: FACTOR}``;
or as ``{value: NUMBER}``, the same for all rows. Units: ``m cm mm km ft in``, ``s ms us ns``,
``rad deg``, ``m/s km/h ft/s``, and ``dB`` for power and amplitude. ``scale`` multiplies: -1 turns
a Doppler that is positive when approaching into ours.

===============  =========================  ======================================================
kind             needed                     also
===============  =========================  ======================================================
uwb              time distance,             amplitude std device
                 and anchor, or tx and rx
position         time x y                   z doppler power amplitude time_offset scan sensor
range_bearing    time range azimuth         elevation doppler power amplitude std_range std_azimuth
                                            time_offset scan sensor
===============  =========================  ======================================================

*UWB*: ``anchor`` (and ``device``, by default one called ``device``) are active links. ``tx`` and
``rx`` are links of any mode: from an anchor they are passive, from one of ``devices`` active. Rows
of equal time and link are one event. *Radar*: rows of one sensor with equal time are one scan, or,
with a column ``scan``, those with an equal scan id, which stand together; the scan then has its
earliest time and the rows a time offset. ``azimuth`` turns from the sensor's x to its y axis.
A row whose measurement (``distance``, ``x y z`` or ``range azimuth``) is empty is an event or scan
without a detection. Rows in any order are sorted stably by time.

**Other keys**

``delimiter``, ``comment``, ``header`` : ``","``, ``"#"``, ``true``; a delimiter ``" "`` is any run
    of blanks.
``epoch`` : what times count from, ISO 8601; ``1970-01-01T00:00:00Z``.
``frame`` : directions of the log's x, y (and z) for anchors, poses and truth, of ``east west north
    south up down forward back left right``; default ``[east, north, up]``. ``[north, east, down]``
    swaps x and y and reverses z.
``sensor_frame`` : the same for what a radar measures; default as ``frame``.
``anchors`` : ``{id: POSE}``, or ``{file: F.csv, columns: {id: .., x: .., y: .., z: ..}}``.
``devices`` : ``{id: label}`` of the truth object that carries each, -1 for none. The only device
    of a log whose truth has ``device_x device_y`` has label 0.
``sensors`` : ``{id: POSE}`` of the radars; default ``{radar: [0, 0]}``. Several need the column
    ``sensor``.
``scans`` : ``{file: F.csv, columns: ..}``, all scans or events, so that those without a row in the
    log are known as empty: ``time`` and the same columns for sensor or nodes. Not with ``scan``.
``truth`` : ``{file: F.csv, columns: ..}`` with ``time`` and some of ``x y``, ``z``, ``vx vy``,
    ``vz``, ``device_x device_y``, and ``label``, an integer, default 0.
``model`` : what estimators take as parameters: ``{sigma: 0.1, mean_clutter: 0.5}``.

A POSE is ``[x, y]``, ``[x, y, z]`` or ``{position: [..], yaw: ..}`` for a sensor at rest, else
``{file: F.csv, columns: ..}`` with ``time x y``, ``z`` and ``yaw`` or ``qx qy qz qw``. Its numbers
are in SI or text such as ``30 deg``; ``yaw`` turns from the frame's x to its y axis. Other files
are written as the log is, unless they say ``delimiter``, ``comment`` or ``header``; they lie beside
the mapping.
"""

from __future__ import annotations

from collections import abc
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ....models.checks import NAME, check
from ....models.errors import InputError, ParameterError
from ....models.parameters import parameter, require
from ....models.records import Array, Meta, Objects, Recording, Truth
from ..text import read_text
from .mapping import MEASUREMENT, OPTIONAL, Mapping, Tables, load
from .radar import radar
from .table import fields, read_table
from .units import axes, turn
from .uwb import uwb

SUMMARY = "delimited text logs of UWB ranges or radar points, described by a YAML mapping"

_TRUTH = {"x": "m", "y": "m", "z": "m", "vx": "m s-1", "vy": "m s-1", "vz": "m s-1"}
_TRUTH |= {"device_x": "m", "device_y": "m"}


@dataclass(frozen=True, slots=True)
class Params:
    """Where the mapping is."""

    mapping: Any = parameter("", "", "YAML file (or its content) that says what columns mean")

    def __post_init__(self) -> None:
        ok = isinstance(self.mapping, abc.Mapping) or self.mapping
        require(bool(ok), "mapping", "the path of a YAML file", self.mapping)


def read(paths: Sequence[Path], params: Params) -> Recording:
    """The recording in one log.

    Raises
    ------
    ParameterError : the mapping is wrong
    FormatError : a file is unreadable or contradicts the mapping, with line and column
    """
    if len(paths) != 1:
        raise InputError("csv reads one log: name its further files in the mapping")
    content, folder = load(params.mapping)
    mapping = Mapping.of(content, params.mapping if folder else "")
    found = fields(
        mapping.columns,
        ("time", *MEASUREMENT[mapping.kind]),
        OPTIONAL[mapping.kind],
        "mapping: columns",
    )
    file = read_text(paths[0])
    table = read_table(file, mapping, found)
    tables = Tables(paths[0].parent if folder is None else folder, mapping, [file])
    F = axes(mapping.frame, "frame")
    truth = None if mapping.truth is None else _truth(mapping.truth, F, tables)
    build = uwb if mapping.kind == "uwb" else radar
    sensors, streams = build(mapping, table, F, tables, truth)
    for name in sensors:
        require(
            bool(NAME.fullmatch(name)), "the name of a sensor", "made of A-Z a-z 0-9 _ . + -", name
        )
    provenance = {
        "importer": "csv",
        "files": [file.provenance for file in tables.files],
        "parameters": {"mapping": content},
    }
    meta = Meta(paths[0].stem, mapping.epoch, provenance=provenance)
    recording = Recording(meta, sensors, streams, truth)
    check(recording, paths[0])
    return recording


def _truth(spec: object, F: Array, tables: Tables) -> Truth:
    table = tables.read(spec, ("time",), (*_TRUTH, "label"), "truth")
    names = [name for name in _TRUTH if name in table]
    columns = {name: table.values(name) for name in names}
    for x, y in (("x", "y"), ("vx", "vy"), ("device_x", "device_y")):
        if (x in columns) != (y in columns):
            raise ParameterError(f"truth: columns need both {x} and {y}, or neither")
        if x in columns:
            columns[x], columns[y] = turn(F, columns[x], columns[y])
    for z in ("z", "vz"):
        if z in columns:
            columns[z] = F[2, 2] * columns[z]
    if not names:
        raise ParameterError(f"truth: columns need some of {' '.join(_TRUTH)}")
    time = table.time()
    label = np.zeros(len(table))
    if "label" in table:
        label = table.values("label")
        table.refuse("label", (label != np.rint(label)) | (np.abs(label) > 2**53), "is no integer")
    order = np.lexsort((label, time))
    times, first = np.unique(time[order], return_index=True)
    objects = Objects(
        times,
        np.append(first, len(time)).astype(np.int64),
        label[order].astype(np.int64),
        tuple(names),
        tuple(_TRUTH[name] for name in names),
        np.column_stack([columns[name] for name in names])[order],
    )
    return Truth(objects)
