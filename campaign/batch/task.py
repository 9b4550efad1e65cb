"""Tasks, and the output of all their results."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any, Generic, Protocol, Self, TypeVar

from ..files.outputs import Target
from .execution import Execution

if TYPE_CHECKING:
    from .resume import Decision

R = TypeVar("R")
R_co = TypeVar("R_co", covariant=True)


class Task(Protocol[R_co]):
    """Something to do; pickled on its way to a worker."""

    @property
    def label(self) -> str:
        """Its name in messages."""

    @property
    def target(self) -> Target | None:
        """Its own output, if it has one."""

    @property
    def sources(self) -> Iterable[str | None]:
        """The files that its output is made from, as the user named them."""

    def placed(self, execution: Execution) -> Self:
        """The task with the paths of the workers, for a cluster absolute ones."""

    def decide(self) -> Decision | None:
        """Whether it has to be done; None where that is no question."""

    def run(self) -> R_co:
        """Do it."""


class Whole(Generic[R]):
    """A summary of all results, such as a table; by default there is none."""

    option = "-o"
    target: Target | None = None
    """Its own output, if it has one, and the option that names it."""

    @property
    def inputs(self) -> Iterable[str | None]:
        """Files that are read for it, beside those of the tasks."""
        return ()

    def sources(self, tasks: Sequence[Any]) -> Iterable[str | None]:
        """The files that its output is made from, where ``tasks`` went well."""
        return ()

    def finish(self, results: list[R]) -> int:
        """Write it; the exit code, 0 if all is well."""
        return 0
