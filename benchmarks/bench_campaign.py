"""What a campaign costs beside its estimator: ``python benchmarks/bench_campaign.py``.

Four tables. *Overhead*: many tiny recordings by one process; the processor time of a recording is
split into the estimator's own, reading, writing, and all else, which is the campaign itself:
deciding, scheduling, telling, counting; fsync waits and is told by the wall. *Dispatch*: tasks that
do nothing, done here, by processes and, with the extra ``echoset[cluster]``, by a Dask cluster on
loopback. *Speed-up*: two workers against two independent processes that share the same work, in
turns, since machines are shared. *Model*: what follows from these for many workers, extrapolated.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from calibration import fastest, kernel

from echoset.campaign import estimate as estimation
from echoset.campaign.batch import run as batch
from echoset.campaign.batch.execution import Execution
from echoset.campaign.files import outputs
from echoset.cli.main import main as echoset
from echoset.estimators import run as estimators

LIMIT_MS = 5.0
LIMIT_SHARE = 0.95
MODEL_RECORDINGS = 1_000_000
COMMAND = [sys.executable, "-c", "import sys; from echoset.cli.main import main; sys.exit(main())"]


class Clock:
    """Seconds spent in named parts, each without the parts that it calls, by ``now``."""

    def __init__(self, now: Callable[[], float]) -> None:
        self._now = now
        self.seconds: dict[str, float] = {}
        self._inner = [0.0]

    @contextmanager
    def part(self, name: str) -> Iterator[None]:
        """Count the block as ``name``."""
        start = self._now()
        self._inner.append(0.0)
        try:
            yield
        finally:
            whole = self._now() - start
            own = whole - self._inner.pop()
            self._inner[-1] += whole
            self.seconds[name] = self.seconds.get(name, 0.0) + own

    def timed(self, name: str, function: Callable[..., Any]) -> Callable[..., Any]:
        """``function``, counted as ``name``."""

        def call(*args: Any, **kwargs: Any) -> Any:
            with self.part(name):
                return function(*args, **kwargs)

        return call

    def iterated(self, name: str, items: Any) -> Iterator[Any]:
        """``items``, the making of each counted as ``name``."""
        items = iter(items)
        while True:
            with self.part(name):
                try:
                    item = next(items)
                except StopIteration:
                    return
            yield item


class Watched:
    """The estimator ``module``, its steps counted."""

    def __init__(self, module: Any, clock: Clock) -> None:
        self._module, self._clock = module, clock

    def __getattr__(self, name: str) -> Any:
        return getattr(self._module, name)

    def estimate(self, *args: Any) -> Iterator[Any]:
        """Steps as those of the module."""
        return self._clock.iterated("estimator", self._module.estimate(*args))


@contextmanager
def watched(clock: Clock, disk: Clock) -> Iterator[None]:
    """Have ``clock`` watch estimator, readers and writers within the block, ``disk`` fsync."""
    kept: list[tuple[Any, str, Any]] = []

    def put(owner: Any, name: str, value: Any) -> None:
        kept.append((owner, name, getattr(owner, name)))
        setattr(owner, name, value)

    load, opened, writer = estimators.load, estimation.open_source, estimation.writer

    def source(*args: Any, **kwargs: Any) -> Any:
        with clock.part("read"):
            found = opened(*args, **kwargs)
        scans = found.scans
        found.scans = lambda: clock.iterated("read", scans())
        found.close = clock.timed("read", found.close)
        return found

    def written(*args: Any) -> Any:
        with clock.part("write"):
            found = writer(*args)
        for name in ("append", "close", "abort"):
            setattr(found, name, clock.timed("write", getattr(found, name)))
        return found

    put(estimators, "load", lambda *names: Watched(load(*names), clock))
    put(estimation, "open_source", source)
    put(estimation, "writer", written)
    put(os, "fsync", disk.timed("fsync", os.fsync))
    try:
        yield
    finally:
        for owner, name, value in reversed(kept):
            setattr(owner, name, value)


def run(*args: object) -> None:
    """Run a command in this process."""
    code = echoset([str(a) for a in args])
    if code:
        raise SystemExit(f"echoset ended with exit code {code}")


def simulated(folder: Path, scenario: str, number: int, *settings: str) -> list[Path]:
    """``number`` recordings."""
    words = [word for setting in settings for word in ("--set", setting)]
    run("simulate", scenario, "--runs", number, *words, "-o", f"{folder}/", "-j", 2)
    return sorted(folder.iterdir())


def overhead(folder: Path, number: int) -> None:
    """Print where the time of tiny recordings goes."""
    recordings = simulated(folder / "tiny", "uwb-los", number, "steps=5")
    words = ("estimate", "-e", "ap-pda", "--set", "particles=100")
    run(*words, recordings[0], "-o", folder / "first.h5")
    clock, disk = Clock(time.process_time), Clock(time.perf_counter)
    start = time.process_time()
    with watched(clock, disk):
        run(*words, *recordings, "-o", f"{folder}/tiny-est/")
    whole = time.process_time() - start
    parts = {name: 1e3 * seconds / number for name, seconds in clock.seconds.items()}
    campaign = 1e3 * whole / number - sum(parts.values())
    print(f"\nOverhead: {number} recordings of 5 steps, ms of processor time a recording")
    for name, each in {**parts, "campaign": campaign}.items():
        print(f"  {name:<10} {each:8.2f}")
    print(f"  fsync      {1e3 * disk.seconds['fsync'] / number:8.2f} of wall time")
    print(f"  campaign within {LIMIT_MS:g} ms: {'yes' if campaign <= LIMIT_MS else 'no'}; ", end="")
    print(f"with reading and writing {campaign + parts['read'] + parts['write']:.2f} ms")
    start = time.process_time()
    run(*words, *recordings, "-o", f"{folder}/tiny-est/", "--skip-existing")
    print(f"  to skip one {1e3 * (time.process_time() - start) / number:7.2f}")


@dataclass(frozen=True, slots=True)
class Nothing:
    """A task that does nothing."""

    label: str
    target: outputs.Target | None = None
    sources: tuple[str, ...] = ()

    def placed(self, execution: Execution) -> Nothing:
        """Itself."""
        return self

    def decide(self) -> None:
        """It is always done."""

    def run(self) -> None:
        """Do nothing."""


@contextmanager
def cluster(folder: Path) -> Iterator[str | None]:
    """The scheduler file of two loopback workers; None without the extra."""
    try:
        import distributed  # noqa: F401
    except ImportError:
        yield None
        return
    file = folder / "scheduler.json"
    dask = [sys.executable, "-m", "dask"]
    options = ["--scheduler-file", str(file), "--no-dashboard"]
    kinds = [["scheduler", "--host", "127.0.0.1", "--port", "0"]]
    kinds += 2 * [["worker", "--nthreads", "1", "--no-nanny"]]
    quiet: dict[str, Any] = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    path = os.pathsep.join([str(Path(__file__).parent), os.environ.get("PYTHONPATH", "")])
    quiet["env"] = {**os.environ, "PYTHONPATH": path}
    started = [subprocess.Popen([*dask, *kind, *options], **quiet) for kind in kinds]
    try:
        while not file.exists():
            time.sleep(0.1)
        yield str(file)
    finally:
        for process in started:
            process.kill()
            process.wait()


def dispatch(folder: Path, number: int) -> float:
    """Print what it costs to have one task done by someone; seconds by the most distant."""
    tasks = [Nothing(str(k)) for k in range(number)]
    calls: list[tuple[str, Execution]] = [("here", Execution()), ("processes", Execution(jobs=2))]
    print(f"\nDispatch: {number} tasks that do nothing, ms each, and s until the first is done")
    with cluster(folder) as file:
        if file is not None:
            calls.append(("cluster", Execution(cluster=file)))
        for name, campaign in calls:
            start = time.perf_counter()
            with closing(batch._workers(campaign, number)) as workers:
                found = batch._outcomes(batch._Call(False), tasks, workers)
                done = [time.perf_counter() for _ in found]
            each = (done[-1] - done[0]) / (number - 1)
            print(f"  {name:<10} {1e3 * each:8.3f} {done[0] - start:8.2f}")
        if file is None:
            print("  cluster: the extra echoset[cluster] is not installed")
    return each


def speed_up(folder: Path, number: int, rounds: int, particles: int) -> tuple[float, int]:
    """Print the time of two workers beside that of two independent processes.

    Returns seconds and bytes (recording and estimates) of one recording by one process.
    """
    recordings = simulated(folder / "olos", "uwb-olos", number)
    words = [*COMMAND, "estimate", "-e", "eopda-geo", "--overwrite"]
    words += ["--set", f"particles={particles}", "-o", f"{folder}/olos-est/"]

    def seconds(*commands: list[str]) -> float:
        start = time.perf_counter()
        processes = [subprocess.Popen(command) for command in commands]
        codes = [process.wait() for process in processes]
        if any(codes):
            raise SystemExit("an estimate failed")
        return time.perf_counter() - start

    names = [str(path) for path in recordings]
    print(f"\nSpeed-up: {number} recordings of uwb-olos, s; the share is of the speed-up of two")
    print("  independent processes on the same work")
    times: list[tuple[float, float]] = []
    for turn in range(rounds):
        ways = [([*words, *names[::2]], [*words, *names[1::2]]), ([*words, *names, "-j", "2"],)]
        found = {k: seconds(*ways[k]) for k in ((0, 1), (1, 0))[turn % 2]}
        independent, workers = found[0], found[1]
        times.append((independent, workers))
        print(f"  two processes {independent:7.1f}   -j 2 {workers:7.1f}", flush=True)
    one = seconds([*words, *names])
    independent, workers = (sum(column) for column in zip(*times, strict=True))
    share = independent / workers
    print(f"  one process {one:7.1f}: speed-up {rounds * one / workers:.2f}, share {share:.3f}")
    print(f"  within {LIMIT_SHARE}: {'yes' if share >= LIMIT_SHARE else 'no'}")
    files = [*recordings, *(folder / "olos-est").iterdir()]
    return one / number, sum(path.stat().st_size for path in files) // number


def bandwidth(folder: Path) -> float:
    """Bytes a second that this disk takes and makes durable, file by file."""
    data = [path.read_bytes() for path in sorted((folder / "olos").iterdir())]
    start = time.perf_counter()
    for number, content in enumerate(data):
        with (folder / f"copy-{number}").open("wb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
    return sum(map(len, data)) / (time.perf_counter() - start)


def model(task: float, cost: float, size: int, rate: float) -> None:
    """Print what many workers would reach: see docs/campaigns.md for the formula."""
    print(f"\nModel, an extrapolation: {MODEL_RECORDINGS} recordings of {task:.3f} s each, with")
    print(
        f"  {1e3 * cost:.2f} ms of the scheduler and {size / 1e6:.2f} MB of files, which one disk"
    )
    print(f"  moves at {rate / 1e6:.0f} MB/s")
    print("  workers   cluster: time [s], speed-up, bound by   job array: time [s], speed-up, by")
    for workers in (1, 2, 10, 100, 1000, 10_000):
        bounds = {"work": task / workers, "disk": size / rate}
        line = f"  {workers:>7}"
        for more in ({"scheduler": cost}, {}):
            by, each = max({**bounds, **more}.items(), key=lambda bound: bound[1])
            seconds = MODEL_RECORDINGS * each + task
            line += f" {seconds:18.0f} {MODEL_RECORDINGS * task / seconds:9.1f} {by:<9}"
        print(line)


def main() -> None:
    """Print the tables that are asked for, by default all."""
    parser = argparse.ArgumentParser()
    parser.add_argument("tables", nargs="*", default=["overhead", "model"])
    parser.add_argument("--tiny", type=int, default=1000, help="number of tiny recordings")
    parser.add_argument("--large", type=int, default=200, help="number of uwb-olos recordings")
    parser.add_argument("--particles", type=int, default=1000, help="of the filter on these")
    parser.add_argument("--rounds", type=int, default=2, help="turns of the speed-up")
    text = "bytes a second that the shared disk of the model moves; by default as this one"
    parser.add_argument("--bandwidth", type=float, help=text)
    args = parser.parse_args()
    print(f"calibration kernel {1e3 * fastest(kernel):.0f} ms")
    with TemporaryDirectory(ignore_cleanup_errors=True) as name, suppress(BrokenPipeError):
        folder = Path(name)
        if "overhead" in args.tables:
            overhead(folder, args.tiny)
        cost = dispatch(folder, args.tiny) if {"dispatch", "model"} & {*args.tables} else 0.0
        if {"speed-up", "model"} & {*args.tables}:
            task = speed_up(folder, args.large, args.rounds, args.particles)
            if "model" in args.tables:
                model(task[0], cost, task[1], args.bandwidth or bandwidth(folder))


if __name__ == "__main__":
    main()
