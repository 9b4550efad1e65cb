"""Importer of the tables that logs of TI's mmWave radars are: a row a point, with its frame.

A header names the columns, such as ``Frame #, # Obj, X, Y, Z, Doppler, Intensity, y, m, d, h, m,
s``, in any order and spelling that is known. X is to the right of the radar, Y ahead, Z up [m];
Doppler [m/s] is positive when receding, the intensity is that of the peak [dB]. The year, month,
day, hour, minute and second are columns that follow one another.

Rows of a frame stand together and are one scan. A frame number that is skipped, within a run, is a
scan that saw nothing, and so is a row without a place. The time of a scan is that of its first row.
Whole seconds, which several frames share, do not tell it, nor does a number alone: ``rate`` says
how many frames there are a second, and times then go with the number, as near the stamps as that
allows. Where the number begins anew a new run begins; without stamps only one can be taken, by
``run``.
"""

from __future__ import annotations

import logging
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from ....models.checks import check
from ....models.errors import FormatError, InputError
from ....models.geometry.poses import yaw_quaternion
from ....models.parameters import as_dict, parameter
from ....models.records import Array, Meta, Recording, Sensor
from ..csv import plausible
from ..text import Table, TextFile, read_text
from .scans import stream

_log = logging.getLogger(__name__)
SUMMARY = "tables of points of TI's mmWave radars, with frames and perhaps dates"
NAMES = {
    "frame": ("frame", "frame number", "frame num", "frame id", "framenumber", "framenum"),
    "count": ("obj", "num obj", "numobj", "objects", "detobj", "det obj", "number of objects"),
    "x": ("x", "x m", "posx", "pos x"),
    "y": ("y", "y m", "posy", "pos y"),
    "z": ("z", "z m", "posz", "pos z"),
    "doppler": ("doppler", "doppler m s", "velocity", "vel", "v"),
    "power": ("intensity", "snr", "peak", "peakval", "intensity db"),
}
_DATE = (
    ("y", "year"), ("m", "mon", "month"), ("d", "day"), ("h", "hour", "hr"),
    ("m", "min", "minute"), ("s", "sec", "second", "seconds"),
)  # fmt: skip
DATE = ("year", "month", "day", "hour", "minute", "second")
_LONGEST = 1000
"""Frames in a row that may be empty."""
_OFF = 0.2
"""By how much [s] times by number may be off the stamps."""


@dataclass(frozen=True, slots=True)
class Params:
    """What the table does not say."""

    rate: float = parameter(
        0.0, "Hz", "frames a second, where stamps do not tell times; 0: they do", within="[0, inf)"
    )
    run: int = parameter(
        0, "", "which run of frame numbers is taken, from 1; 0: all", within="[0, inf)"
    )
    position: tuple[float, float, float] = parameter((0.0, 0.0, 0.0), "m", "where the radar is")
    yaw: float = parameter(0.0, "deg", "where it looks, anticlockwise from the map's x axis")
    half_view: float = parameter(
        60.0, "deg", "half the width of the field of view", within="[0, 180]"
    )
    max_range: float = parameter(
        0.0, "m", "range of the field of view; 0: not known", within="[0, inf)"
    )


def recognises(path: Path, head: bytes) -> bool:
    """Whether the first line of a file names frames, points and their Doppler."""
    line = head.split(b"\n", 1)[0].decode("ascii", "replace")
    return {"frame", "x", "y", "doppler"} <= set(_found(_words(line)))


def read(paths: Sequence[Path], params: Params) -> Recording:
    """The recording in one table.

    Raises
    ------
    FormatError : the table breaks the format, or does not tell times
    InputError : there is not one table
    """
    if len(paths) != 1:
        raise InputError("mmwave reads one table")
    file = read_text(paths[0])
    table = _table(file)
    number = _numbers(table)
    start, run = _frames(number, table)
    if params.run:
        if params.run > run[-1]:
            raise FormatError(file.path, "", f"run {params.run} of {run[-1]}: there is no such")
        start, run = start[run == params.run], run[run == params.run]
    time, counter = _times(table, number, start, run, params), number[start]
    scans = _scans(table, start, number, params)
    empty = _empty(table, time, counter, start, run)
    columns = list(scans[0])
    none = {column: np.zeros(0) for column in columns}
    times = [*time.tolist(), *empty.tolist()]
    view = np.radians(params.half_view), params.max_range
    made = stream("radar", "position", times, [*scans, *[none] * len(empty)], columns, view, {})
    quaternion = yaw_quaternion(np.radians([params.yaw]))
    place = np.array([params.position], float)
    sensor = Sensor("radar", np.zeros(1, np.int64), place, quaternion)
    said = {"importer": "mmwave", "files": [file.provenance], "parameters": as_dict(params)}
    meta = Meta(file.path.stem, provenance=said)
    recording = Recording(meta, {"radar": sensor}, {"radar": made})
    check(recording, file.path)
    plausible.doppler(file.path, recording.streams)
    return recording


