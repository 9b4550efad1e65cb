"""What a task is."""

from __future__ import annotations

from typing import Protocol

from .outputs import Target


class Task(Protocol):
    """Something to do; pickled on its way to a worker."""

    @property
    def label(self) -> str:
        """What messages call it."""

    @property
    def target(self) -> Target | None:
        """What it writes, if that is its own."""
