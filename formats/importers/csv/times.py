"""Times of logs: numbers, dates, times of day, ticks; and whether they can be what they seem.

A time is a number in a unit; the sum of several numbers (seconds and nanoseconds); ticks of a
counter of some ``bits`` at a ``rate``; or text. Text is ISO 8601, or a time of day ``HH:MM:SS.f``
(dots will do for colons), or what a ``format`` says in the words YYYY MM DD HH SS, MM for the month
and, after HH, the minute, f for decimals, mmm uuu for milli- and microseconds. What has no zone is
in the field's ``zone``, UTC by default; a time of day is of the ``date``, by default that of the
epoch, and goes on past midnight.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from datetime import UTC, date, datetime, timedelta
from decimal import Decimal

import numpy as np

from ....models.errors import ParameterError
from ....models.parameters import require
from ....models.records import Array
from ..text import Table
from .columns import TimeField

DAY = 86_400 * 10**9
_SCALE = {"": 9, "s": 9, "ms": 6, "us": 3, "ns": 0}
_NUMBER = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?", re.ASCII)
_ZONE = r"\s*(?P<zone>Z|[-+]\d\d(?::?\d\d)?)?"
_ISO = re.compile(
    r"(?P<YYYY>\d{4})(?P<s>[-/.]?)(?P<Mo>\d{1,2})(?P=s)(?P<DD>\d{1,2})"
    r"(?:[T ,]+(?P<HH>\d{1,2})(?P<c>:?)(?P<Mi>\d{2})(?:(?P=c)(?P<SS>\d{2})(?:[.,](?P<f>\d+))?)?)?"
    + _ZONE,
    re.ASCII,
)
_CLOCK = re.compile(
    r"(?P<HH>\d{1,2})[:.](?P<Mi>\d{1,2})[:.](?P<SS>\d{1,2})(?:[.,:](?P<f>\d+))?", re.ASCII
)
_WORDS = re.compile(r"YYYY|MM|DD|HH|SS|mmm|uuu|f+")


def epoch_ns(text: str) -> int:
    """The epoch [ns] after 1970, from ISO 8601; ParameterError if it is none."""
    try:
        found = datetime.fromisoformat(text)
    except ValueError:
        require(False, "epoch", "a time in ISO 8601", text)
    aware = found if found.tzinfo else found.replace(tzinfo=UTC)
    return (aware - datetime(1970, 1, 1, tzinfo=UTC)) // timedelta(microseconds=1) * 1000


def read(table: Table, keys: Sequence[str], given: TimeField, epoch: int) -> Array:
    """Times (m,) after ``epoch`` [ns] as int64 nanoseconds, of the columns ``keys``."""
    if given.rate is not None:
        return _ticks(table, keys[0], given)
    if is_text(table, keys, given):
        return _texts(table, keys, given, epoch)
    units = given.unit if len(given.unit) == len(keys) else given.unit * len(keys)
    time = np.zeros(len(table), np.int64)
    for key, unit in zip(keys, units, strict=True):
        part = _scaled(table, key, unit, given.scale)
        beyond = np.abs(time.astype(np.float64) + part) > 9e18
        table.none(key, beyond, "is beyond the years 1680 to 2260")
        time += part
    return time


def is_date(text: str) -> bool:
    """Whether ``text`` is a date, or a date and a time, in ISO 8601 and not a number."""
    return _ISO.fullmatch(text) is not None and not _NUMBER.fullmatch(text)


def is_clock(text: str) -> bool:
    """Whether ``text`` is a time of day, and not a number."""
    return _CLOCK.fullmatch(text) is not None and not _NUMBER.fullmatch(text)


def is_text(table: Table, keys: Sequence[str], given: TimeField) -> bool:
    """Whether the times are written as text: by a format, or as the first row shows."""
    if given.format or not len(table):
        return bool(given.format)
    first = [table.columns[key][0] for key in keys]
    joined = " ".join(first)
    dated = _ISO.fullmatch(joined) or _CLOCK.fullmatch(joined)
    return bool(dated) and not all(map(_NUMBER.fullmatch, first))


def _scaled(table: Table, key: str, unit: str, scale: float) -> Array:
    if scale == 1.0:
        return table.nanoseconds(key, unit or "s")
    factor = Decimal(repr(scale)).scaleb(_SCALE[unit])
    values = table.numbers(key)
    for index in np.flatnonzero(np.abs(values) > 9e18 / abs(float(factor))).tolist():
        table.fail(key, index, f"{table.columns[key][index]!r} is beyond the years 1680 to 2260")
    exact = (round(Decimal(field) * factor) for field in table.columns[key])
    return np.fromiter(exact, np.int64, len(table))


def _ticks(table: Table, key: str, given: TimeField) -> Array:
    """Ticks at a rate; one that falls by more than half of the counter's width has wrapped."""
    values = table.numbers(key)
    for index in np.flatnonzero((values != np.rint(values)) | (np.abs(values) > 2**63)).tolist():
        table.fail(key, index, f"{table.columns[key][index][:40]!r} is no whole number of ticks")
    ticks = [int(Decimal(field)) for field in table.columns[key]]
    if given.bits is not None:
        width = 1 << given.bits
        for i, tick in enumerate(list(ticks)):
            if not 0 <= tick < width:
                table.fail(key, i, f"{tick} does not fit into {given.bits} bits")
            if i:
                step = (tick - ticks[i - 1]) % width
                step -= width if step > width // 2 else 0
                ticks[i] = ticks[i - 1] + step
    per_tick = Decimal(10**9) / Decimal(repr(given.rate))
    exact = [round(tick * per_tick) for tick in ticks]
    for i, value in enumerate(exact):
        if abs(value) > 9 * 10**18:
            table.fail(key, i, f"{ticks[i]} ticks are beyond 280 years")
    return np.array(exact, np.int64)


