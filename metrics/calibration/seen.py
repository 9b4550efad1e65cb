"""What a radar has seen of true targets: scans, targets in view, and detections near them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import pi

import numpy as np

from ...models.parameters import parameter, require
from ...models.radar.detection import View, polar
from ...models.records import Array, Recording, Sensor
from .quantities import blocks
from .tracks import Track, places, seen_from

SLOPE = 0.05
"""Half the time [s] over which places are differentiated."""
GATE = 18.0
"""Squared distance within which all but 1e-4 of the detections of a target are."""
LATTICE = 240
"""Points of a disc by which areas are measured."""


@dataclass(frozen=True)
class RadarParams:
    """What is looked at."""

    TITLE = "radars"

    reach: float = parameter(
        30.0, "m", "how far from a target detections are looked at", within="(0, inf)"
    )
    latency_min: float = parameter(-1.0, "s", "least latency that is tried")
    latency_max: float = parameter(5.0, "s", "greatest latency that is tried")
    max_range: float = parameter(
        0.0, "m", "end of the view where scans state none; 0: nowhere", within="[0, inf)"
    )
    target_height: float = parameter(0.0, "m", "height of targets where the truth has no z")

    def __post_init__(self) -> None:
        ok = self.latency_min <= self.latency_max
        require(ok, "latency_max", "at least latency_min", self.latency_max)


@dataclass(frozen=True, slots=True, eq=False)
class Data:
    """Scans (K,) of a stream, their detections (N,), pairs (P,) of scans and targets in view.

    Candidates (C,) are the pairs and detections that are near each other. ``area`` (K,) [m^2] is
    that within reach of the targets of a scan. ``inside`` (P,) are pairs well in view, ``alone``
    those of them with no other target near.
    """

    polar: bool
    known: Sequence[Track]
    sensors: Sequence[Sensor]
    scan_time: Array
    recording: Array
    z: Array
    offset: Array
    scan: Array
    pair_scan: Array
    pair_track: Array
    pair: Array
    detection: Array
    area: Array
    inside: Array
    alone: Array

    def half(self, which: int) -> Data:
        """Every other block of the scans."""
        kept = blocks(len(self.scan_time)) % 2 == which
        det, pairs = kept[self.scan], kept[self.pair_scan]
        some = pairs[self.pair]
        new_scan, new_det = np.cumsum(kept) - 1, np.cumsum(det) - 1
        new_pair = np.cumsum(pairs) - 1
        return replace(
            self,
            scan_time=self.scan_time[kept],
            recording=self.recording[kept],
            z=self.z[det],
            offset=self.offset[det],
            scan=new_scan[self.scan[det]],
            pair_scan=new_scan[self.pair_scan[pairs]],
            pair_track=self.pair_track[pairs],
            pair=new_pair[self.pair[some]],
            detection=new_det[self.detection[some]],
            area=self.area[kept],
            inside=self.inside[pairs],
            alone=self.alone[pairs],
        )

    def expected(self, latency: float, shift: float = 0.0) -> Array:
        """What candidates (C, 2) would be, of targets ``shift`` [s] later than ``latency`` says."""
        scan = self.pair_scan[self.pair]
        time = self.scan_time[scan] + self.offset[self.detection] - latency
        x = places(self.known, self.pair_track[self.pair], time + shift)
        local = seen_from(self.sensors, self.recording[scan], time + shift, x)
        return measured(local, self.polar)

    def errors(self, h: Array, b: Array) -> Array:
        """Candidates less what they would be."""
        return wrapped(self.z[self.detection] - h - b, self.polar)

    def slope(self, latency: float) -> Array:
        """Change (C, 2) of what candidates would be with the latency."""
        change = self.expected(latency, -SLOPE) - self.expected(latency, SLOPE)
        return wrapped(change, self.polar) / (2 * SLOPE)

    @property
    def measure(self) -> Array:
        """Area (C,) [m^2] of a unit of what is measured."""
        one = np.ones(len(self.pair))
        return self.z[self.detection, 0] if self.polar else one


def measured(local: Array, is_polar: bool) -> Array:
    """Range and azimuth, or x and y, (n, 2) of positions (n, 3) in the sensor's frame."""
    if not is_polar:
        return local[:, :2]
    return np.stack((np.linalg.norm(local, axis=1), np.arctan2(local[:, 1], local[:, 0])), 1)


def wrapped(e: Array, is_polar: bool) -> Array:
    """Differences (n, 2), angles among them the short way."""
    if is_polar:
        e = e.copy()
        e[:, 1] -= 2 * pi * np.round(e[:, 1] / (2 * pi))
    return e


def flat(z: Array, is_polar: bool) -> Array:
    """Positions (n, 2) in the sensor's frame."""
    return z[:, :1] * np.stack((np.cos(z[:, 1]), np.sin(z[:, 1])), 1) if is_polar else z


