"""Many tasks in this or in other processes: results in order, failures counted.

Every task draws from streams of its own and writes files of its own, so that the number of
processes changes nothing. Workers ignore Ctrl-C and leave at SIGTERM, which the parent sends when
it is itself asked to end; either way their temporary files are removed.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
import time
from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor
from contextlib import closing, contextmanager
from itertools import islice
from typing import Protocol, TypeVar, cast

from ..models.errors import EchosetError, FormatError
from . import exits, log, progress

_AHEAD = 2
"""Tasks that wait for a worker."""
_GRACE = 5.0
"""Seconds that a worker without parent has to clean up."""


class Task(Protocol):
    """Something to do; pickled on its way to a worker."""

    @property
    def label(self) -> str:
        """What messages call it."""


T = TypeVar("T", bound=Task)
R = TypeVar("R")
Outcome = tuple[R | None, Exception | None]
"""The result of a task, or its error."""


def run(
    work: Callable[[T], R], tasks: Sequence[T], jobs: int = 1, keep_going: bool = False
) -> tuple[list[R], int]:
    """``work(task)`` for each of ``tasks``, in order, from ``jobs`` processes; and an exit code.

    The first failure is raised. With ``keep_going`` each is told in a line, the rest is done, and
    the exit code is the gravest, for :func:`echoset.cli.exits.end`.
    """
    many = len(tasks) > 1
    outcomes = _pool(work, tasks, jobs) if many and jobs > 1 else _serial(work, tasks)
    shown = progress.bar(outcomes, "file", len(tasks)) if many else outcomes
    results: list[R] = []
    codes: list[int] = []
    with closing(outcomes):
        for task, (result, error) in zip(tasks, shown, strict=True):
            if error is None:
                results.append(cast(R, result))
            elif keep_going and many:
                log.error(_named(task, exits.message(error)), error)
                codes.append(exits.exit_code(error))
            else:
                raise _with_name(task, error)
    if codes:
        log.logger.warning("%d of %d failed", len(codes), len(tasks))
    return results, exits.worst(codes, partial=bool(codes and results))


def _with_name(task: Task, error: Exception) -> Exception:
    """``error``, its message beginning with the task it is about."""
    if isinstance(error, EchosetError) and not isinstance(error, FormatError):
        return type(error)(_named(task, str(error)))
    return error


def _named(task: Task, text: str) -> str:
    return text if task.label in text else f"{task.label}: {text}"


def _outcome(work: Callable[[T], R], task: T) -> Outcome[R]:
    try:
        return work(task), None
    except BrokenPipeError:
        raise
    except Exception as error:
        return None, error


def _serial(work: Callable[[T], R], tasks: Sequence[T]) -> Generator[Outcome[R], None, None]:
    for task in tasks:
        yield _outcome(work, task)


def _pool(
    work: Callable[[T], R], tasks: Sequence[T], jobs: int
) -> Generator[Outcome[R], None, None]:
    waiting = iter(tasks)
    flying: deque[Future[Outcome[R]]] = deque()
    context = multiprocessing.get_context("spawn")
    pool = ProcessPoolExecutor(min(jobs, len(tasks)), context, _start_worker, log.settings())
    try:
        while True:
            for task in islice(waiting, jobs + _AHEAD - len(flying)):
                with _held(exits.SIGNALS):
                    flying.append(pool.submit(_in_worker, work, task))
            if not flying:
                break
            yield flying[0].result()
            flying.popleft()
    finally:
        with _held(exits.SIGNALS):
            for process in multiprocessing.active_children() if flying else ():
                process.terminate()
            pool.shutdown(cancel_futures=True)


@contextmanager
def _held(signals: Iterable[signal.Signals]) -> Iterator[None]:
    """Hold ``signals`` back within the block; processes started there hold them back too."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, signals)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _start_worker(verbosity: int, form: str) -> None:
    """Leave Ctrl-C and hang-up to the parent, SIGTERM to the time of a task."""
    exits.handle_signals(patience=0.0)
    for signum in (signal.SIGINT, signal.SIGHUP):
        signal.signal(signum, signal.SIG_IGN)
    log.configure(verbosity, form)
    threading.Thread(target=_leave_with_parent, daemon=True).start()


def _leave_with_parent() -> None:
    parent = multiprocessing.parent_process()
    assert parent is not None
    parent.join()
    os.kill(os.getpid(), signal.SIGTERM)
    time.sleep(_GRACE)
    os._exit(1)


def _in_worker(work: Callable[[T], R], task: T) -> Outcome[R]:
    """``work(task)``, unless SIGTERM comes: then this and every later task is left."""
    try:
        signal.pthread_sigmask(signal.SIG_UNBLOCK, [signal.SIGTERM])
        try:
            return _outcome(work, task)
        finally:
            signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGTERM])
    except exits.Terminated as error:
        os.kill(os.getpid(), signal.SIGTERM)
        return None, InterruptedError(str(error))
