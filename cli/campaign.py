"""Tasks, and how those of a command are done: what the options say that commands share."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from fcntl import LOCK_EX, LOCK_NB, flock
from pathlib import Path
from typing import Protocol

import click

from ..models.errors import OutputError, ParameterError, UnavailableError
from .outputs import DASH, Target


class Task(Protocol):
    """Something to do; pickled on its way to a worker."""

    @property
    def label(self) -> str:
        """What messages call it."""

    @property
    def target(self) -> Target | None:
        """What it writes, if that is its own."""


@dataclass(frozen=True, slots=True)
class Campaign:
    """Who does the tasks (``jobs`` processes, or the cluster at an address), and what is told."""

    jobs: int = 1
    cluster: str | None = None
    keep_going: bool = False
    summary: str | None = None

    def place(self, path: str) -> str:
        """``path`` as those who do the tasks know it: the workers of a cluster by its whole name.

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


def campaign(
    jobs: int, cluster: str | None, keep_going: bool, summary: str | None, lock: str | None
) -> Campaign:
    """The campaign that options ask for; the lock is held until the command is over.

    Raises
    ------
    UnavailableError : another command holds the lock
    OutputError : its file cannot be opened
    """
    if lock is not None:
        click.get_current_context().with_resource(_locked(lock))
    return Campaign(jobs, cluster, keep_going, summary)


@contextmanager
def _locked(path: str) -> Iterator[None]:
    try:
        descriptor = os.open(path, os.O_RDWR | os.O_CREAT, 0o666)
    except OSError as error:
        raise OutputError(f"--lock {path}: {error.strerror}") from error
    try:
        try:
            flock(descriptor, LOCK_EX | LOCK_NB)
        except BlockingIOError:
            raise UnavailableError(f"--lock {path}: another command holds it") from None
        except OSError as error:
            raise OutputError(f"--lock {path}: cannot be locked: {error.strerror}") from error
        yield
    finally:
        os.close(descriptor)
