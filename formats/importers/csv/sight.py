"""A first look at a log: how it may be written, and what its columns may be."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ....models.records import Array
from ..matlab import read_mat
from ..rows import restart
from ..text import read_text
from .times import is_clock, is_date

_ROWS = 2000
"""Rows that are looked at."""
MISSING = ("nan", "NaN", "NAN", "-", "--", "n/a", "N/A", "NA", "null", "None", "none")
_ROLES: dict[str, str] = {
    "time": r"t|time|times|timestamp|stamp|datetime|utc|unix|epoch|secs?|seconds|sec",
    "ticks": r"ticks?|counter|rx_?ticks|ts_ticks",
    "date": r"date|day",
    "clock": r"time|clock|hour|tod|time_?of_?day",
    "nanoseconds": r"nsecs?|nanoseconds?|nanosec|ns",
    "anchor": r"anchor|anchor_?id|node|node_?id|beacon|station|base|responder|dst|to|peer|addr",
    "device": r"tag|tag_?id|device|device_?id|mobile|rover|initiator|src|from|uwb_?id",
    "distance": r"range|distance|dist|ranging|rng|d|measured_?distance|range_?raw",
    "reference": r"ref|reference|ref_?anchor|reference_?anchor|ref_?id|anchor_?ref|master",
    "difference": r"tdoa|ddoa|dt|dd|diff|difference|delta|range_?diff(erence)?|time_?diff(erence)?",
    "std": r"std|sigma|stddev|range_?std|accuracy",
    "kind": r"kind|type|meas_?type|measurement_?type|msg|message",
    "quality": r"quality|q|fom|rssi|snr|conf|confidence|power|los|nlos",
    "range": r"range|r|rho",
    "azimuth": r"azimuth|az|bearing|angle|theta",
    "elevation": r"elevation|el|phi",
    "x": r"x|pos_?x|px|east|easting",
    "y": r"y|pos_?y|py|north|northing",
    "z": r"z|pos_?z|pz|up|height",
    "doppler": r"doppler|v|vr|v_?r|vel|velocity|radial_?velocity|speed",
    "power": r"power|snr|intensity",
    "scan": r"scan|scan_?id|frame|frame_?id|frame_?number|frame_?#|cycle",
    "sensor": r"sensor|sensor_?id|radar",
}
"""What columns are called, without their unit."""
_UNITS = {
    "mm": r"mm|millimet(er|re)s?", "cm": r"cm|centimet(er|re)s?", "km": r"km",
    "m": r"m|met(er|re)s?",
    "ms": r"ms|msec|millis|milliseconds?", "us": r"us|usec|micros|microseconds?",
    "ns": r"ns|nsec|nanos|nanoseconds?", "s": r"s|sec|secs|seconds?",
    "deg": r"deg|degrees?|°", "rad": r"rad|radians?", "km/h": r"kmh|kmph|km/h",
    "m/s": r"mps|m/s|ms-1", "dB": r"db|dbm",
}  # fmt: skip
_LENGTHS, _TIMES = ("mm", "cm", "km", "m"), ("ms", "us", "ns", "s")


@dataclass(frozen=True, slots=True, eq=False)
class Column:
    """A column: its name, the word in it that tells its meaning, its unit, fields and numbers."""

    name: object
    word: str
    unit: str
    text: list[str]
    numbers: Array

    @property
    def numeric(self) -> bool:
        """Whether what is not empty is a number."""
        there = [f for f in self.text if f and f not in MISSING]
        return bool(there) and int(np.isfinite(self.numbers).sum()) >= len(there)

    @property
    def known(self) -> Array:
        """The numbers that are finite."""
        return self.numbers[np.isfinite(self.numbers)]

    def called(self, role: str) -> bool:
        """Whether the name says that the column plays this role."""
        return re.fullmatch(_ROLES[role], self.word, re.I) is not None


@dataclass(frozen=True, slots=True, eq=False)
class Sight:
    """What a log looks like: its dialect, and the columns of its first ``rows`` rows."""

    delimiter: str
    comment: str
    decimal: str
    header: bool
    rows: int
    columns: list[Column]

    @staticmethod
    def of(path: Path) -> Sight:
        """The log at ``path``; FormatError if it is no text, or empty."""
        file = read_mat(path) if path.suffix == ".mat" else read_text(path)
        lines = file.lines()[:_ROWS]
        comment = next((m for m in "#%;" if lines[0].lstrip().startswith(m)), "")
        rows = [line for line in lines if line.strip()]
        rows = [line for line in rows if not (comment and line.lstrip().startswith(comment))]
        delimiter, split = _find_delimiter(rows)
        table = [split(line) for line in rows]
        width = Counter(map(len, table)).most_common(1)[0][0] if table else 0
        table = [row for row in table if len(row) == width]
        decimal = "," if delimiter != "," and _commas(table) else "."
        header = _is_header(table, decimal)
        names: list[object] = list(table[0]) if header else list(range(1, width + 1))
        body = table[1:] if header else table
        columns = [_column(name, [row[k] for row in body], decimal) for k, name in enumerate(names)]
        return Sight(delimiter, comment, decimal, header, len(body), columns)


def _find_delimiter(rows: Sequence[str]) -> tuple[str, Callable[[str], list[str]]]:
    """The delimiter that parts most rows into one number of fields, and what parts them."""
    best: tuple[float, str] = (0.0, ",")
    for rank, delimiter in enumerate("\t;,| "):
        counts = Counter(len(_split(row, delimiter)) for row in rows[:200])
        width, number = counts.most_common(1)[0] if counts else (1, 0)
        if width > 1:
            best = max(best, (number / max(len(rows[:200]), 1) - 0.05 * rank, delimiter))
    return best[1], lambda line: _split(line, best[1])


def _split(line: str, delimiter: str) -> list[str]:
    if delimiter == " ":
        return line.split()
    return [field.strip().strip('"') for field in line.rstrip("\r\n").split(delimiter)]


def _commas(table: Sequence[Sequence[str]]) -> bool:
    fields = [f for row in table[:200] for f in row]
    return any(re.fullmatch(r"[-+]?\d+,\d+", f) for f in fields)


def _number(field: str, decimal: str) -> float:
    text = field.replace(",", ".") if decimal == "," else field
    try:
        return float(text) if text.isascii() and "_" not in text else np.nan
    except ValueError:
        return np.nan


def _is_header(table: Sequence[Sequence[str]], decimal: str) -> bool:
    """Whether the first row is words, above columns of numbers or times."""
    if len(table) < 2:
        return bool(table)
    first, second = table[0], table[1]

    def value(field: str) -> bool:
        return np.isfinite(_number(field, decimal)) or is_date(field) or is_clock(field)

    return not any(map(value, first)) and any(map(value, second))


def _column(name: object, text: list[str], decimal: str) -> Column:
    word, unit = str(name).strip(), ""
    found = re.fullmatch(r"(.*?)[\s_]*[\[(/]\s*([^\])]+?)\s*[\])]?", word)
    parts = (found[1], found[2]) if found else tuple(word.rpartition("_")[::2])
    for known, pattern in _UNITS.items():
        if parts[0] and re.fullmatch(pattern, parts[1], re.I):
            word, unit = parts[0], known
            break
    numbers = np.array([_number(field, decimal) for field in text], np.float64)
    return Column(name, word.strip().replace(" ", "_"), unit, text, numbers)


def length_unit(group: Sequence[Column]) -> tuple[str, bool]:
    """The unit of lengths, by the name or else by their size, and whether it was guessed."""
    units = {c.unit for c in group} & set(_LENGTHS)
    if units:
        return units.pop(), False
    known = np.abs(np.concatenate([c.known for c in group]))
    known = known[known > 0]
    middle, whole = float(np.median(known)) if len(known) else 1.0, bool((known % 1 == 0).all())
    if whole and middle > 300:
        return "mm", True
    return ("cm", True) if whole and middle > 60 else ("m", True)


def time_unit(column: Column) -> tuple[str, bool]:
    """The unit of times, by the name or else by their size, and whether it was guessed."""
    if column.unit in _TIMES:
        return column.unit, False
    top = float(np.abs(column.known).max(initial=0.0))
    for unit, least in (("ns", 1e17), ("us", 1e14), ("ms", 1e11)):
        if top >= least:
            return unit, True
    steps = np.diff(column.known)
    median = float(np.median(steps[steps > 0])) if (steps > 0).any() else 0.0
    whole = bool((column.known % 1 == 0).all())
    return ("ms", True) if whole and 10 <= median < 1e4 and top < 1e9 else ("s", True)


def is_digits(column: Column) -> bool:
    """Whether whole numbers are times of day, HHMMSSmmm, that follow one another."""
    known = column.known
    if column.unit or not len(known) or (known % 1).any() or known.max() < 10_000_000:
        return False
    hour, rest = known // 10_000_000, known % 10_000_000
    minute, second = rest // 100_000, rest % 100_000 // 1000
    ok = (known < 240_000_000) & (minute < 60) & (second < 60)
    step = np.diff((hour * 60 + minute) * 60 + second + known % 1000 / 1000)
    return bool(ok.all()) and len(step) > 0 and float(np.median(np.abs(step))) < 60.0


def rises(known: Array) -> bool:
    steps = np.diff(known)
    return bool((steps >= 0).mean() > 0.95 and (steps > 0).any())


def restarts(column: Column) -> bool:
    time = np.nan_to_num(column.numbers * 1e3, posinf=0, neginf=0).clip(-9e18, 9e18)
    return restart(time.astype(np.int64), np.zeros(len(time), np.int64)) is not None


def positive(column: Column) -> bool:
    known = column.known
    return bool(len(known) and (known >= 0).mean() > 0.9 and len(np.unique(known)) > 1)


def is_range(key: str) -> bool:
    return (
        re.search(r"(^|[^a-z])(r|d|a|range|dist|distance|anchor)[^a-z]*\0", key, re.I) is not None
    )


def alike(free: Sequence[Column]) -> list[Column]:
    """Columns of numbers of one size, without a header: those that vary and lie close."""
    moving = [c for c in free if c.numeric and positive(c)]
    if not moving:
        return []
    sizes = np.array(
        [np.median(c.known[c.known > 0]) if (c.known > 0).any() else 0 for c in moving]
    )
    middle = np.median(sizes)
    return [c for c, size in zip(moving, sizes, strict=True) if middle / 10 <= size <= 10 * middle]
