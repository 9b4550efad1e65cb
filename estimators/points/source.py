"""What the filters ask of a source that makes detections of scans which hold none, such as maps.

The source looks at all scans of a time and is told which targets are followed, so that it can
search where they are and say of what class they seem. Detections that scans hold need no source.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Protocol

from ...models.records import Array, Objects, Scan

MADE = ""
"""What the detections that a source makes are called among the streams."""
Classes = Mapping[int, Array]
"""What is known of the classes of the targets, by label, in a form that is the source's own."""


class Sight(Protocol):
    """What a source makes of one time: detections z (n, 2) in the map, covariances R (n, 2, 2)."""

    @property
    def z(self) -> Array:
        """Positions [m]."""
        ...

    @property
    def R(self) -> Array:
        """Their covariances [m^2]."""
        ...

    def recognise(self, label: Array, where: Array, classes: Classes) -> Classes:
        """``classes`` and those of the targets with ``label`` (k,) that were found at ``where``."""
        ...


class Source(Protocol):
    """A source of detections, for one recording."""

    @property
    def region(self) -> tuple[float, ...]:
        """Where its detections may lie: x_min, x_max, y_min, y_max [m]."""
        ...

    def used(self, scans: Iterable[Scan]) -> Iterator[Scan]:
        """The scans but for those that it leaves out.

        Raises
        ------
        InputError : at the end, if it lacked scans
        """
        ...

    def see(
        self, scans: Sequence[Scan], label: Array, where: Array, classes: Classes
    ) -> Sight | None:
        """What it makes of the ``scans`` of one time; None if nothing among them is for it.

        Followed are targets with ``label`` (k,), predicted at ``where`` (k, 2); ``classes`` is
        what is known of them.
        """
        ...

    def named(self, objects: Objects, classes: Classes) -> Objects:
        """The objects with their classes, if it tells any."""
        ...


class Nothing:
    """The source for recordings whose scans hold all detections."""

    region = ()

    def used(self, scans: Iterable[Scan]) -> Iterator[Scan]:
        """All scans."""
        return iter(scans)

    def see(
        self, scans: Sequence[Scan], label: Array, where: Array, classes: Classes
    ) -> Sight | None:
        """Nothing but the detections in the scans."""
        return None

    def named(self, objects: Objects, classes: Classes) -> Objects:
        """The objects as they are."""
        return objects


def recognised(
    sight: Sight | None, label: Array, where: Array, alive: Array, classes: Classes
) -> Classes:
    """The classes of the labels ``alive``, after targets with ``label`` were found at ``where``."""
    known = classes if sight is None else sight.recognise(label, where, classes)
    living = {*alive.tolist(), *label.tolist()}
    return {l: p for l, p in known.items() if l in living}
