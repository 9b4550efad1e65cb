"""Commands as processes that are forked off the tests, which saves each the start of Python.

A real one, as the installed command, is tested where starting and ending are what is tested, or
where a shell stands before it.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import traceback
import warnings
from collections.abc import Callable, Mapping, Sequence
from multiprocessing import resource_tracker
from typing import Any

from echoset.cli.main import main


class Forked(subprocess.Popen[bytes]):
    """A process of ``echoset`` with the words ``args``; else like one that is started.

    The command is done by what runs in the child before a program would be executed; none is.
    """

    def __init__(
        self,
        args: Sequence[str | bytes],
        *,
        env: Mapping[str, str] | None = None,
        preexec_fn: Callable[[], object] | None = None,
        **how: Any,
    ) -> None:
        def child() -> None:
            code = 1
            try:
                os.closerange(3, 1024)  # the parent waits until its end of a pipe here is closed
                if env is not None and env is not os.environ:
                    os.environ.clear()
                    os.environ.update(env)
                _as_at_start()
                if preexec_fn is not None:
                    preexec_fn()
                code = main([os.fsdecode(word) for word in args])
                for stream in (sys.stdout, sys.stderr):
                    stream.flush()
            except BaseException:
                traceback.print_exc()
            finally:
                os._exit(code)

        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of threads that the tests may have
            super().__init__([sys.executable, *args], preexec_fn=child, **how)


def _as_at_start() -> None:
    """Streams, signals, warnings and helpers as those of a process that begins."""
    for descriptor, name in enumerate(("stdin", "stdout", "stderr")):
        mode = "w" if descriptor else "r"
        errors = "backslashreplace" if name == "stderr" else "strict"
        stream = open(descriptor, mode, closefd=False, encoding="utf-8", errors=errors)  # noqa: SIM115
        setattr(sys, name, stream)
        setattr(sys, f"__{name}__", stream)
    for number in (signal.SIGTERM, signal.SIGHUP, signal.SIGALRM):
        signal.signal(number, signal.SIG_DFL)
    for number in (signal.SIGPIPE, signal.SIGXFSZ):
        signal.signal(number, signal.SIG_IGN)
    signal.signal(signal.SIGINT, signal.default_int_handler)
    warnings.resetwarnings()
    warnings.simplefilter("ignore", DeprecationWarning)
    resource_tracker._resource_tracker._fd = None
    resource_tracker._resource_tracker._pid = None


def call(*words: object, **how: Any) -> subprocess.CompletedProcess[bytes]:
    """What a command ends with, its output and what it says."""
    data = how.pop("input", None)
    if data is not None:
        how["stdin"] = subprocess.PIPE
    args = [w if isinstance(w, bytes) else str(w) for w in words]
    with Forked(args, stdout=subprocess.PIPE, stderr=subprocess.PIPE, **how) as process:
        try:
            out, err = process.communicate(data, timeout=120)
        except BaseException:
            process.kill()
            raise
    return subprocess.CompletedProcess(args, process.returncode, out, err)
