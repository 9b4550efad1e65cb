"""What a log says that is possible to write and hardly possible to happen: said, never refused.

A sign that was lost, a unit that was taken for another, columns that changed places or a row that
was doubled give a log that can be read. What gives them away: rows that are there twice or late;
values far from the line between their neighbours; ranges that no place has (triangles that do not
close, circles that do not meet); intervals that no such device has; a truth that the measurements
contradict. Each is one warning with its count and, where rows are meant, the line of the first.
"""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence

import numpy as np

from ....models.columns import ACTIVE
from ....models.geometry.poses import pose_at
from ....models.records import Array, Sensor, Stream, Truth
from .log import Log

_log = logging.getLogger(__name__)
_STEP = 0.4
"""Deviation from the line between neighbours that is never told [m]."""
_WIDE = 20
"""Usual intervals between two neighbours beyond which nothing is told of what is between."""
_SIGMAS = 8.0
"""Standard deviations, by the median, from which on a deviation is told."""
_SLACK = 0.5
"""What triangles and circles may miss [m]."""
_APART = 0.3
"""What the ranges of one anchor, or of one second, may differ from a truth more than all [m]."""
_FEW = 0.02
"""Share of what may miss without being told."""
_NEAR = 0.25
"""Time within which the ranges of several anchors speak of one place [s]."""
_PAUSES = 1000
"""Usual intervals in a pause from which on it is told, and a minute at least."""
_LONG, _SHORT = 5.0, 5e-4
"""Intervals [s] between the ranges of one link, or scans, that no device has."""


def rows(table: Log, time: Array) -> None:
    """Say which rows are there twice, and which are earlier than those before them."""
    seen: set[tuple[str, ...]] = set()
    twice = np.zeros(len(table), bool)
    for i, row in enumerate(zip(*table.columns.values(), strict=True)):
        twice[i] = row in seen
        seen.add(row)
    _tell(table, twice, "rows are there twice")
    if table.reading.restarts == "sort":
        return
    late = np.zeros(len(table), bool)
    for g in np.unique(table.group).tolist():
        own = np.flatnonzero(table.group == g)
        late[own] = time[own] < np.maximum.accumulate(time[own])
    _tell(table, late, "rows are earlier than one before them, and were sorted")
    order = np.argsort(time, kind="stable")
    steps = np.diff(time[order])
    pause = np.zeros(len(table), bool)
    if (steps > 0).any():
        usual = float(np.median(steps[steps > 0]))
        pause[order[1:]] = steps > max(_PAUSES * usual, 60e9)
    _tell(table, pause, "rows follow a pause that is very long against the others")


def links(table: Log, time: Array, link: Array, distance: Array) -> None:
    """Say which ranges jump, and whether the intervals of a link are possible."""
    jumps = np.zeros(len(table), bool)
    intervals = []
    for one in np.unique(link).tolist():
        own = np.flatnonzero((link == one) & ~np.isnan(distance))
        own = own[np.argsort(time[own], kind="stable")]
        jumps[own] = outliers(time[own] * 1e-9, distance[own][:, None])
        intervals.append(np.diff(np.unique(time[own])))
    _tell(table, jumps, "ranges jump: they are far from those before and after")
    pair = np.stack([time, link]) if len(link) else np.zeros((2, 0), np.int64)
    _, which, count = np.unique(pair, axis=1, return_inverse=True, return_counts=True)
    several = (count[which.ravel()] > 1) & ~np.isnan(distance)
    if 0 < several.sum() <= 0.1 * len(several):
        _tell(table, several, "ranges share link and time with another")
    _interval(table, np.concatenate([np.zeros(0, np.int64), *intervals]), "ranges of a link")


def path(table: Log, time: Array, label: Array, place: Array) -> None:
    """Say which rows of a truth jump away from the path of their object; ``place`` is (m, 2)."""
    jumps = np.zeros(len(table), bool)
    for one in np.unique(label).tolist():
        own = np.flatnonzero((label == one) & ~np.isnan(place).any(axis=1))
        own = own[np.argsort(time[own], kind="stable")]
        jumps[own] = outliers(time[own] * 1e-9, place[own])
    _tell(table, jumps, "places jump: they are far from those before and after")


