"""Detections from templates: the maps of a time explained by what targets reflect, not clustered.

What the filter follows is fitted to the cells about where it predicts each target, as
track-before-detect does (:mod:`.tbd`), and new targets are looked for in what is left. A detection
is where the likelihood has its mode, with the covariance there; what explains too little makes
none. The filter keeps existence and motion; what it does not know of a target (class, heading,
brightness, size) is kept for it by label.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...models.classifier import CLASSES
from ...models.records import Array, Objects, Recording, Scan
from .choice import Choice
from .params import MapParams
from .tbd.filter import FIRST, doubted, due
from .tbd.moves import born, overlapping, rethought, without
from .tbd.params import Params
from .tbd.scene import Layout, View
from .tbd.targets import PEDESTRIAN, VEHICLE, Targets, prior, update

STD = np.array([0.3, 0.3, 0.5, 0.5, 0.15, 0.3, 0.1])
"""Deviations of the state about what is kept of it and predicted by the filter."""
NEAR = 1.5
"""Distance [m] of a target of the filter up to which it is the one that was detected."""
TIME, AGE, LOG_ODDS, STATE = 0, 1, 2, 3
"""Columns of what is kept of a target: time [ns], age [scans], of being a vehicle, state (7,)."""

Kept = Mapping[int, Array]
"""What is kept (10,) of targets by label."""


@dataclass(frozen=True, slots=True, eq=False)
class Templates:
    """The source of detections for a recording: its layout, and which maps are used."""

    setup: Recording
    params: Params
    choice: Choice
    layout: Layout

    @staticmethod
    def of(setup: Recording, params: MapParams) -> Templates:
        """The source for the maps of a recording.

        Raises
        ------
        InputError : fewer streams of maps than are asked for; one that does not state its waveform
        """
        own = Params(
            map_region=params.map_region, stations=params.stations, fuse_within=params.fuse_within
        )
        choice = Choice.of(setup, own)
        return Templates(setup, own, choice, Layout.of(setup, choice.used, own))

    @property
    def region(self) -> tuple[float, ...]:
        """What is watched: x_min, x_max, y_min, y_max [m]."""
        return self.params.map_region

    def used(self, scans: Iterable[Scan]) -> Iterator[Scan]:
        """The scans but for the maps that are not used; those used at the time of their window.

        Raises
        ------
        InputError : at the end, if a stream that should be used had no scan
        """
        return self.choice.scans(scans, self.params.fuse_within)

    def see(
        self, scans: Sequence[Scan], label: Array, where: Array, classes: Kept
    ) -> Detected | None:
        """What the maps among the ``scans`` of one time show; None if there are none.

        Followed are targets with ``label`` (k,), predicted at ``where`` (k, 2).
        """
        maps = [scan for scan in scans if scan.stream in self.choice.used]
        if not maps:
            return None
        params, time_ns = self.params, maps[0].time_ns
        targets = self._predicted(time_ns, label, where, classes)
        doubles = overlapping(targets, params)
        targets = targets.take(np.flatnonzero(~doubles))
        view = View.of(self.layout, maps, self.setup).shown(targets.kind, targets.vectors)
        mean = view.mean(targets.kind, targets.vectors)
        targets, mean = update(targets, view, mean, params)
        targets = doubted(targets, view, mean, params)
        worthless = np.flatnonzero(targets.exists <= 0)
        targets, mean = without(targets, view, mean, worthless)
        free = first = int(label.max(initial=-1)) + 1
        for one in targets.label[due(targets, params)].tolist():
            about = np.flatnonzero(targets.label == one)
            if len(about):
                targets, mean, free = rethought(targets, view, mean, int(about[0]), free, params)
        evidence = view.gains(mean, params.shape)
        targets, free = born(targets, view, mean, evidence, free, FIRST, params)
        sure = (targets.exists > 0) | (targets.label < first)
        return Detected(time_ns, targets.take(np.flatnonzero(sure)))

    def _predicted(self, time_ns: int, label: Array, where: Array, kept: Kept) -> Targets:
        """What the filter follows, with what is kept of it; the fit says anew that it exists."""
        n = len(label)
        rows = np.zeros((n, 10))
        for k, (one, place) in enumerate(zip(label.tolist(), where, strict=True)):
            if one in kept:
                rows[k] = kept[one]
                dt = (time_ns - rows[k, TIME]) / 1e9
                at = rows[k, STATE:]
                if dt > 0:
                    at[2:4] = (place - at[:2]) / dt
            else:
                rows[k, STATE:] = prior(self.params, place, 0.0)[0]
        rows[:, STATE : STATE + 2] = where
        vehicle = rows[:, LOG_ODDS]
        return Targets(
            rows[:, STATE:].copy(),
            np.tile(np.diag(STD**2), (n, 1, 1)),
            np.where(vehicle > 0, VEHICLE, PEDESTRIAN),
            np.zeros(n),
            vehicle.copy(),
            label.copy(),
            rows[:, AGE].astype(np.int64),
        )

    def named(self, objects: Objects, classes: Kept) -> Objects:
        """The objects with their classes; of those that no map has shown, any is as likely."""
        odds = np.array([classes[l][LOG_ODDS] if l in classes else 0.0 for l in objects.label])
        vehicle = 1 / (1 + np.exp(-odds))
        p = np.stack((1 - vehicle, vehicle), 1)
        return replace(objects, class_names=CLASSES, class_index=p.argmax(1), class_probability=p)


@dataclass(frozen=True, slots=True, eq=False)
class Detected:
    """The targets that explain the maps of a time, and where they are as detections."""

    time_ns: int
    targets: Targets

    @property
    def z(self) -> Array:
        """Positions (n, 2) [m]."""
        return self.targets.m[:, :2]

    @property
    def R(self) -> Array:
        """Their covariances (n, 2, 2) [m^2]."""
        return self.targets.P[:, :2, :2]

    def recognise(self, label: Array, where: Array, classes: Kept) -> Kept:
        """What is kept of the targets with ``label`` (k,), found at ``where``, and of others."""
        known, t = dict(classes), self.targets
        if not len(t):
            return known
        for one, place in zip(label.tolist(), where, strict=True):
            d = np.hypot(*(t.m[:, :2] - place).T)
            j = int(d.argmin())
            if d[j] < NEAR:
                row = np.concatenate(([self.time_ns, t.age[j], t.vehicle[j]], t.m[j]))
            elif one in known:
                row = known[one].copy()
                row[[TIME, AGE]] = self.time_ns, row[AGE] + 1
            else:
                continue
            row[STATE : STATE + 2] = place
            known[one] = row
        return known
