"""Summary of a batch: one line at its end, and all of it as JSON."""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Any

from ...models.errors import OutputError
from .. import exits
from ..files.names import json_text
from ..files.outputs import Target
from .resume import SKIP, Decision
from .task import Task

_NAMED = 5
"""Inputs that the line names for each exit code."""


class Summary:
    """Counts what happens within its block, and writes that to the file ``path`` at the end.

    It is written however the block ends: by an error and by a signal too.
    """

    def __init__(self, total: int, path: str | None) -> None:
        self._total, self._path = total, path
        self._done = self._skipped = 0
        self.failures: list[dict[str, Any]] = []

    def __enter__(self) -> Summary:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, _: TracebackType | None
    ) -> None:
        if error is None:
            self._write(None)
        else:
            with suppress(OutputError):
                self._write(exits.message(error))

    def add(self, decision: Decision | None) -> None:
        """Count a task that went well."""
        if decision is not None and decision.action == SKIP:
            self._skipped += 1
        else:
            self._done += 1

    def add_failure(self, task: Task[Any], error: Exception) -> None:
        """Note a task that failed."""
        path = task.target.path if task.target else None
        self.failures.append(
            {
                "input": task.label,
                "output": None if path is None else str(path),
                "exit_code": exits.exit_code(error),
                "reason": exits.message(error),
            }
        )

    @property
    def codes(self) -> list[int]:
        """The exit code of every failure."""
        return [failure["exit_code"] for failure in self.failures]

    def line(self) -> str:
        """How many failed, and which for what kind of reason."""
        kinds = [
            f"{code} ({exits.MEANINGS.get(code, 'error')}): "
            + _listed(f["input"] for f in self.failures if f["exit_code"] == code)
            for code in sorted({*self.codes})
        ]
        return f"{len(self.failures)} of {self._total} failed: exit code " + "; ".join(kinds)

    def _write(self, stopped: str | None) -> None:
        if self._path is None:
            return
        left = self._total - self._done - self._skipped - len(self.failures)
        found = {
            "total": self._total,
            "done": self._done,
            "skipped": self._skipped,
            "failed": len(self.failures),
            "left": left,
            "stopped": stopped,
            "failures": sorted(self.failures, key=lambda failure: str(failure["input"])),
        }
        text = json_text(found, indent=2) + "\n"
        Target(Path(self._path), "json", overwrite=True).write_text(text)


def _listed(names: Iterable[str]) -> str:
    found = sorted(names)
    more = f" and {len(found) - _NAMED} more" if len(found) > _NAMED else ""
    return ", ".join(found[:_NAMED]) + more