def pattern(text: str, where: str) -> re.Pattern[str]:
    """The regular expression of a ``format``; ParameterError if it tells no time of day."""
    text = re.sub(r"SS[.,]f+", "SS", text)
    dense = not _WORDS.sub("", text)
    at, made, seen = 0, "", list[str]()
    for found in _WORDS.finditer(text):
        made += re.escape(text[at : found.start()]).replace(r"\ ", r"\s+")
        at, word = found.end(), found[0]
        if word == "MM":
            word = "Mi" if "HH" in seen and "Mi" not in seen else "Mo"
        word = "f" if word[0] == "f" else word
        if word in seen:
            raise ParameterError(f"{where}: format {text!r} tells {found[0]} twice")
        seen.append(word)
        fixed = dense or word in ("YYYY", "mmm", "uuu")
        made += f"(?P<{word}>\\d{{{len(found[0]) if fixed else f'1,{max(2, len(found[0]))}'}}})"
        if word == "SS" and not dense:
            made += r"(?:[.,](?P<f>\d+))?"
            seen.append("f")
    made += re.escape(text[at:]).replace(r"\ ", r"\s+")
    ok = {"HH", "Mi"} <= set(seen) and len({"DD", "Mo"} & set(seen)) in (0, 2)
    ok = ok and ("DD" not in seen or "YYYY" in seen)
    require(ok, f"{where}: format", "made of YYYY MM DD HH MM SS.f, mmm", text)
    return re.compile(made + (_ZONE if "DD" in seen else ""), re.ASCII)