def _words(line: str) -> list[str]:
    """The names in a header, in lower case and of letters alone."""
    delimiter = max(",;\t", key=line.count)
    return [re.sub(r"[^a-z]+", " ", w.lower()).strip() for w in line.split(delimiter)]


def _found(words: Sequence[str]) -> dict[str, int]:
    """The column of each quantity; those of the date follow one another."""
    dates = [
        k
        for k in range(len(words) - len(_DATE) + 1)
        if all(words[k + i] in names for i, names in enumerate(_DATE))
    ]
    found = {name: dates[-1] + i for i, name in enumerate(DATE)} if dates else {}
    taken = set(found.values())
    for key, names in NAMES.items():
        column = next((k for k, w in enumerate(words) if w in names and k not in taken), None)
        if column is not None:
            found[key] = column
            taken.add(column)
    return found


def _table(file: TextFile) -> Table:
    lines = file.lines()
    found = _found(_words(lines[0]))
    for key in ("frame", "x", "y"):
        if key not in found:
            reason = f"names no column {key}: echoset convert --from csv takes any table"
            raise FormatError(file.path, "line 1", reason)
    delimiter = max(",;\t", key=lines[0].count)
    header = lines[0].split(delimiter)
    columns: dict[str, list[str]] = {key: [] for key in found}
    places: list[tuple[Path, int]] = []
    for line, text in enumerate(lines[1:], 2):
        fields = text.split(delimiter)
        if not text.strip():
            continue
        if len(fields) != len(header):
            reason = f"has {len(fields)} fields, needs {len(header)}"
            raise FormatError(file.path, f"line {line}", reason)
        places.append((file.path, line))
        for key, k in found.items():
            columns[key].append(fields[k].strip())
    if not places:
        raise FormatError(file.path, "line 2", "there are no points")
    return Table(columns, places, {key: header[k].strip() for key, k in found.items()})


def _numbers(table: Table) -> Array:
    number = table.numbers("frame")
    table.none("frame", number != np.rint(number), "is no whole number")
    table.none("frame", np.abs(number) > 1 << 53, "is too large to be counted")
    return number.astype(np.int64)


def _frames(number: Array, table: Table) -> tuple[Array, Array]:
    """The first row of each frame, and the run of numbers that it is of, from 1."""
    start = np.flatnonzero(np.append(True, np.diff(number) != 0))
    step = np.diff(number[start])
    run = np.cumsum(np.append(1, step < 0))
    for k in np.flatnonzero(step < 0).tolist():
        if number[start[k + 1]] > number[start[run == run[k]]].min() + _LONGEST:
            reason = "goes back, yet not to where it began: the rows of a frame stand together"
            table.fail("frame", int(start[k + 1]), reason)
    return start, run


def _times(table: Table, number: Array, start: Array, run: Array, params: Params) -> Array:
    """The time of each frame [ns]."""
    if "second" not in table.columns:
        if not params.rate:
            reason = "there are no dates: say how many frames there are a second, --set rate=20"
            raise FormatError(table.places[0][0], "line 1", reason)
        if run[0] != run[-1]:
            k = int(start[int((run != run[0]).argmax())])
            reason = "the number begins anew, and there are no dates: take one run, --set run=1"
            table.fail("frame", k, reason)
        return np.asarray(np.rint((number[start] - number[start[0]]) * 1e9 / params.rate), np.int64)
    stamp = _stamps(table, start)
    if params.rate:
        return _even(table, stamp, number, start, run, params.rate)
    whole = len(start) > 1 and not (stamp % 10**9).any()
    again = np.append(False, np.diff(stamp) == 0)
    if again.any() or (whole and len(start) > 2):
        k = int(start[int(again.argmax())])
        span, frames = (stamp[-1] - stamp[0]) * 1e-9, len(start) - 1
        guess = f"about {frames / span:.3g}" if span else "unknown"
        reason = "is shared by frames" if again.any() else "is of whole seconds"
        hint = f"say how many frames there are a second ({guess}), --set rate="
        table.fail("second", k, f"{reason}: {hint}")
    back = np.append(False, np.diff(stamp) < 0)
    if back.any():
        table.fail("second", int(start[int(back.argmax())]), "the clock goes back")
    return stamp


