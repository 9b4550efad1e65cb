"""Feeds changed inputs to the readers and counts what becomes of them.

Every input is read by a process of its own kind: a worker that is watched from outside, so that a
crash inside a library, a hang or memory beyond the limit ends the worker and not the run. Input
``i`` depends on (seed, reader, i) only: ``--first i --count 1 --save FILE`` makes it again.
"""

from __future__ import annotations

import argparse
import json
import logging
import os
import resource
import select
import signal
import sys
import time
import traceback
import zlib
from collections import Counter
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from fuzz_changes import change
from fuzz_targets import TARGETS, Target

LONGEST = 10.0
"""Seconds that an input may take."""
MEMORY = 1 << 30
"""Bytes that a worker may have resident, and take beyond what it starts with."""
BATCH = 4000
"""Inputs that one worker reads."""
SOUND = ("refused", "accepted")
Tell = Callable[[str, str], None]
"""Takes how an input ended, and details."""
Loop = Callable[[range, Path, Tell], None]


@dataclass
class Tally:
    """How many inputs ended how, all bad ends, and the most memory [bytes]."""

    count: Counter[str] = field(default_factory=Counter)
    all: dict[str, list[str]] = field(default_factory=dict)
    peak: int = 0

    def add(self, outcome: str, index: int, detail: str = "") -> None:
        self.count[outcome] += 1
        if outcome not in SOUND:
            self.all.setdefault(outcome, []).append(f"input {index}: {detail}")

    def bad(self) -> dict[str, str]:
        """What must not happen, and did."""
        return {outcome: details[0] for outcome, details in self.all.items()}

    def __str__(self) -> str:
        ends = ", ".join(f"{n} {name}" for name, n in sorted(self.count.items()))
        return f"{sum(self.count.values())} inputs: {ends}; peak {self.peak >> 20} MiB"


def make(name: str, seed: int, index: int) -> tuple[int, str, dict[str, bytes]]:
    """The input ``index`` of a reader: which of the corpus, the changed file, all files."""
    target = TARGETS[name]
    rng = np.random.default_rng([seed, zlib.crc32(name.encode()), index])
    corpus = target.corpus()
    which = int(rng.integers(len(corpus)))
    files = dict(corpus[which])
    first = next(iter(files))
    files[first] = change(files[first], target.kind, rng)
    return which, first, files


def run(name: str, count: int, seed: int = 1, first: int = 0) -> Tally:
    """Feed ``count`` inputs to the reader ``name``."""
    expected = _expected(TARGETS[name])

    def loop(indices: range, folder: Path, tell: Tell) -> None:
        _limit()
        _loop(name, expected, seed, indices, folder, tell)

    return watched(loop, first, first + count, 2 * LONGEST)


def watched(loop: Loop, first: int, stop: int, longest: float = 120.0) -> Tally:
    """Have processes go through the inputs, each of which may take ``longest`` seconds."""
    tally, index = Tally(), first
    while index < stop:
        index = _worker(loop, index, min(index + BATCH, stop), tally, longest)
    return tally


def _expected(target: Target) -> list[object]:
    """The content of the corpus, after a look that its inputs are sound."""
    found = []
    with TemporaryDirectory() as folder:
        for files in target.corpus():
            record = target.read(_put(Path(folder), files))
            found.append(target.content(record) if target.content else None)
    return found


def _put(folder: Path, files: dict[str, bytes]) -> list[Path]:
    paths = []
    for name, data in files.items():
        paths.append(folder / name)
        paths[-1].write_bytes(data)
    return paths


