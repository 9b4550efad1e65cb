"""Progress bars on stderr, on a terminal only, and word of what takes long."""

from __future__ import annotations

import logging
import sys
from collections.abc import Iterable, Iterator
from functools import cache
from importlib import import_module
from typing import Any, TypeVar

from . import log

T = TypeVar("T")


def bar(items: Iterable[T], unit: str, total: int | None = None) -> Iterator[T]:
    """``items``, counted on stderr as they pass if that is a terminal."""
    if log.is_quiet() or not sys.stderr.isatty():
        return iter(items)
    from tqdm import tqdm

    return iter(tqdm(items, unit=unit, total=total, leave=False, file=sys.stderr))


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
