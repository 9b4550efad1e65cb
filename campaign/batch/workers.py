"""Who does the tasks: this process, or processes of this machine.

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

from .. import exits, log

R = TypeVar("R")

_GRACE = 5.0
"""Seconds that a worker without parent has to clean up."""


class Workers(Protocol):
    """An executor that says how much it can take."""

    died: tuple[type[Exception], ...]
    """What a future raises whose worker died."""

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

    def __init__(self, number: int) -> None:
        self.width = number
        self._idle: SimpleQueue[ProcessPoolExecutor | None] = SimpleQueue()
        self._pools: set[ProcessPoolExecutor] = set()
        for _ in range(number):
            self._idle.put(None)

    def submit(self, call: Callable[..., R], /, *args: Any, **kwargs: Any) -> Future[R]:
        """Have ``call(*args)`` done; not to be called with ``width`` tasks in flight."""
        pool = self._idle.get()
        while True:
            pool = pool or self._new()
            try:
                with _held(exits.SIGNALS):
                    future = pool.submit(_in_worker, call, *args)
            except BrokenProcessPool:
                pool = None
                continue
            future.add_done_callback(partial(self._take_back, pool))
            return future

    def _take_back(self, pool: ProcessPoolExecutor, _: Future[Any]) -> None:
        self._idle.put(pool)

    def _new(self) -> ProcessPoolExecutor:
        context = multiprocessing.get_context("spawn")
        pool = ProcessPoolExecutor(1, context, _start_worker, log.settings())
        self._pools.add(pool)
        return pool

    def watch(self) -> None:
        """Nothing to look after: a future knows of the death of its worker."""

    def close(self) -> None:
        """Leave; what is in flight is given up."""
        idle = self._idle.qsize() == self.width
        with _held(exits.SIGNALS):
            for process in () if idle else multiprocessing.active_children():
                process.terminate()
            for pool in self._pools:
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


def _in_worker(call: Callable[..., R], *args: Any) -> R:
    """``call(*args)``, unless SIGTERM comes: then the worker ends, once its files are removed."""
    try:
        signal.pthread_sigmask(signal.SIG_UNBLOCK, [signal.SIGTERM])
        try:
            return call(*args)
        finally:
            signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGTERM])
    except exits.Terminated as error:
        os._exit(int(str(error.code)))
