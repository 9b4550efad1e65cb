"""Progress bars on stderr, on a terminal only, and word of what takes long."""

from __future__ import annotations

import logging
import sys
from collections.abc import Iterable, Iterator
from functools import cache
from importlib import import_module
from typing import Any, Protocol, TypeVar

from . import log

T = TypeVar("T")


def bar(items: Iterable[T], unit: str, total: int | None = None) -> Iterator[T]:
    """``items``, counted on stderr as they pass if that is a terminal."""
    if log.is_quiet() or not sys.stderr.isatty():
        return iter(items)
    from tqdm import tqdm

    return iter(tqdm(items, unit=unit, total=total, leave=False, file=sys.stderr))


class Progress(Protocol):
    """Something that is read in parts, which are counted in a ``unit``."""

    unit: str

    @property
    def progress(self) -> tuple[int, int]:
        """How much was read so far, and how much there is; 0 where nobody knows."""


def share(items: Iterable[T], *sources: Progress) -> Iterator[T]:
    """``items``, with the share of the ``sources`` that was read for them on stderr.

    One source is counted in its unit, several by their mean share.
    """
    if log.is_quiet() or not sys.stderr.isatty():
        yield from items
        return
    from tqdm import tqdm

    unit = sources[0].unit if len(sources) == 1 else "o/oo"
    with tqdm(unit=unit, unit_scale=True, miniters=1, leave=False, file=sys.stderr) as shown:
        for item in items:
            found = [source.progress for source in sources]
            if len(found) > 1:
                parts = [1000 * n // max(total, 1) for n, total in found]
                found = [(sum(parts) // len(parts), 1000)]
            shown.n, shown.total = found[0][0], found[0][1] or None
            shown.update(0)
            yield item


@cache
def announce_compilation() -> None:
    """Have numba's first compilation said on a terminal; without numba in use, nothing."""
    if "numba" not in sys.modules:
        return
    event: Any = import_module("numba.core.event")

    class Announcer(event.Listener):  # type: ignore[misc]
        """Speaks once."""

        said = False

        def on_start(self, event: object) -> None:
            if not self.said:
                level = logging.WARNING if sys.stderr.isatty() else logging.INFO
                log.logger.log(level, "compiling numerical kernels, kept for later runs")
            self.said = True

        def on_end(self, event: object) -> None:
            pass

    event.register("numba:compile", Announcer())
