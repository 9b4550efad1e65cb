"""Times at which lines of sight of a UWB device were blocked, as shades of grey."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np

from ...models.records import Recording
from .panels import spans

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_SHADE = 0.1
"""Opacity for each anchor that is blocked."""


def blockages(recording: Recording) -> list[tuple[float, float, int]]:
    """Spans [s] in which lines of sight were blocked, and how many at a time."""
    truth = recording.truth
    if truth is None or not len(truth.blocked_time_ns):
        return []
    events = [s.time_ns for s in recording.streams.values() if s.kind == "uwb"]
    ticks = np.unique(np.concatenate([*events, truth.blocked_time_ns]))
    time_ns, count = np.unique(truth.blocked_time_ns, return_counts=True)
    number = np.zeros(len(ticks), int)
    number[np.searchsorted(ticks, time_ns)] = count
    step = float(np.median(np.diff(ticks))) / 1e9 if len(ticks) > 1 else 0.0
    return spans(ticks / 1e9, number, step)


def shade(axes: Iterable[Axes], recording: Recording) -> None:
    """Shade the blockages of ``recording`` behind what ``axes`` show over time."""
    for a in axes:
        for start, stop, count in sorted(blockages(recording), key=lambda span: span[2]):
            label = f"{count} link{'s' * (count > 1)} blocked"
            a.axvspan(
                start,
                stop,
                facecolor=str(1 - _SHADE * min(count, 6)),
                lw=0,
                zorder=0.1,
                label=label,
            )
