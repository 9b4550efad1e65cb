"""The scans of one time as looks with clutter: what filters of point targets share.

A step of any of them is ``predict``, :func:`observe`, its own update and reduction,
:func:`remember`; and :func:`through` takes it through a recording.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import groupby
from typing import Any, Protocol, TypeVar

from ...models.records import Array, Scan
from .context import Context
from .cuts import Cut, Told
from .late import true_times
from .model.clutter_map import Maps, learnt, persistent
from .model.sensing import Look, SensorParams, count, looks
from .model.targets import within
from .source import Classes, Sight, recognised


@dataclass(frozen=True, slots=True, eq=False)
class Memory:
    """What is known beside the targets' densities.

    ``maps`` of persistent clutter are those of the streams, ``classes`` those of the targets, and
    ``crowd`` is how many detections there have been at once lately.
    """

    maps: Maps = field(default_factory=dict)
    classes: Classes = field(default_factory=dict)
    crowd: int = 0


@dataclass(frozen=True, slots=True, eq=False)
class Moment:
    """What the scans of one time show, one ``looks`` entry each, and what a source made of them.

    Looks have the clutter that persists in their streams, and the parameters of these.
    """

    scans: tuple[Scan, ...]
    looks: tuple[tuple[Look, SensorParams], ...]
    sight: Sight | None


def observe(
    context: Context[Any], scans: Sequence[Scan], memory: Memory, label: Array, where: Array
) -> Moment:
    """What the ``scans`` of one time show, in any order.

    A source follows the targets with ``label`` (k,), predicted at ``where`` (k, 2).

    Raises
    ------
    InputError : the noise of detections or the place of clutter is not known
    """
    sight = context.source.see(scans, label, where, memory.classes)
    region, motion = context.source.region, within(context.params)
    shown, found = [], []
    for scan, look in looks(scans, sight, context.setup, context.sensing, region, motion):
        own = context.sensing[scan.stream]
        clutter = look.clutter + persistent(memory.maps, scan.stream, look, own)
        shown.append(scan)
        found.append((replace(look, clutter=clutter), own))
    return Moment(tuple(shown), tuple(found), sight)


def remember(
    memory: Memory, moment: Moment, detections: int, label: Array, where: Array, alive: Array
) -> Memory:
    """The memory after a time with so many ``detections`` at once.

    Targets with ``label`` (k,) were found at ``where`` (k, 2); ``alive`` are all that live.
    """
    maps = memory.maps
    for scan, (look, own) in zip(moment.scans, moment.looks, strict=True):
        maps = learnt(maps, scan, look, own)
    classes = recognised(moment.sight, label, where, alive, memory.classes)
    return Memory(maps, classes, max(detections, memory.crowd // 2))


class Counted(Protocol):
    """A state that tells how many expected targets limits ``cut`` off at its time."""

    @property
    def cut(self) -> Cut:
        """By limit."""
        ...


S = TypeVar("S", bound=Counted)
F = TypeVar("F")


def through(
    context: Context[Any],
    scans: Iterable[Scan],
    state: S,
    step: Callable[[S, Sequence[Scan], Context[Any]], tuple[S, F]],
) -> Iterator[tuple[S, F]]:
    """What ``step`` gives for the scans of each time, with a word on what limits cut off."""
    told = Told()
    ordered = true_times(context.source.used(scans), context.sensing)
    for time_ns, group in groupby(ordered, key=lambda scan: scan.time_ns):
        together = list(group)
        state, found = step(state, together, context)
        told.warn(state.cut, time_ns, count(together))
        yield state, found
