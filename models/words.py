"""Columns of text that stay the same over long runs of rows."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterable, Iterator, Sequence
from itertools import accumulate, repeat
from typing import Any


class Words(Sequence[str]):
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
        self._texts, self._ends = texts, list(accumulate(counts))

    def runs(self) -> Iterator[tuple[str, int]]:
        """Each text and how many rows in turn have it."""
        starts = [0, *self._ends]
        for text, start, end in zip(self._texts, starts, self._ends, strict=False):
            yield text, end - start

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
        if isinstance(other, Words):
            return (self._texts, self._ends) == (other._texts, other._ends)
        return isinstance(other, Sequence) and tuple(self) == tuple(other)

    def __hash__(self) -> int:
        return hash((tuple(self._texts), tuple(self._ends)))

    def __repr__(self) -> str:
        return f"Words({list(self.runs())!r})"


def words(texts: Iterable[str]) -> Words:
    """``texts`` as runs."""
    return texts if isinstance(texts, Words) else Words((text, 1) for text in texts)


def chain(columns: Iterable[Sequence[str]]) -> Words:
    """The texts of all ``columns`` in order."""
    return Words(run for column in columns for run in words(column).runs())
