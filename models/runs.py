"""Columns of text that stay the same over long runs of rows."""

from __future__ import annotations

from array import array
from bisect import bisect_right
from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import accumulate, repeat
from typing import Any

import numpy as np


class Runs(Sequence[str]):
    """A sequence of texts, held as runs: it costs memory only where the text changes."""

    __slots__ = ("_ends", "_texts")

    def __init__(self, runs: Iterable[tuple[str, int]]) -> None:
        texts: list[str] = []
        counts: list[int] = []
        for text, count in runs:
            if texts and texts[-1] == text:
                counts[-1] += count
            elif count:
                texts.append(text)
                counts.append(count)
        self._texts, self._ends = texts, array("q", accumulate(counts))

    @staticmethod
    def of(texts: Iterable[str]) -> Runs:
        """``texts`` as runs."""
        return texts if isinstance(texts, Runs) else Runs((text, 1) for text in texts)

    @staticmethod
    def join(columns: Iterable[Sequence[str]]) -> Runs:
        """The texts of all ``columns`` in order."""
        return Runs(run for column in columns for run in Runs.of(column).runs())

    def runs(self) -> Iterator[tuple[str, int]]:
        """Each text and how many rows have it, one after the other."""
        starts = [0, *self._ends]
        for text, start, end in zip(self._texts, starts, self._ends, strict=False):
            yield text, end - start

    def where(self, test: Callable[[str], bool]) -> np.ndarray[Any, Any]:
        """Which rows hold a text of which ``test`` is true, as (n,) bool; asked once a run."""
        found = [(test(text), count) for text, count in self.runs()]
        return np.repeat(*np.array(found, np.int64).reshape(-1, 2).T).astype(bool)

    def map(self, change: Callable[[str], str]) -> Runs:
        """The changed texts; asked once a run."""
        return Runs((change(text), count) for text, count in self.runs())

    def take(self, rows: np.ndarray[Any, Any]) -> Runs:
        """The texts of the ``rows`` (k,)."""
        at = np.searchsorted(self._ends, rows, side="right")
        new = np.flatnonzero(np.diff(at, prepend=-1))
        counts = np.diff(new, append=len(at))
        pairs = zip(at[new].tolist(), counts.tolist(), strict=True)
        return Runs((self._texts[k], count) for k, count in pairs)

    def __len__(self) -> int:
        return self._ends[-1] if self._ends else 0

    def __getitem__(self, index: Any) -> Any:
        if isinstance(index, slice):
            return tuple(self)[index]
        at = range(len(self))[index]
        return self._texts[bisect_right(self._ends, at)]

    def __iter__(self) -> Iterator[str]:
        for text, count in self.runs():
            yield from repeat(text, count)

    def __eq__(self, other: object) -> bool:
        if isinstance(other, Runs):
            return (self._texts, self._ends) == (other._texts, other._ends)
        return isinstance(other, Sequence) and tuple(self) == tuple(other)

    def __hash__(self) -> int:
        return hash((tuple(self._texts), self._ends.tobytes()))

    def __repr__(self) -> str:
        return f"Runs({list(self.runs())!r})"