def scans(table: Log, time: Array, which: Array, model: Mapping[str, object]) -> None:
    """Say whether the intervals of scans are possible, and points where nothing can be seen."""
    steps = [np.diff(np.unique(time[which == one])) for one in np.unique(which).tolist()]
    _interval(table, np.concatenate([np.zeros(0, np.int64), *steps]), "scans", 60.0)
    if "range" in table:
        limit = model.get("max_range")
        if isinstance(limit, int | float):
            beyond = table.values("range", missing=True) > limit
            _tell(table, beyond, f"ranges are beyond max_range, {limit:g} m")
    if "azimuth" in table:
        azimuth = np.abs(table.values("azimuth", missing=True))
        _tell(table, azimuth > 2 * np.pi + 1e-9, "azimuths are beyond a full turn: are they in deg")
        unit = getattr(table.fields.get("azimuth"), "unit", "")
        top = np.nanmax(azimuth, initial=0.0)
        if unit == "deg" and 0 < top < np.radians(2 * np.pi):
            text = "%s: no azimuth is beyond %.2f degrees: are they in rad?"
            _log.warning(text, table.path, np.degrees(top))
    region = model.get("clutter_region")
    if "x" in table and isinstance(region, list | tuple) and len(region) == 4:
        x, y = (table.values(key, missing=True) for key in "xy")
        outside = (x < region[0]) | (x > region[1]) | (y < region[2]) | (y > region[3])
        _tell(table, outside, "points are outside clutter_region")


def geometry(path: object, stream: Stream, sensors: Mapping[str, Sensor]) -> None:
    """Say whether ranges that belong together have a place, anywhere and at any height."""
    event = np.repeat(np.arange(len(stream)), np.diff(stream.row_offset))
    active = stream.scan["mode"][event] == ACTIVE
    event, d = event[active], stream.rows["distance"][active]
    missed, tried, residuals = 0, 0, []
    for tx in np.unique(stream.scan["tx"][event]).tolist():
        own = stream.scan["tx"][event] == tx
        rx, t = stream.scan["rx"][event][own], stream.time_ns[event][own] * 1e-9
        found, place = _together(t, rx, d[own], stream.nodes, sensors)
        gap = np.linalg.norm(place[:, None] - place[None], axis=2)
        for i in range(len(place)):
            for j in range(i):
                a, b = found[:, i], found[:, j]
                both = ~np.isnan(a) & ~np.isnan(b)
                bad = np.abs(a - b) > gap[i, j] + _SLACK
                bad |= a + b < gap[i, j] - _SLACK
                missed, tried = missed + int((bad & both).sum()), tried + int(both.sum())
        residuals += _circles(found, place)
    if missed > _FEW * tried:
        text = "%s: %d of %d pairs of ranges belong to no place: |a - b| or a + b contradicts the "
        text += "anchors' distance: check units, ids and anchors"
        _log.warning(text, path, missed, tried)
    elif len(residuals) >= 5 and float(np.median(np.abs(residuals))) > _APART:
        text = (
            "%s: the ranges of %d times have no place in common, by %.2g m: check ids and anchors"
        )
        _log.warning(text, path, len(residuals), float(np.median(np.abs(residuals))))


def against_ranges(
    path: object, truth: Truth, streams: Mapping[str, Stream], sensors: Mapping[str, Sensor]
) -> None:
    """Say whether the truth contradicts the ranges."""
    o = truth.objects
    pair = ("device_x", "device_y") if "device_x" in o.state_names else ("x", "y")
    if len(np.unique(o.label)) != 1 or not set(pair) <= set(o.state_names):
        return
    known = o.time_ns[np.repeat(np.arange(len(o.time_ns)), np.diff(o.row_offset))] * 1e-9
    place = o.columns(*pair)
    for stream in (s for s in streams.values() if s.kind == "uwb"):
        event = np.repeat(np.arange(len(stream)), np.diff(stream.row_offset))
        ok = stream.scan["mode"][event] == ACTIVE
        t = stream.time_ns[event] * 1e-9
        ok &= (t >= known[0]) & (t <= known[-1])
        if len(np.unique(stream.scan["tx"][event[ok]])) != 1 or ok.sum() < 10:
            continue
        event, t, d = event[ok], t[ok], stream.rows["distance"][ok]
        p = np.column_stack([np.interp(t, known, place[:, k]) for k in (0, 1)])
        rx = stream.scan["rx"][event]
        off = np.zeros(len(d))
        for one in np.unique(rx).tolist():
            own, anchor = rx == one, sensors[stream.nodes[one]]
            at = anchor.time_ns * 1e-9
            a = np.column_stack([np.interp(t[own], at, anchor.position[:, k]) for k in (0, 1)])
            off[own] = d[own] - np.linalg.norm(p[own] - a, axis=1)
        middle = float(np.median(off))
        spread = float(1.4826 * np.median(np.abs(off - middle)))
        if spread > _SLACK or abs(middle) > 1.0:
            text = (
                "%s: ranges differ from those of the truth by %.2f m and %.2f m around it: check "
            )
            text += "its frame, clock and units, or let 'align' find them"
            _log.warning(text, path, middle, spread)
            continue
        for one in np.unique(rx).tolist():
            apart = float(np.median(off[rx == one])) - middle
            if abs(apart) > _APART:
                text = "%s: ranges of %s differ from those of the truth by %.2f m more than others"
                _log.warning(text, path, stream.nodes[one], apart)
        wrong = _contradicted(t, rx, np.abs(off - middle))
        if wrong:
            text = "%s: at %d s most ranges contradict the truth: check its rows there, from %.1f s"
            _log.warning(text, path, len(wrong), wrong[0])