def _texts(table: Table, keys: Sequence[str], given: TimeField, epoch: int) -> Array:
    """Times that are text; without a date they are of one day, and go on past midnight."""
    where = "columns.time"
    known = [pattern(given.format, where)] if given.format else [_ISO, _CLOCK]
    zone = _zone(given.zone, where)
    day = _day(given.date, where, epoch + zone)
    width = len(given.format) if not _WORDS.sub("", given.format) else 0
    times = np.zeros(len(table), np.int64)
    before = None
    for i in range(len(table)):
        text = " ".join(table.columns[key][i] for key in keys).strip()
        text = text.zfill(width) if text.isdigit() else text
        found = next((m for m in (p.fullmatch(text) for p in known) if m), None)
        if found is None:
            like = given.format or "2024-05-01T12:30:00.5Z or 12:30:00.5"
            table.fail(keys[0], i, f"{text[:40]!r} is no time like {like}")
        parts = found.groupdict()
        value = _time_of_day(parts, table, keys[0], i, text)
        if parts.get("DD"):
            try:
                days = (date(*(int(parts[k]) for k in ("YYYY", "Mo", "DD"))) - _EPOCH).days
            except ValueError:
                table.fail(keys[0], i, f"{text[:40]!r} is no day of the calendar")
            shift = _zone(parts["zone"], where) if parts.get("zone") else zone
            value += days * DAY - shift - epoch
        else:
            value += day - epoch - zone
            if before is not None:
                value += round((before - value) / DAY) * DAY if value < before - DAY // 2 else 0
            before = value
        if abs(value) > 9 * 10**18:
            table.fail(keys[0], i, f"{text[:40]!r} is beyond 280 years from the epoch")
        times[i] = value
    return times


_EPOCH = date(1970, 1, 1)


def _time_of_day(
    parts: dict[str, str | None], table: Table, key: str, index: int, text: str
) -> int:
    hour, minute, second = (int(parts.get(k) or 0) for k in ("HH", "Mi", "SS"))
    if hour > 23 or minute > 59 or second > 60:
        table.fail(key, index, f"{text[:40]!r} is no time of day")
    decimals = ((parts.get("mmm") or "") + (parts.get("uuu") or "")) or (parts.get("f") or "")
    return ((hour * 60 + minute) * 60 + second) * 10**9 + int(decimals[:9].ljust(9, "0"))


def _zone(text: str | None, where: str) -> int:
    """A zone such as ``+02:00`` as nanoseconds east of UTC."""
    if text in ("", "Z", "UTC", None):
        return 0
    found = re.fullmatch(r"([-+])(\d\d):?(\d\d)?", str(text), re.ASCII)
    require(found is not None, f"{where}: zone", "such as +02:00", text)
    assert found
    size = (int(found[2]) * 60 + int(found[3] or 0)) * 60 * 10**9
    return -size if found[1] == "-" else size


def _day(text: str, where: str, now: int) -> int:
    """The begin of the day ``text``, or of that of ``now``, in nanoseconds after 1970."""
    if not text:
        return now // DAY * DAY
    try:
        return (date.fromisoformat(text) - _EPOCH).days * DAY
    except ValueError:
        require(False, f"{where}: date", "a day such as 2024-05-01", text)
        raise


def runs(time: Array) -> Array:
    """Number of the pass of each row (m,), from 0: each time that the clock goes back, the next."""
    return np.asarray(np.cumsum(np.diff(time, prepend=time[:1]) < 0))


def continued(time: Array) -> Array:
    """``time`` (m,) whose passes follow one another at the median step."""
    steps = np.diff(time)
    ahead = steps[steps > 0]
    step = int(np.median(ahead)) if len(ahead) else 0
    made = np.cumsum(np.where(steps < 0, step, steps))
    return np.asarray(time[:1] + np.concatenate([[0], made]).astype(np.int64))


def stray(time: Array, pause: float) -> int | None:
    """The first row on the smaller side of a gap longer than ``pause`` [s], or None."""
    order = np.argsort(time, kind="stable")
    gaps = np.diff(time[order].astype(np.float64)) > pause * 1e9
    if not gaps.any():
        return None
    cut = int(gaps.argmax()) + 1
    last = len(gaps) - int(gaps[::-1].argmax())
    few = order[:cut] if cut <= len(time) - last else order[last:]
    return int(few.min())


def collapsed(time: Array, group: Array, text: bool) -> Array:
    """Rows (m,) that share a time with one before of their group, if clock times are whole seconds.

    Times from 1e6 s on, or written as ``text``, are those of a clock.
    """
    again = np.zeros(len(time), bool)
    if not len(time) or (time % 10**9).any() or not (text or np.abs(time).max() >= 10**15):
        return again
    order = np.lexsort((np.arange(len(time)), time, group))
    same = (np.diff(time[order]) == 0) & (np.diff(group[order]) == 0)
    again[order[1:][same]] = True
    return again
