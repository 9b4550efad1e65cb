"""True objects at any times, one by one, and how sensors would see them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...models.errors import InputError
from ...models.geometry.poses import poses_at
from ...models.records import Array, Objects, Recording, Sensor
from ..kit.alignment import Scored, settle


@dataclass(frozen=True, slots=True, eq=False)
class Track:
    """The object ``label`` of recording number ``recording``: time (n,) [s], position (n, 3)."""

    recording: int
    label: int
    time: Array
    position: Array
    gap: float

    def knows(self, time: Array) -> Array:
        """Whether (m,) it is known at ``time`` (m,), between samples that are near enough."""
        t = self.time
        after = np.searchsorted(t, time).clip(1, max(len(t) - 1, 1))
        if len(t) < 2:
            return np.zeros(len(time), bool)
        inside = (time >= t[0]) & (time <= t[-1])
        return np.asarray(inside & (t[after] - t[after - 1] <= self.gap))

    def at(self, time: Array) -> Array:
        """Positions (m, 3) [m] at ``time`` (m,)."""
        return np.stack([np.interp(time, self.time, x) for x in self.position.T], 1)


def tracks(recordings: Sequence[Recording], height: float) -> list[Track]:
    """The true objects of recordings, at ``height`` [m] where the truth has no z.

    Raises
    ------
    InputError : a recording has no truth
    """
    found = []
    for number, recording in enumerate(recordings):
        if recording.truth is None:
            raise InputError(f"{recording.meta.name}: has no truth")
        truth = recording.truth.objects
        gap = settle(Scored(), truth).max_gap
        assert gap is not None
        found += [
            Track(number, label, *one, gap) for label in np.unique(truth.label).tolist()
            if len((one := _one(truth, label, height))[0]) > 1
        ]  # fmt: skip
    return found


def _one(truth: Objects, label: int, height: float) -> tuple[Array, Array]:
    rows = np.flatnonzero(truth.label == label)
    step = np.repeat(np.arange(len(truth.time_ns)), np.diff(truth.row_offset))[rows]
    x = truth.state[rows]
    names = ("device_x", "device_y") if "device_x" in truth.state_names else ("x", "y")
    columns = [x[:, truth.state_names.index(n)] for n in names]
    z = x[:, truth.state_names.index("z")] if "z" in truth.state_names else 0 * columns[0] + height
    return truth.time_ns[step] / 1e9, np.stack((*columns, z), 1)


def places(known: Sequence[Track], track: Array, time: Array) -> Array:
    """Positions (n, 3) of the tracks number ``track`` (n,) at ``time`` (n,)."""
    found = np.zeros((len(track), 3))
    for k in np.unique(track):
        of = track == k
        found[of] = known[k].at(time[of])
    return found


def seen_from(sensors: Sequence[Sensor], which: Array, time: Array, place: Array) -> Array:
    """Positions (n, 3) in the frames of sensors number ``which`` (n,) at ``time`` (n,) [s]."""
    found = np.zeros((len(place), 3))
    for k in np.unique(which):
        of = which == k
        q, turn = poses_at(sensors[k], time[of])
        found[of] = np.einsum("nji,nj->ni", turn, place[of] - q)
    return found
