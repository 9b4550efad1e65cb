"""How the command ends: signals, errors and exit codes.

=========  =========================================================================
0          done
1          internal error
2          usage or configuration
3          partial: with ``--keep-going``, some inputs failed for no graver reason
4          input unreadable, corrupt or lacking what is needed
5          output exists or cannot be written
6          a ``--fail-if`` gate
7          estimator failed
75         a lock is held, a cluster cannot be reached, or the machine has not enough memory,
           processes or descriptors: try again later
128 + n    ended by signal n: 129 hang-up, 130 Ctrl-C, 141 closed pipe, 143 SIGTERM
=========  =========================================================================

Where several apply: signal > 75 > 1 > 7 > 5 > 4 > 3.
"""

from __future__ import annotations

import math
import os
import signal
import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from threading import Timer
from time import monotonic
from types import FrameType

from ..models.errors import EchosetError, OutputError, UnavailableError

SIGNALS = (signal.SIGHUP, signal.SIGINT, signal.SIGTERM)
PARTIAL, GATE = 3, 6
_SOON = 0.05
_RANKING = (UnavailableError.exit_code, 1, 7, 5, 4, PARTIAL)
MEANINGS = {
    1: "internal error, or a worker that died",
    2: "configuration",
    4: "input unreadable, corrupt or lacking what is needed",
    5: "output exists or cannot be written",
    7: "estimator failed",
    75: "the machine has not enough",
}
"""Reasons of failed tasks by exit code."""


class Terminated(SystemExit):
    """A signal has asked the process to end; unwinds through every clean-up."""

    def __init__(self, signum: int) -> None:
        super().__init__(128 + signum)


class Ended(Exception):
    """The command is over with an exit code, and all has been said."""

    def __init__(self, exit_code: int) -> None:
        super().__init__(exit_code)
        self.exit_code = exit_code


def worst(codes: Iterable[int], partial: bool) -> int:
    """The exit code of several failures, ``partial`` if something succeeded beside them."""
    found = {*codes, *([PARTIAL] if partial else [])}
    return next((code for code in _RANKING if code in found), min(found, default=0))


def end(code: int) -> None:
    """Raise :class:`Ended` unless all went well."""
    if code:
        raise Ended(code)


def exit_code(error: BaseException) -> int:
    """The exit code that ``error`` stands for."""
    return error.exit_code if isinstance(error, EchosetError | Ended) else 1


def message(error: BaseException) -> str:
    """``error`` as a message for the user."""
    if isinstance(error, EchosetError):
        return str(error)
    if isinstance(error, Terminated):
        return f"ended by signal {int(str(error.code)) - 128}"
    return f"internal error: {type(error).__name__}: {error}"


_received: list[int] = []
"""Signals that have asked the process to end."""


def check_signals() -> None:
    """Raise :class:`Terminated` again if a signal came and what it raised was caught or changed."""
    if _received:
        raise Terminated(_received[0])


def handle_signals(patience: float = 1.0) -> None:
    """Let the signals of :data:`SIGNALS` unwind the process, unless they are ignored.

    Another one within ``patience`` seconds changes nothing: some senders signal both a process
    and its group. One that came where Python drops exceptions, as in a finalizer, comes again.
    """
    last = -math.inf

    def terminate(signum: int, frame: FrameType | None) -> None:
        nonlocal last
        before, last = last, monotonic()
        _received.append(signum)
        if last - before >= patience:
            raise Terminated(signum)

    report = sys.unraisablehook

    def send_again(dropped: sys.UnraisableHookArgs) -> None:
        nonlocal last
        if not isinstance(dropped.exc_value, Terminated):
            report(dropped)
            return
        last = -math.inf
        again = Timer(_SOON, os.kill, (os.getpid(), int(str(dropped.exc_value.code)) - 128))
        again.daemon = True
        again.start()

    sys.unraisablehook = send_again
    for signum in SIGNALS:
        if signal.getsignal(signum) is not signal.SIG_IGN:
            signal.signal(signum, terminate)


@contextmanager
def signals() -> Iterator[None]:
    """:func:`handle_signals` within the block."""
    before = {signum: signal.getsignal(signum) for signum in SIGNALS}
    report = sys.unraisablehook
    _received.clear()
    handle_signals()
    try:
        yield
    finally:
        sys.unraisablehook = report
        for signum, handler in before.items():
            signal.signal(signum, handler)


def drop_stdout() -> None:
    """Lose what waits to be written to a stdout that takes no more, and would fail at the end."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def stdout_error(error: Exception) -> OutputError | None:
    """``error`` as one of writing to stdout, which then takes no more; None if it was another."""
    if not isinstance(error, OSError) or error.filename is not None:
        return None
    try:
        sys.stdout.flush()
    except OSError:
        drop_stdout()
        return OutputError(f"stdout: cannot be written: {error.strerror or error}")
    return None


def open_standard_streams() -> None:
    """Open the null device as stdin, stdout and stderr where these are closed, as cron may do.

    Else the next file that is opened would take their place, and their output with it.
    """
    for descriptor, name in enumerate(("stdin", "stdout", "stderr")):
        try:
            os.fstat(descriptor)
        except OSError:
            os.set_inheritable(os.open(os.devnull, os.O_RDWR), True)
        if getattr(sys, name) is None:
            mode = "r" if name == "stdin" else "w"
            setattr(sys, name, open(descriptor, mode, closefd=False, encoding="utf-8"))  # noqa: SIM115