def _worker(loop: Loop, start: int, stop: int, tally: Tally, longest: float) -> int:
    """Have inputs read by a process, until it is done or has to end; the next index."""
    read, write = os.pipe()
    with TemporaryDirectory(dir="/dev/shm" if Path("/dev/shm").is_dir() else None) as folder:
        pid = os.fork()
        if pid == 0:
            os.close(read)
            code = 1
            try:
                inherited = _resident()

                def tell(outcome: str, detail: str) -> None:
                    line = json.dumps([outcome, detail[:400], _resident() - inherited])
                    os.write(write, (line + "\n").encode())

                loop(range(start, stop), Path(folder), tell)
                code = 0
            except BaseException:
                traceback.print_exc()
            finally:
                os._exit(code)
        os.close(write)
        index, hung = start, False
        with os.fdopen(read, "rb") as pipe:
            while index < stop:
                if not select.select([pipe], [], [], longest)[0]:
                    hung = True
                    os.kill(pid, signal.SIGKILL)
                    break
                line = pipe.readline()
                if not line:
                    break
                outcome, detail, peak = json.loads(line)
                tally.peak = max(tally.peak, peak)
                tally.add(outcome, index, detail)
                index += 1
        status = os.waitpid(pid, 0)[1]
    if index < stop:
        end = f"signal {os.WTERMSIG(status)}" if os.WIFSIGNALED(status) else f"exit {status >> 8}"
        tally.add("hung" if hung else "crashed", index, end)
        index += 1
    return index


def _limit() -> None:
    """Room for as much as is in use and :data:`MEMORY` more; and no word of what is read."""
    logging.disable()
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    resource.setrlimit(resource.RLIMIT_AS, (pages * resource.getpagesize() + MEMORY,) * 2)
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


def _resident() -> int:
    """The most memory that was in use [bytes]; at first what the worker has from its parent."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss << 10


def _loop(
    name: str, expected: list[object], seed: int, indices: range, folder: Path, tell: Tell
) -> None:
    target, inherited = TARGETS[name], _resident()
    for index in indices:
        which, changed, files = make(name, seed, index)
        paths = _put(folder, files)
        start = time.monotonic()
        outcome, detail = _outcome(target, changed, files, paths, expected[which])
        peak = _resident() - inherited
        if peak > MEMORY:
            outcome, detail = "memory", f"{peak >> 20} MiB"
        elif time.monotonic() - start > LONGEST:
            outcome, detail = "hung", f"{time.monotonic() - start:.1f} s"
        tell(outcome, detail)


def _outcome(
    target: Target, changed: str, files: dict[str, bytes], paths: list[Path], expected: object
) -> tuple[str, str]:
    try:
        record = target.read(paths)
    except Exception as error:
        return _refusal(target, paths, error)
    if target.content and target.content(record) != expected:
        return "silent", "another content was accepted"
    if target.broken and target.broken(changed, files):
        return "silent", "what is broken was accepted"
    return "accepted", ""


def _refusal(target: Target, paths: list[Path], error: Exception) -> tuple[str, str]:
    text, kind = str(error), type(error).__name__
    cause: BaseException | None = error
    while cause is not None:
        if isinstance(cause, MemoryError):
            return "memory", text
        cause = cause.__cause__ or cause.__context__
    if not isinstance(error, target.refusal):
        return "wrong-error", f"{kind}: {text}"
    if "\n" in text or len(text) > 600 or not any(str(path) in text for path in paths):
        return "unclear", f"{kind}: {text}"
    where, reason = getattr(error, "where", "-"), getattr(error, "reason", text)
    if not where or not reason:
        return "no-place", text
    return "refused", ""


def main() -> int:
    """Run from the command line: a line for each reader, 1 if anything was bad."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("readers", nargs="*", metavar="READER", help=", ".join(TARGETS))
    parser.add_argument("--count", type=int, default=10_000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("-j", "--jobs", type=int, default=2)
    parser.add_argument("--save", type=Path, metavar="FOLDER", help="write input --first there")
    options = parser.parse_args()
    names = options.readers or list(TARGETS)
    if options.save:
        _put(options.save, make(names[0], options.seed, options.first)[2])
        return 0
    for name in names:
        TARGETS[name].corpus()
    failed = False

    def one(name: str) -> tuple[str, Tally, float]:
        start = time.monotonic()
        tally = run(name, options.count, options.seed, options.first)
        return name, tally, time.monotonic() - start

    with ThreadPoolExecutor(options.jobs) as pool:
        for name, tally, seconds in pool.map(one, names):
            print(f"{name:<14} {tally}; {seconds:.0f} s", flush=True)
            for end, detail in tally.bad().items():
                print(f"    {end}: {detail}", flush=True)
                failed = True
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