def _contradicted(t: Array, rx: Array, off: Array) -> list[float]:
    """Seconds in which ranges of three anchors and more are mostly off by more than usual."""
    second = np.floor(t).astype(np.int64)
    order = np.argsort(second, kind="stable")
    parts = np.split(order, np.flatnonzero(np.diff(second[order])) + 1)
    medians = [(second[p[0]], float(np.median(off[p]))) for p in parts if len(set(rx[p])) > 2]
    usual = float(np.median([m for _, m in medians])) if medians else 0.0
    return [float(s) for s, m in medians if m > max(_APART, 4 * usual)]


def against_points(
    path: object, truth: Truth, streams: Mapping[str, Stream], sensors: Mapping[str, Sensor]
) -> None:
    """Say whether true objects have no points near them."""
    o = truth.objects
    if not {"x", "y"} <= set(o.state_names):
        return
    step = np.repeat(np.arange(len(o.time_ns)), np.diff(o.row_offset))
    place, at = o.columns("x", "y"), o.time_ns[step]
    for stream in streams.values():
        points = _points(stream)
        if points is None or not len(points):
            continue
        near: dict[int, list[float]] = {}
        usual = np.median(np.diff(o.time_ns)) if len(o.time_ns) > 1 else 0
        for k in np.unique(np.linspace(0, len(stream) - 1, 200).astype(int)).tolist():
            late = np.abs(at - stream.time_ns[k])
            own = late == late.min(initial=1 << 62)
            own &= late <= max(usual, 10**9)
            p, R = pose_at(sensors[stream.nodes[0]], int(stream.time_ns[k]))
            cloud = points[stream.row_offset[k] : stream.row_offset[k + 1]] @ R[:2, :2].T + p[:2]
            if len(cloud) and own.any():
                gap = np.linalg.norm(cloud[:, None] - place[own][None], axis=2).min(axis=0)
                gap /= 5 + 0.05 * np.linalg.norm(place[own] - p[:2], axis=1)
                for label, one in zip(o.label[own].tolist(), gap.tolist(), strict=True):
                    near.setdefault(label, []).append(one)
        for label, gaps in near.items():
            far = int(np.sum(np.array(gaps) > 1))
            if len(gaps) >= 10 and far > 0.3 * len(gaps):
                text = "%s: object %d has no points near it at %d of %d times: check frame, clock, "
                _log.warning(text + "units and axes", path, label, far, len(gaps))


def doppler(path: object, streams: Mapping[str, Stream]) -> None:
    """Say whether Doppler contradicts how ranges change from a scan to the next.

    The two nearest points of consecutive scans are taken as one target, which most are not among
    clutter, so that only the typical ratio counts.
    """
    for name, stream in streams.items():
        points = _points(stream)
        if points is None or "doppler" not in stream.rows or len(stream) < 3:
            continue
        speed, found = stream.rows["doppler"], list[tuple[float, float]]()
        for k in np.unique(np.linspace(0, len(stream) - 2, 400).astype(int)).tolist():
            a, b, c = stream.row_offset[k : k + 3]
            dt = (stream.time_ns[k + 1] - stream.time_ns[k]) * 1e-9
            if a == b or b == c:
                continue
            gap = np.linalg.norm(points[a:b, None] - points[None, b:c], axis=2)
            near = gap.argmin(axis=1)
            mutual = gap.argmin(axis=0)[near] == np.arange(b - a)
            rate = np.linalg.norm(points[b:c][near], axis=1) - np.linalg.norm(points[a:b], axis=1)
            pairs = zip(rate[mutual] / dt, speed[a:b][mutual], strict=True)
            found += [(float(r), float(s)) for r, s in pairs]
        rates, speeds = np.array(found or [(0.0, 0.0)]).T
        fast = np.abs(speeds) > max(np.median(np.abs(speeds)), 1e-9)
        if fast.sum() < 20:
            continue
        ratio = float(np.median(rates[fast] / speeds[fast]))
        together = float(np.mean(rates[fast] * speeds[fast] > 0))
        if ratio < -0.3:
            text = (
                "%s: %s: Doppler has the sign of approaching: if positive is approaching, scale: -1"
            )
            _log.warning(text, path, name)
        elif together > 0.65 and not 1 / 2.5 < ratio < 2.5:
            text = "%s: %s: ranges change %.2g times as fast as Doppler says: check units"
            _log.warning(text, path, name, ratio)


