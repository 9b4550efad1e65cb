"""Options of a batch: workers, handling of failures, summary."""

from __future__ import annotations

import os
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from pathlib import Path

from ...models.errors import ParameterError
from ..files.outputs import DASH, Target
from ..machine import default_memory


@dataclass(frozen=True, slots=True)
class Execution:
    """Workers (``jobs`` processes, or the cluster at an address), failures, and the summary.

    ``memory`` is the budget of all processes together [bytes].
    """

    jobs: int = 1
    cluster: str | None = None
    keep_going: bool = False
    summary: str | None = None
    lock: str | None = None
    memory: int = field(default_factory=default_memory)

    def place(self, path: str) -> str:
        """``path`` as the workers know it: those of a cluster by its absolute path.

        Raises
        ------
        ParameterError : stdin or stdout, which a cluster does not have
        """
        if self.cluster is None:
            return path
        if path == DASH:
            raise ParameterError("--cluster works on files: '-' has no place there")
        return os.path.abspath(path)

    def places(self, paths: Iterable[str]) -> tuple[str, ...]:
        """:meth:`place` of each."""
        return tuple(map(self.place, paths))

    def target(self, target: Target) -> Target:
        """``target`` at the :meth:`place` of its path."""
        path = self.place(DASH if target.path is None else str(target.path))
        return target if self.cluster is None else replace(target, path=Path(path))