def gathered(
    recordings: Sequence[Recording],
    name: str,
    known: Sequence[Track],
    latency: float,
    params: RadarParams,
    b: Array | None = None,
    std: Array | None = None,
    slack: float = 0.3,
) -> Data:
    """Scans, targets in view and detections near them, by ``latency``.

    Where they are known, detections are off by ``b`` (2,) with deviations ``std`` (2,).

    Targets are known ``slack`` [s] before and after, too.
    """
    parts, sensors, views = [], [], list[View]()
    scans = 0
    for number, recording in enumerate(recordings):
        stream = recording.streams[name]
        sensors.append(recording.sensors[stream.nodes[0]])
        K = len(stream)
        columns = [{c: v[k] for c, v in stream.scan.items()} for k in range(K)]
        views += [View.of(one, params.max_range or np.inf) for one in columns]
        is_polar = stream.kind == "range_bearing"
        names = ("range", "azimuth") if is_polar else ("x", "y")
        z = np.stack([stream.rows[k] for k in names], 1)
        offset = stream.rows.get("time_offset", np.zeros(len(z)))
        scan = np.repeat(np.arange(K), np.diff(stream.row_offset)) + scans
        parts.append((stream.time_ns / 1e9, np.full(K, number), z, offset, scan))
        scans += K
    scan_time, recording_of, z, offset, scan = (
        np.concatenate(column) for column in zip(*parts, strict=True)
    )
    pairs = []
    for t, track in enumerate(known):
        time = scan_time - latency
        at = (
            (recording_of == track.recording)
            & track.knows(time - slack)
            & track.knows(time + slack)
        )
        pairs.append(np.stack((np.flatnonzero(at), np.full(at.sum(), t)), 1))
    pair_scan, pair_track = np.concatenate([np.zeros((0, 2), int), *pairs]).T
    time = scan_time[pair_scan] - latency
    x = places(known, pair_track, time)
    local = seen_from(sensors, recording_of[pair_scan], time, x)
    h = measured(local, is_polar) + (np.zeros(2) if b is None else b)
    margin = np.zeros(2) if std is None else 3 * std
    order = np.argsort(pair_scan, kind="stable")
    pair_scan, pair_track, h = pair_scan[order], pair_track[order], h[order]
    inside = _inside(views, pair_scan, h, is_polar, margin)
    place, where = flat(h, is_polar), flat(z, is_polar)
    # Wide enough for all of a target's own, and targets apart whose gates do not touch.
    across = margin[1] * h[:, 0].max(initial=0.0) if is_polar else margin[1]
    widest = max(float(margin[0]), float(across)) / 3
    reach = max(params.reach, 6 * widest)
    pair, detection = _near(pair_scan, place, scan, where, reach, scans)
    apart = 2 * float(np.sqrt(GATE)) * widest or reach / 2
    area, lonely = _areas(views, pair_scan, place, reach, apart, scans)
    return Data(
        is_polar, known, sensors, scan_time, recording_of, z, offset, scan, pair_scan, pair_track,
        pair, detection, area, inside, inside & lonely,
    )  # fmt: skip


def _inside(views: Sequence[View], scan: Array, h: Array, is_polar: bool, margin: Array) -> Array:
    """Whether (P,) places are in view, and what would be measured of them would be."""
    r, azimuth = h.T if is_polar else polar(h)
    along, across = margin if is_polar else (margin[0], margin[0] / np.maximum(r, 1e-9))
    found = np.ones(len(h), bool)
    for p, k in enumerate(scan.tolist()):
        view = views[k]
        if view == View():
            continue
        wide = np.broadcast_to(across, len(h))[p]
        ends = [(r[p] + s * along, azimuth[p] + w * wide) for s in (-1, 1) for w in (-1, 1)]
        near, turn = np.array(ends).T
        if view.range_min == 0:
            near = np.maximum(near, 0.0)
        found[p] = bool(view.contains(near, turn).all())
    return found


def _near(
    pair_scan: Array, place: Array, scan: Array, where: Array, reach: float, scans: int
) -> tuple[Array, Array]:
    """Pairs and detections (C,) of one scan within ``reach`` of each other."""
    start = np.searchsorted(scan, np.arange(scans + 1))
    found = []
    for p, k in enumerate(pair_scan.tolist()):
        rows = np.arange(start[k], start[k + 1])
        close = np.hypot(*(where[rows] - place[p]).T) < reach
        found.append(np.stack((np.full(close.sum(), p), rows[close]), 1))
    pair, detection = np.concatenate([np.zeros((0, 2), int), *found]).T
    return pair, detection


def _areas(
    views: Sequence[View], pair_scan: Array, place: Array, reach: float, apart: float, scans: int
) -> tuple[Array, Array]:
    """Area (K,) within reach of any target and in view, and which pairs (P,) lie ``apart``."""
    k = np.arange(LATTICE) + 0.5
    disc = np.sqrt(k / LATTICE)[:, None] * np.stack((np.cos(2.399963 * k), np.sin(2.399963 * k)), 1)
    area, alone = np.zeros(scans), np.ones(len(place), bool)
    one = pi * reach**2
    for k in np.unique(pair_scan).tolist():
        rows = np.flatnonzero(pair_scan == k)
        points = place[rows][:, None] + reach * disc
        to_all = np.linalg.norm(points[:, :, None] - place[rows], axis=-1)
        share = 1 / np.maximum((to_all < reach).sum(-1), 1)
        if views[k] != View():
            share = share * views[k].contains(*polar(points))
        area[k] = one * share.mean(1).sum()
        between = np.linalg.norm(place[rows][:, None] - place[rows], axis=-1)
        alone[rows] = (between < apart).sum(1) == 1
    return area, alone
