"""An existing Dask cluster as the workers: the extra ``echoset[cluster]``.

Workers run the same tasks on the same files, so they need the same file system, and the same
versions of echoset and of what its numbers come from. The scheduler reads tasks, too.
"""

from __future__ import annotations

import asyncio
import json
import logging
import os
import sys
from collections.abc import Callable
from concurrent.futures import CancelledError, Future
from contextlib import suppress
from importlib import import_module
from importlib.metadata import version
from pathlib import Path
from time import monotonic
from typing import Any, TypeVar
from urllib.parse import urlsplit

from ...formats.provenance import versions
from ...models.errors import ParameterError, UnavailableError
from .. import log

R = TypeVar("R")

_LOOK = 5.0
"""Seconds after which the number of workers is asked for again."""
_PER_THREAD = 2
"""Tasks in flight for each thread of the cluster: one runs, one waits."""
_LOST = (OSError, TimeoutError, CancelledError, asyncio.CancelledError)


class Cluster:
    """The workers of a Dask scheduler, given by its address or scheduler file.

    Raises
    ------
    ParameterError : the extra is not installed
    UnavailableError : the scheduler does not answer
    """

    def __init__(self, address: str) -> None:
        try:
            distributed: Any = import_module("distributed")
        except ImportError:
            raise ParameterError(
                "--cluster needs the extra: pip install 'echoset[cluster]'"
            ) from None
        for name in [*logging.root.manager.loggerDict, "distributed", "asyncio"]:
            if name.partition(".")[0] in ("distributed", "tornado", "asyncio"):
                logging.getLogger(name).setLevel(logging.CRITICAL + 1)
        self.died: tuple[type[Exception], ...] = (distributed.KilledWorker,)
        self._address = address
        where = address if "://" in address else _address(address)
        known = import_module("distributed.comm.registry").backends
        if where.partition("://")[0] not in known:
            kinds = " ".join(f"{scheme}://" for scheme in sorted(known))
            raise ParameterError(f"--cluster {address}: {where} begins with none of {kinds}")
        if not _has_host_and_port(where):
            raise ParameterError(f"--cluster {address}: {where} is no address like tcp://HOST:PORT")
        try:
            self._client: Any = distributed.Client(where, set_as_default=False)
        except (OSError, ValueError) as error:
            reason = " ".join(str(error).split())
            raise UnavailableError(f"--cluster {address}: no scheduler answers: {reason}") from None
        self._executor = self._client.get_executor(pure=False)
        self._versions = _versions()
        self._width, self._looked, self._warned = 1, -_LOOK, False

    @property
    def width(self) -> int:
        """Number of tasks that keep every thread of the cluster busy."""
        if monotonic() - self._looked > _LOOK:
            self._look()
        return self._width

    def _look(self) -> None:
        try:
            threads = sum(self._client.nthreads().values())
        except _LOST:
            raise self._lost() from None
        if not threads and not self._warned:
            log.logger.warning("--cluster %s: has no workers: waiting for some", self._address)
        self._warned = not threads
        self._width, self._looked = max(1, _PER_THREAD * threads), monotonic()

    def submit(self, call: Callable[..., R], /, *args: Any) -> Future[R]:
        """Have ``call(*args)`` done.

        Raises
        ------
        UnavailableError : here or from the future: the scheduler is lost, or a worker unfit
        """
        inner = self._executor.submit(_on_worker, self._versions, call, *args)
        outer: Future[R] = Future()
        inner.add_done_callback(lambda inner: self._pass_on(inner, outer))
        return outer

    def _pass_on(self, inner: Future[R], outer: Future[R]) -> None:
        try:
            outer.set_result(inner.result())
        except _LOST:
            outer.set_exception(self._lost())
        except Exception as error:
            if not isinstance(error, (*self.died, UnavailableError)):
                cause = error.__cause__ or error
                error = UnavailableError(
                    f"--cluster {self._address}: cannot do the work: {type(cause).__name__}: "
                    f"{cause}: its scheduler and workers need echoset and the plugins in use"
                )
            outer.set_exception(error)

    def watch(self) -> None:
        """Speak of a cluster without workers; see whether the scheduler is still there."""
        self._look()

    def _lost(self) -> UnavailableError:
        return UnavailableError(
            f"--cluster {self._address}: the scheduler is lost; what is done is done, "
            "--skip-existing goes on from there"
        )

    def close(self) -> None:
        """Leave; what runs on workers runs to its end, what waits for one is given up."""
        with suppress(Exception):
            if self._client.status == "running":
                self._executor.shutdown(wait=False)
            self._client.close(timeout=1.0)


def _address(file: str) -> str:
    """The address in a scheduler file."""
    try:
        return str(json.loads(Path(file).read_text())["address"])
    except OSError as error:
        raise UnavailableError(f"--cluster {file}: {error.strerror}") from None
    except (ValueError, LookupError, TypeError):
        raise ParameterError(f"--cluster {file}: is no scheduler file") from None


def _has_host_and_port(address: str) -> bool:
    try:
        found = urlsplit(address)
        return bool(found.hostname and found.port)
    except ValueError:
        return False


def _on_worker(expected: dict[str, str], call: Callable[..., R], *args: Any) -> R:
    """``call(*args)``, unless the numbers of this worker would come from other versions."""
    _leave_current_folder()
    found = _versions()
    if found != expected:
        differ = [
            f"{name} {here} instead of {expected[name]}"
            for name, here in found.items()
            if here != expected[name]
        ]
        raise UnavailableError(f"a worker of the cluster has {', '.join(differ)}")
    return call(*args)


def _versions() -> dict[str, str]:
    """Versions of what the numbers come from, the compiler of kernels included."""
    return {**versions(), "numba": version("numba")}


def _leave_current_folder() -> None:
    """Have nothing imported from the folder that the worker was started in, if not asked for."""
    here = os.getcwd()
    asked = {os.path.abspath(p) for p in os.environ.get("PYTHONPATH", "").split(os.pathsep) if p}
    if here not in asked:
        sys.path[:] = [p for p in sys.path if p not in ("", here)]
