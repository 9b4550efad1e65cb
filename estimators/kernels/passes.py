"""A pass forwards and one backwards over a recording: what smoothing of any filter shares.

A filter that can be smoothed yields, with the estimates of each time, a record of what its
``backward`` needs of that time. Backward goes from record to record, the last first, carries along
what the future says, and gives the objects of each time as all that came later sees them.
"""

from __future__ import annotations

import pickle
import re
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from contextvars import ContextVar
from dataclasses import dataclass, replace
from math import inf
from os import SEEK_END
from pathlib import Path
from tempfile import TemporaryFile
from typing import IO, Any, ClassVar, Self, cast

from ...models.parameters import parameter, require
from ...models.records import Estimates, Objects

SPILL = 256 << 20
"""Bytes of what has to be kept, from which on it goes to a temporary file."""
BLOCK = 256
"""Records that go there together."""
SEARCH = "search"
"""What ``smooth`` says where trajectories are sought beyond those of the filter."""
LAG = re.compile(r"(\d+(?:\.\d*)?|\.\d+)s")
"""A time to wait, as ``--smooth`` takes it."""

Forward = Iterator[tuple[Estimates, Any]]
"""Estimates of each time, and the record that its way back needs."""
Backward = Callable[[Any, Any], tuple[Any, Objects | Callable[[], Objects]]]
"""From what later times carry (None: there are none) and a record to what is carried on, and the
objects of the record's time, or who makes them where they take long and are not always wanted."""


def _unseen(items: Iterable[Any], total: int) -> Iterable[Any]:
    return items


@dataclass(frozen=True, slots=True)
class Around:
    """What a pass finds about it: the ``folder`` of its temporary file, None: the system's; and
    ``watch``, through which the steps of the way back go, with how many they are."""

    folder: Path | None = None
    watch: Callable[[Iterable[Any], int], Iterable[Any]] = _unseen


AROUND: ContextVar[Around] = ContextVar("around", default=Around())  # noqa: B039
"""Set by who runs an estimator; there is no other way to it, and an estimate is not changed."""


# Without slots: classes that have some cannot be composed.
@dataclass(frozen=True)
class SmoothParams:
    """How long estimates wait for what comes."""

    TITLE = "smoothing"
    WAYS: ClassVar[tuple[str, ...]] = ("none", "whole")

    smooth: str = parameter(
        "none",
        "1",
        "none: each estimate from what came until then; whole: from all of the recording; 5s: from "
        "what came up to 5 s later",
    )

    def __post_init__(self) -> None:
        ok = self.smooth in self.WAYS or LAG.fullmatch(self.smooth) is not None
        words = f"{', '.join(self.WAYS)} or a time such as 5s"
        require(ok, "smooth", words, self.smooth)

    @property
    def wait(self) -> float | None:
        """Seconds that an estimate waits, infinity for the whole recording; None: filtered."""
        if self.smooth == "none":
            return None
        return inf if self.smooth in ("whole", SEARCH) else float(self.smooth.removesuffix("s"))


class Stack:
    """Items, the last in the first out, in bounded memory: the older ones in a temporary file.

    That is there until the end of the ``with`` in which the stack stands.
    """

    def __init__(self) -> None:
        self.in_memory = 0
        self._top: list[bytes] = []
        self._blocks: list[int] = []
        self._file: IO[bytes] | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        if self._file is not None:
            self._file.close()

    @property
    def spilled(self) -> bool:
        """Whether some are in the file."""
        return bool(self._blocks)

    def push(self, item: Any) -> None:
        """Put one more on the stack."""
        self._top.append(pickle.dumps(item, protocol=5))
        self.in_memory += len(self._top[-1])
        if self.in_memory > SPILL and len(self._top) > BLOCK:
            self._spill()

    def __len__(self) -> int:
        return len(self._top) + BLOCK * len(self._blocks)

    def __iter__(self) -> Iterator[Any]:
        """The items, which are taken off."""
        while self._top or self._blocks:
            if not self._top:
                self._fetch()
            item = self._top.pop()
            self.in_memory -= len(item)
            yield pickle.loads(item)

    def _spill(self) -> None:
        """Move all but the last items to the file, block by block."""
        if self._file is None:
            folder = AROUND.get().folder
            self._file = cast(IO[bytes], TemporaryFile(dir=folder))  # noqa: SIM115
        while len(self._top) > BLOCK:
            self._blocks.append(self._file.seek(0, SEEK_END))
            pickle.dump(self._top[:BLOCK], self._file)
            self._top = self._top[BLOCK:]
        self.in_memory = sum(map(len, self._top))

    def _fetch(self) -> None:
        """Take the last block from the file."""
        assert self._file is not None
        start = self._blocks.pop()
        self._file.seek(start)
        self._top = pickle.load(self._file)
        self._file.truncate(start)
        self.in_memory = sum(map(len, self._top))


def smoothed(forward: Forward, backward: Backward, wait: float | None) -> Iterator[Estimates]:
    """The estimates as they are after ``wait`` seconds (None: as they come; infinity: at the end).

    What they state per step stays that of the filter.
    """
    if wait is None:
        yield from (estimates for estimates, _ in forward)
    elif wait == inf:
        yield from _whole(forward, backward)
    else:
        yield from _lagging(forward, backward, wait)


def _made(objects: Objects | Callable[[], Objects]) -> Objects:
    return objects if isinstance(objects, Objects) else objects()


def _whole(forward: Forward, backward: Backward) -> Iterator[Estimates]:
    carried, meta = None, None
    with Stack() as past, Stack() as found:
        for estimates, record in forward:
            meta = estimates.meta
            past.push((estimates.steps, record))
        for steps, record in AROUND.get().watch(past, len(past)):
            carried, objects = backward(carried, record)
            found.push((steps, _made(objects)))
        for steps, objects in found:
            assert meta is not None
            yield Estimates(meta, objects, steps)


def _lagging(forward: Forward, backward: Backward, wait: float) -> Iterator[Estimates]:
    window: deque[tuple[Estimates, Any, int]] = deque()

    def leave() -> Estimates:
        carried, objects = None, None
        for _, record, _ in reversed(window):
            carried, objects = backward(carried, record)
        assert objects is not None
        return replace(window.popleft()[0], objects=_made(objects))

    for estimates, record in forward:
        window.append((estimates, record, int(estimates.objects.time_ns[0])))
        while window and window[-1][2] - window[0][2] >= 1e9 * wait:
            yield leave()
    while window:
        yield leave()
