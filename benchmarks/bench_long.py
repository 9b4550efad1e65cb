"""An hour of scans through a recursive filter and its scores: memory and rate of every step.

A radar at rest looks 100 times a second and detects 100 points a scan, most of them clutter: 36
million detections at full size. The recording is written window by window; `--scans` makes it
shorter. The memory of a step is the most that its process has resident, its rate that of scans.
"""

from __future__ import annotations

import argparse
import os
import resource
import sys
import time
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from echoset import formats
from echoset.formats.provenance import versions
from echoset.models.records import Array, Meta, Objects, Recording, Sensor, Stream, Truth

RATE, DETECTIONS, TARGETS = 100, 100, 3
REGION = 500.0
WINDOW = 1024
SETTINGS = ("max_components=20", "birth_rate=0.001", "birth_std_velocity=[3, 3]", "max_births=5")
METRICS = "ospa,gospa,cardinality,siap"


def write(path: Path, scans: int) -> None:
    """Write the recording, a window at a time."""
    rng = np.random.default_rng(1)
    sensor = Sensor.static("radar", np.zeros(2))
    model = {
        "p_detect": 0.95,
        "clutter_rate": float(DETECTIONS - TARGETS),
        "std_position": 1.0,
        "clutter_region": np.array([-REGION, REGION, -REGION, REGION]),
    }
    meta = Meta("long-s1-0000", provenance={"generator": "bench_long", "versions": versions()})
    writer = formats.writer(path, path.suffix[1:])
    try:
        for start in range(0, scans, WINDOW):
            k = np.arange(start, min(start + WINDOW, scans))
            time_ns = (k + 1) * (10**9 // RATE)
            where = _targets(time_ns * 1e-9)
            rows = np.arange(len(k) + 1)
            xy = rng.uniform(-REGION, REGION, (len(k), DETECTIONS, 2))
            seen = rng.random((len(k), TARGETS)) < 0.95
            noisy = where + rng.normal(size=where.shape)
            xy[:, :TARGETS][seen] = noisy[seen]
            x, y = np.ascontiguousarray(xy.reshape(-1, 2).T)
            stream = Stream(
                "position", ("radar",), model, time_ns, rows * DETECTIONS, {}, {"x": x, "y": y}
            )
            label = np.tile(np.arange(TARGETS), len(k))
            state = where.reshape(-1, 2)
            truth = Objects(time_ns, rows * TARGETS, label, ("x", "y"), ("m", "m"), state)
            writer.append(Recording(meta, {"radar": sensor}, {"radar": stream}, Truth(truth)))
        writer.close(meta)
    finally:
        writer.abort()


def _targets(t: Array) -> Array:
    """Positions (n, TARGETS, 2) [m] of targets that go round in circles."""
    radius = np.array([100.0, 200.0, 300.0])
    angle = t[:, None] * 5.0 / radius + np.arange(TARGETS)
    return np.stack((radius * np.cos(angle), radius * np.sin(angle)), -1)


def command(*words: object) -> tuple[float, float]:
    """Seconds and most resident memory [MiB] of an echoset command."""
    text = "import sys; from echoset.cli.main import main; sys.exit(main(sys.argv[1:]))"
    args = [sys.executable, "-c", text, *map(str, words)]
    start = time.perf_counter()
    pid = os.spawnv(os.P_NOWAIT, sys.executable, args)
    _, status, usage = os.wait4(pid, 0)
    if status:
        raise SystemExit(f"failed: {' '.join(args[3:])}")
    return time.perf_counter() - start, usage.ru_maxrss / 1024


def main() -> None:
    """Run all steps and print a line for each."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scans", type=int, default=36_000, help="360000 are an hour")
    parser.add_argument("--format", choices=("h5", "mcap"), help="only this format")
    parser.add_argument("--folder", type=Path, help="where the files are to stay")
    parser.add_argument("--metrics", default=METRICS)
    options = parser.parse_args()
    with TemporaryDirectory() as temporary:
        folder = options.folder or Path(temporary)
        folder.mkdir(parents=True, exist_ok=True)
        for form in [options.format] if options.format else ("h5", "mcap"):
            _steps(folder, form, options.scans, options.metrics)


def _steps(folder: Path, form: str, scans: int, metrics: str) -> None:
    recording, estimates = folder / f"long.{form}", folder / f"long.phd.{form}"
    start = time.perf_counter()
    write(recording, scans)
    own = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    _line(form, "write", scans, time.perf_counter() - start, own, recording)
    other = folder / f"converted.{'mcap' if form == 'h5' else 'h5'}"
    settings = [word for item in SETTINGS for word in ("--set", item)]
    table = folder / f"long.{form}.csv"
    steps = {
        "estimate": (("estimate", "-e", "phd", recording, *settings), estimates),
        "score": (("score", estimates, "--truth", recording, "-m", metrics), table),
        "convert": (("convert", recording), other),
        "validate": (("validate", recording), None),
    }
    for name, (words, output) in steps.items():
        to = () if output is None else ("-o", output)
        overwrite = () if output is None else ("--overwrite",)
        seconds, memory = command(*words, *to, *overwrite)
        _line(form, name, scans, seconds, memory, output)


def _line(
    form: str, step: str, scans: int, seconds: float, memory: float, path: Path | None
) -> None:
    size = f"{path.stat().st_size / 1e6:8.1f} MB" if path else ""
    print(
        f"{form:<5}{step:<9}{seconds:9.1f} s {scans / seconds:9.0f} scans/s "
        f"{memory:7.0f} MiB  {size}",
        flush=True,
    )


if __name__ == "__main__":
    main()
