"""Batches of tasks, run here, by processes or by a cluster: results in order, failures counted.

Every task draws from streams of its own and writes files of its own, so that worker,
order and retries change nothing.
"""

from __future__ import annotations

import pickle
from collections import Counter, deque
from collections.abc import Generator, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait
from contextlib import closing, contextmanager
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from traceback import format_exception
from typing import Any, Generic, TypeVar, cast

from ...formats.atomic import refuse_unwritable, sweep
from ...models.errors import EchosetError, FormatError
from ...models.names import printable
from .. import exits, log, machine, progress
from ..files.outputs import Existing, Target, refuse_collisions, say
from . import makefile
from .execution import Execution
from .resume import REDO, SKIP, Decision
from .summary import Summary
from .task import Task, Whole
from .workers import Here, Processes, Workers

_ATTEMPTS = 3
"""How often a task is tried whose worker dies."""
_PATIENCE = 5.0
"""Seconds without news after which the workers are looked after."""


R = TypeVar("R")


@dataclass(frozen=True, slots=True)
class Outcome(Generic[R]):
    """The outcome of a task: its result, unless it was only decided on, or failed."""

    decision: Decision | None = None
    result: R | None = None
    error: Exception | None = None
    seconds: float = 0.0


@dataclass(frozen=True, slots=True)
class Done(Generic[R]):
    """Results of tasks that were run, numbers of those whose outputs are there, an exit code."""

    results: list[R]
    finished: list[int]
    exit_code: int


def run(
    tasks: Sequence[Task[R]],
    execution: Execution,
    existing: Existing | None = None,
    deps: str | None = None,
    whole: Whole[R] | None = None,
) -> None:
    """Do ``tasks`` and what is made of all their results, and write the rules of ``deps``.

    What is there already is ``existing``; with its ``dry_run`` is only said what would be done.

    Raises
    ------
    Ended : not all went well, and what went wrong has been told
    """
    dry_run = existing is not None and existing.dry_run
    machine.limit_memory(execution.memory)
    whole = whole or Whole()
    _check_files(tasks, whole, execution, deps)
    own = whole.target.path if whole.target else None
    for path in (deps, execution.summary, own):
        if path is not None and not dry_run:
            refuse_unwritable(Path(path))
    done = perform([task.placed(execution) for task in tasks], execution, dry_run)
    code = whole.finish(done.results)
    if deps is not None and not dry_run:
        good = [tasks[k] for k in done.finished]
        if whole.target is None or any(task.target for task in tasks):
            rules = [(task.target, task.sources) for task in good]
        else:
            rules = [(whole.target, whole.sources(good))]
        makefile.write(deps, rules)
    exits.end(exits.worst(filter(None, (done.exit_code, code)), partial=False))


def _check_files(
    tasks: Sequence[Task[R]], whole: Whole[R], execution: Execution, deps: str | None
) -> None:
    """Refuse files that cannot be what they are asked to be, before the work begins."""
    targets: list[Target | None] = [task.target for task in tasks if task.target]
    sources = [source for task in tasks for source in task.sources]
    makefile.check(deps, targets or [whole.target], sources)
    options = [("--deps", deps), ("--summary", execution.summary), ("--lock", execution.lock)]
    outputs = [("-o", target.path) for target in targets if target is not None]
    own = (whole.option, whole.target.path if whole.target else None)
    refuse_collisions([*outputs, own, *options], [*sources, *whole.inputs])


def perform(tasks: Sequence[Task[R]], execution: Execution, dry_run: bool = False) -> Done[R]:
    """Run each of ``tasks`` that need not be skipped, results in order.

    The first failure is raised. With ``keep_going`` each is told in a line, the rest is done, and
    the exit code is the gravest. A ``dry_run`` only says on stdout what would be done.
    """
    many = len(tasks) > 1
    call: _Call[R] = _Call(dry_run)
    good: dict[int, Outcome[R]] = {}
    with (
        Summary(len(tasks), None if dry_run else execution.summary) as summary,
        _swept(() if dry_run else tasks),
        closing(_workers(execution, len(tasks))) as workers,
    ):
        found = _outcomes(call, tasks, workers)
        for number, outcome in progress.bar(found, "file", len(tasks)) if many else found:
            task, error = tasks[number], outcome.error
            if error is None:
                good[number] = outcome
                summary.add(outcome.decision)
                if not dry_run:
                    log.logger.info("%s", _told(task, outcome))
                continue
            summary.add_failure(task, error)
            if not (execution.keep_going and many):
                raise _with_name(task, error)
            log.error(_named(task, exits.message(error)), error)
    if summary.failures:
        log.logger.warning("%s", summary.line())
    finished = sorted(good)
    if dry_run:
        for number in finished:
            say(_planned(tasks[number], good[number].decision))
    ordered = [good[number] for number in finished]
    return Done(
        [cast(R, outcome.result) for outcome in ordered if _was_run(outcome.decision, dry_run)],
        finished,
        exits.worst(summary.codes, partial=bool(summary.codes and good)),
    )


