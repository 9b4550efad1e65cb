"""What a task is, and what is made of all of them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any, Generic, Protocol, Self, TypeVar

from ..outputs import Target
from .execution import Execution

if TYPE_CHECKING:
    from .resume import Decision

R = TypeVar("R")
R_co = TypeVar("R_co", covariant=True)


class Task(Protocol[R_co]):
    """Something to do; pickled on its way to a worker."""

    @property
    def label(self) -> str:
        """What messages call it."""

    @property
    def target(self) -> Target | None:
        """What it writes, if that is its own."""

    @property
    def sources(self) -> Iterable[str | None]:
        """The files that its output is made from, as the user named them."""

    def placed(self, execution: Execution) -> Self:
        """The task with its files called as those who do it know them."""

    def decide(self) -> Decision | None:
        """Whether it has to be done; None where that is no question."""

    def run(self) -> R_co:
        """Do it."""


class Whole(Generic[R]):
    """What is made of the results of all tasks: by itself nothing."""

    target: Target | None = None
    """Its own output, if it has one."""

    def sources(self, tasks: Sequence[Any]) -> Iterable[str | None]:
        """The files that its output is made from, where ``tasks`` went well."""
        return ()

    def finish(self, results: list[R]) -> int:
        """Make it; the exit code, 0 if all is well."""
        return 0