def outliers(time: Array, values: Array) -> Array:
    """Which of ``values`` (k, d) at ``time`` (k,) [s] lie off the line between their neighbours.

    Beyond :data:`_STEP` and :data:`_SIGMAS` standard deviations by the median, more than their
    neighbours do; the first and the last are held against the line through the next two.
    """
    k = len(time)
    found = np.zeros(k, bool)
    if k < 4:
        return found
    before = np.concatenate([[1], np.arange(k - 2), [k - 2]])
    after = np.concatenate([[2], np.arange(2, k), [k - 3]])
    span = time[after] - time[before]
    w = np.where(span == 0, 0.5, (time - time[before]) / np.where(span == 0, 1, span))
    w = np.clip(w, -1.0, 2.0)
    line = values[before] + w[:, None] * (values[after] - values[before])
    off = np.linalg.norm(values - line, axis=1)
    step = np.diff(time)
    off[np.abs(span) > _WIDE * float(np.median(step))] = 0.0
    limit = np.full(k, max(_STEP, _SIGMAS * 1.4826 * float(np.median(off))))
    limit[[0, -1]] *= 2
    peak = np.ones(k, bool)
    peak[1:] &= off[1:] >= off[:-1]
    peak[:-1] &= off[:-1] >= off[1:]
    return np.asarray((off > limit) & peak)


def _together(
    t: Array, rx: Array, d: Array, nodes: Sequence[str], sensors: Mapping[str, Sensor]
) -> tuple[Array, Array]:
    """Ranges (k, n) of the anchors at 200 times or less, NaN where there is none, and places."""
    anchors = [a for a in np.unique(rx).tolist() if len(sensors[nodes[a]].time_ns) == 1]
    times = t[np.unique(np.linspace(0, len(t) - 1, 200).astype(int))]
    found = np.full((len(times), len(anchors)), np.nan)
    for k, a in enumerate(anchors):
        own = rx == a
        at = np.clip(np.searchsorted(t[own], times), 0, own.sum() - 1)
        earlier = np.maximum(at - 1, 0)
        closer = np.abs(t[own][earlier] - times) < np.abs(t[own][at] - times)
        at = np.where(closer, earlier, at)
        near = np.abs(t[own][at] - times) <= _NEAR
        found[near, k] = d[own][at[near]]
    place = np.array([sensors[nodes[a]].position[0] for a in anchors]).reshape(-1, 3)
    return found, place


def _circles(found: Array, place: Array) -> list[float]:
    """By how much [m] the ranges of four anchors and more, at any height, have no place in common.

    ``r^2 - |a|^2 = c - 2 a . p`` is linear in the place p and in c, which holds the height too.
    """
    out = []
    for r in found:
        ok = ~np.isnan(r)
        if ok.sum() < 4:
            continue
        a = place[ok, :2] - place[ok, :2].mean(axis=0)
        A = np.column_stack([np.ones(ok.sum()), -2 * a])
        if np.linalg.matrix_rank(A, tol=0.1) < 3:
            continue
        b = r[ok] ** 2 - np.sum(a**2, axis=1)
        residual = b - A @ np.linalg.lstsq(A, b, rcond=None)[0]
        freedom = ok.sum() - 3
        out.append(float(np.sqrt(np.sum(residual**2) / freedom) / (2 * max(np.mean(r[ok]), 0.1))))
    return out


def _points(stream: Stream) -> Array | None:
    """Points (m, 2) of a radar in its frame, None of what is none."""
    if stream.kind == "position":
        return np.column_stack([stream.rows["x"], stream.rows["y"]])
    if stream.kind == "range_bearing":
        r, azimuth = stream.rows["range"], stream.rows["azimuth"]
        return np.column_stack([r * np.cos(azimuth), r * np.sin(azimuth)])
    return None


def overlap(path: object, truth: Truth, streams: Mapping[str, Stream]) -> None:
    """Say whether the truth is of other times than the log."""
    known = truth.objects.time_ns
    time = np.concatenate([s.time_ns for s in streams.values()] or [np.zeros(0, np.int64)])
    if not len(known) or not len(time):
        return
    inside = (time >= known[0]) & (time <= known[-1])
    if inside.mean() < 0.5:
        text = "%s: %d of %d times of the log are within those of the truth: check its clock"
        _log.warning(text, path, int(inside.sum()), len(time))


def _interval(table: Log, steps: Array, what: str, longest: float = _LONG) -> None:
    if len(steps) < 3:
        return
    middle = float(np.median(steps)) * 1e-9
    if not _SHORT <= middle <= longest:
        text = "%s: %s are %.3g s apart: check the unit of the time"
        _log.warning(text, table.path, what, middle)


def _tell(table: Log, bad: Array, what: str) -> None:
    """Say how many lines are meant, and the first."""
    if bad.any():
        places = [table.places[i] for i in np.flatnonzero(bad).tolist()]
        path, line = min(places)
        count = len(set(places))
        _log.warning("%s: %d %s; the first at line %d", path, count, what, line)