def _workers(execution: Execution, tasks: int) -> Workers:
    """Workers for ``tasks`` tasks."""
    if execution.cluster is not None:
        from .cluster import Cluster

        return Cluster(execution.cluster)
    jobs = min(execution.jobs, tasks)
    return Processes(jobs, execution.memory // jobs) if jobs > 1 else Here()


@dataclass(frozen=True, slots=True)
class _Call(Generic[R]):
    """The work of a worker on a task: decide and run."""

    dry_run: bool

    def __call__(self, task: Task[R]) -> Outcome[R]:
        start = perf_counter()
        try:
            decision = task.decide()
            result = task.run() if _was_run(decision, self.dry_run) else None
            return Outcome(decision, result, seconds=perf_counter() - start)
        except BrokenPipeError:
            raise
        except Exception as error:
            return Outcome(error=_portable(machine.explained(error) or error))
        finally:
            exits.check_signals()


def _was_run(decision: Decision | None, dry_run: bool) -> bool:
    return not (dry_run or (decision is not None and decision.action == SKIP))


def _portable(error: Exception) -> Exception:
    """``error`` as another process can have it, its traceback in a note."""
    if not isinstance(error, EchosetError):
        error.add_note("".join(format_exception(error)))
    if not _pickles(error):
        # Some libraries, distributed among them, have causes pickled too.
        error.__cause__ = error.__context__ = None
    return error if _pickles(error) else RuntimeError(f"{type(error).__name__}: {error}")


def _pickles(error: Exception) -> bool:
    try:
        pickle.loads(pickle.dumps(error))
    except Exception:
        return False
    return True


def _outcomes(
    call: _Call[R], tasks: Sequence[Task[R]], workers: Workers
) -> Generator[tuple[int, Outcome[R]], None, None]:
    """Number and outcome of each task, as they come; no more in flight than the workers can use."""
    waiting = deque(range(len(tasks)))
    flying: dict[Future[Outcome[R]], int] = {}
    deaths: Counter[int] = Counter()
    while waiting or flying:
        while waiting and len(flying) < workers.width:
            number = waiting.popleft()
            flying[workers.submit(call, tasks[number])] = number
        over = wait(flying, _PATIENCE, FIRST_COMPLETED).done
        exits.check_signals()
        if not over:
            workers.watch()
        for future in over:
            number = flying.pop(future)
            task = tasks[number]
            try:
                outcome = future.result()
            except workers.died:
                deaths[number] += 1
                if deaths[number] < _ATTEMPTS:
                    log.logger.info("%s: its worker died: tried again", task.label)
                    waiting.appendleft(number)
                    continue
                reason = "out of memory, or a crash inside a library"
                error = f"its worker died {_ATTEMPTS} times: {reason}"
                outcome = Outcome(error=EchosetError(_named(task, error)))
            yield number, outcome


@contextmanager
def _swept(tasks: Sequence[Task[Any]]) -> Iterator[None]:
    """Remove what killed processes have left of outputs of ``tasks``, before and after."""
    paths = [task.target.path for task in tasks if task.target and task.target.path]
    sweep(paths)
    try:
        yield
    finally:
        sweep(paths)


def _told(task: Task[Any], outcome: Outcome[R]) -> str:
    if outcome.decision is not None and outcome.decision.action == SKIP:
        return f"{task.label}: skipped: {outcome.decision.reason}"
    if outcome.decision is not None and outcome.decision.action == REDO:
        return f"{task.label}: redone in {outcome.seconds:.3f} s: {outcome.decision.reason}"
    return f"{task.label}: done in {outcome.seconds:.3f} s"


def _planned(task: Task[Any], decision: Decision | None) -> str:
    assert decision is not None, "a dry run decides"
    where = task.target.path if task.target and task.target.path else "stdout"
    return printable(f"{decision.action} {where}: {decision.reason}")


def _with_name(task: Task[Any], error: Exception) -> Exception:
    """``error``, its message beginning with the task it is about."""
    if isinstance(error, EchosetError) and not isinstance(error, FormatError):
        return type(error)(_named(task, str(error)))
    return error


def _named(task: Task[Any], text: str) -> str:
    return text if task.label in text else f"{task.label}: {text}"
