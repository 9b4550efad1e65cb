"""Workers: this process, or processes of this machine.

Both are executors of :mod:`concurrent.futures`, as is the cluster of :mod:`.cluster`. Workers
ignore Ctrl-C and leave at SIGTERM, which the parent sends when it is itself asked to end; either
way their temporary files are removed.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Executor, Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from functools import partial
from queue import SimpleQueue
from typing import Any, Protocol, TypeVar

from ...models.errors import UnavailableError
from .. import exits, log, machine

R = TypeVar("R")

_GRACE = 5.0
"""Seconds that a worker has to clean up once it is to end."""
_SAFE = "PYTHONSAFEPATH"


class Workers(Protocol):
    """An executor that says how much it can take."""

    died: tuple[type[Exception], ...]
    """Exceptions of futures whose worker died."""

    @property
    def width(self) -> int:
        """Number of tasks that it is worth having in flight now."""

    def submit(self, call: Callable[..., R], /, *args: Any) -> Future[R]:
        """Have ``call(*args)`` done."""

    def watch(self) -> None:
        """Look after the workers; called now and then while nothing else happens."""

    def close(self) -> None:
        """Leave; what is in flight is given up."""


class Here(Executor):
    """This process: a task is over when it has been submitted."""

    died: tuple[type[Exception], ...] = ()
    width = 1

    def submit(self, call: Callable[..., R], /, *args: Any, **kwargs: Any) -> Future[R]:
        future: Future[R] = Future()
        future.set_result(call(*args, **kwargs))
        return future

    def watch(self) -> None:
        """Nothing to look after."""

    def close(self) -> None:
        """Nothing to leave."""


class Processes(Executor):
    """Processes of this machine, each a pool of its own: one that dies takes its own task only."""

    died: tuple[type[Exception], ...] = (BrokenProcessPool,)

    def __init__(self, number: int, memory: int) -> None:
        self.width, self._memory = number, memory
        self._idle: SimpleQueue[ProcessPoolExecutor | None] = SimpleQueue()
        self._pools: set[ProcessPoolExecutor] = set()
        for _ in range(number):
            self._idle.put(None)

    def submit(self, call: Callable[..., R], /, *args: Any, **kwargs: Any) -> Future[R]:
        """Have ``call(*args)`` done; not to be called with ``width`` tasks in flight.

        Raises
        ------
        UnavailableError : the machine has no more processes or descriptors
        """
        pool = self._idle.get()
        while True:
            try:
                with _starting():
                    pool = pool or self._new()
                    future = pool.submit(_in_worker, call, *args)
            except BrokenProcessPool:
                pool = None
                continue
            except OSError as error:
                raise UnavailableError(f"cannot start a worker: {error.strerror}") from error
            future.add_done_callback(partial(self._take_back, pool))
            return future

    def _take_back(self, pool: ProcessPoolExecutor, _: Future[Any]) -> None:
        self._idle.put(pool)

    def _new(self) -> ProcessPoolExecutor:
        context = multiprocessing.get_context("spawn")
        pool = ProcessPoolExecutor(1, context, _start_worker, (*log.settings(), self._memory))
        self._pools.add(pool)
        return pool

    def watch(self) -> None:
        """Nothing to look after: a future knows of the death of its worker."""

    def close(self) -> None:
        """Leave; what is in flight is given up, and workers that do not end are killed."""
        idle = self._idle.qsize() == self.width
        with _held(exits.SIGNALS):
            workers = multiprocessing.active_children()
            for process in () if idle else workers:
                process.terminate()
            leaving = threading.Thread(target=self._shut_down)
            leaving.start()
            leaving.join(_GRACE)
            if leaving.is_alive():
                for process in workers:
                    process.kill()
            leaving.join()

    def _shut_down(self) -> None:
        for pool in self._pools:
            pool.shutdown(cancel_futures=True)


@contextmanager
def _starting() -> Iterator[None]:
    """Processes that are started within the block hold signals back, and import nothing from here.

    Python would look for every module in the current folder first, where any file may lie.
    """
    before = os.environ.get(_SAFE)
    os.environ[_SAFE] = "1"
    try:
        with _held(exits.SIGNALS):
            yield
    finally:
        del os.environ[_SAFE]
        if before is not None:
            os.environ[_SAFE] = before


@contextmanager
def _held(signals: Iterable[signal.Signals]) -> Iterator[None]:
    """Hold ``signals`` back within the block; processes started there hold them back too."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, signals)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _start_worker(verbosity: int, form: str, memory: int) -> None:
    """Leave Ctrl-C and hang-up to the parent, SIGTERM to the time of a task."""
    machine.limit_memory(memory)
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


def _in_worker(call: Callable[..., R], *args: Any) -> R:
    """``call(*args)``, unless SIGTERM comes: then the worker ends, once its files are removed."""
    try:
        signal.pthread_sigmask(signal.SIG_UNBLOCK, [signal.SIGTERM])
        try:
            return call(*args)
        finally:
            signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGTERM])
            exits.check_signals()
    except exits.Terminated as error:
        os._exit(int(str(error.code)))
