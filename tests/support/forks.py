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
from multiprocessing import resource_tracker
from typing import Any

from echoset.cli.main import main


class Forked(subprocess.Popen[bytes]):
    """A process of ``echoset`` with the words ``args``; else like one that is started."""

    def _execute_child(self, args: Any, _: Any, preexec_fn: Any, *rest: Any) -> None:
        (cwd, env), pipes, session = rest[2:4], rest[7:13], rest[18]
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of threads that the tests may have
            pid = os.fork()
        if pid:
            self.pid, self._child_created = pid, True
            self._close_pipe_fds(*pipes)
            return
        code = 1
        try:
            for target, source in enumerate((pipes[0], pipes[3], pipes[5])):
                if source >= 0:
                    os.dup2(source, target)
            os.closerange(3, 1024)
            if session:
                os.setsid()
            if cwd is not None:
                os.chdir(cwd)
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