def _stamps(table: Table, start: Array) -> Array:
    """The stamp of each frame [ns], that of its first row."""
    y, m, d, h, minute = (table.numbers(key)[start] for key in DATE[:-1])
    second = table.nanoseconds("second")[start]
    found = np.zeros(len(start), np.int64)
    days: dict[tuple[float, ...], int] = {}
    for k, at in enumerate(zip(y.tolist(), m.tolist(), d.tolist(), strict=True)):
        if at not in days:
            try:
                day = datetime(int(at[0]), int(at[1]), int(at[2]), tzinfo=UTC)
            except (ValueError, OverflowError) as error:
                table.fail("day", int(start[k]), f"is of no date: {error}")
            if not 1700 < day.year < 2260:
                table.fail("year", int(start[k]), "is beyond the years 1700 to 2260")
            days[at] = int(day.timestamp()) * 10**9
        found[k] = days[at]
    for key, values, most in (("hour", h, 24), ("minute", minute, 60), ("second", second, 6e10)):
        bad = (values < 0) | (values >= most) | ((values != np.rint(values)) & (most <= 60))
        if bad.any():
            k = int(bad.argmax())
            table.fail(key, int(start[k]), f"{table.columns[key][start[k]]!r} is no {key}")
    return np.asarray(found + (h * 3600 + minute * 60).astype(np.int64) * 10**9 + second)


def _even(
    table: Table, stamp: Array, number: Array, start: Array, run: Array, rate: float
) -> Array:
    """Times that go with the number in each run, the first such that no stamp is in their future.

    A stamp is cut to what it can tell, and late by what the host was busy with.
    """
    time = np.zeros(len(start), np.int64)
    whole = not (stamp % 10**9).any()
    for r in np.unique(run).tolist():
        own = run == r
        since = np.rint((number[start[own]] - number[start[own]][0]) * 1e9 / rate).astype(np.int64)
        lag = stamp[own] - since
        first = int(lag.max()) if whole else int(np.median(lag))
        off = np.abs(lag - first) * 1e-9
        k = int(off.argmax())
        if off[k] > (1.0 if whole else 0.0) + _OFF:
            row = int(start[np.flatnonzero(own)[k]])
            table.fail("second", row, f"is {off[k]:.2f} s off what {rate:g} frames a second make")
        time[own] = first + since
    again = np.append(False, np.diff(time) <= 0)
    if again.any():
        table.fail("frame", int(start[int(again.argmax())]), "is not after the frame before it")
    return time


def _scans(table: Table, start: Array, number: Array, params: Params) -> list[Mapping[str, Array]]:
    """The points of each frame, x ahead and y to the left."""
    columns = {"x": table.numbers("y", missing=True), "y": -table.numbers("x", missing=True)}
    for key in ("z", "doppler"):
        if key in table.columns:
            columns[key] = table.numbers(key, missing=True)
    if "power" in table.columns:
        with np.errstate(over="ignore"):
            columns["power"] = 10.0 ** (table.numbers("power", missing=True) / 10.0)
        table.none("power", np.isinf(columns["power"]), "is no intensity in dB")
    there = np.isfinite(columns["x"]) & np.isfinite(columns["y"])
    if "count" in table.columns:
        there &= table.numbers("count", missing=True) != 0
    for key, values in columns.items():
        if key not in ("x", "y"):
            table.none(key, there & np.isnan(values), "is empty, yet there is a point")
    stops = np.append(np.flatnonzero(np.diff(number) != 0) + 1, len(number))
    stop = stops[np.searchsorted(stops, start, "right")]
    scans: list[Mapping[str, Array]] = []
    for a, b in zip(start.tolist(), stop.tolist(), strict=True):
        own = np.flatnonzero(there[a:b]) + a
        scans.append({key: values[own] for key, values in columns.items()})
    return scans


def _empty(table: Table, time: Array, counter: Array, start: Array, run: Array) -> Array:
    """The times of the frames whose numbers are skipped, evenly between those around."""
    found = [np.zeros(0, np.int64)]
    step, span = np.diff(counter), np.diff(time)
    usual = np.median(span[step == 1]) if (step == 1).any() else 0.0
    for k in np.flatnonzero((step > 1) & (np.diff(run) == 0)).tolist():
        if usual and not step[k] * usual / 2 < span[k] < step[k] * usual * 2:
            reason = f"the number goes on by {step[k]} in {span[k] * 1e-9:g} s"
            table.fail("frame", int(start[k + 1]), reason)
        if step[k] <= _LONGEST:
            found.append(time[k] + np.arange(1, step[k]) * span[k] // step[k])
    return np.concatenate(found)
