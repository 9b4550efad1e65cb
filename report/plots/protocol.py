"""A kind of plot: a module with these names; and its inputs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np

from ...models.errors import InputError
from ...models.records import Array, Estimates, Recording, Scores

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True, slots=True, eq=False)
class Inputs:
    """Records to be drawn; ``pooled`` are the ``scores`` of recordings pooled by scenario."""

    recordings: tuple[Recording, ...] = ()
    estimates: tuple[Estimates, ...] = ()
    scores: Scores | None = None
    pooled: Scores | None = None

    @property
    def recording(self) -> Recording:
        """The only recording.

        Raises
        ------
        InputError : there are several
        """
        if len(self.recordings) != 1:
            raise InputError(f"one recording is drawn at a time, not {len(self.recordings)}")
        return self.recordings[0]

    @property
    def tables(self) -> tuple[Scores, Scores]:
        """The scores of recordings and those pooled."""
        assert self.scores is not None and self.pooled is not None
        return self.scores, self.pooled


@dataclass(frozen=True, slots=True)
class Selection:
    """The span of time [s] that is drawn, both ends included."""

    start: float = -np.inf
    stop: float = np.inf

    def times(self, time: Array) -> Array:
        """Which of ``time`` (n,) [s], increasing, are drawn, as indices.

        Where none is within the span, the last one before its end.
        """
        inside = np.flatnonzero((self.start <= time) & (time <= self.stop))
        if len(inside):
            return inside
        before = np.searchsorted(time, self.stop, side="right")
        return np.arange(before)[-1:]


class Plot(Protocol):
    """A kind of plot as the entry-point group ``echoset.plots`` finds it.

    ``SUMMARY`` : one line for ``echoset list``
    ``NEEDS`` : what there must be among its inputs: ``recording``, ``estimates``, ``scores``
    ``USES`` : what else it can make something of
    ``SIZE`` : width and height [cm]; a tall stack of panels grows beyond it
    """

    SUMMARY: str
    NEEDS: tuple[str, ...]
    USES: tuple[str, ...]
    SIZE: tuple[float, float]

    def draw(self, figure: Figure, inputs: Inputs, selection: Selection) -> None:
        """Draw on ``figure``, which is empty and has a size.

        Raises
        ------
        InputError : the inputs lack what the plot shows
        """
        ...
