"""PHD filter over targets and clutter: ``python benchmarks/bench_phd.py``.

A linear-Gaussian scene with a fixed number of targets, p_D 0.95, 100 scans; the recording is made
and everything compiled beforehand. Prints the milliseconds per scan of the fastest of five runs
and their ratio to the calibration kernel.
"""

from __future__ import annotations

import os
from functools import partial

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np
from calibration import fastest, kernel

from echoset.estimators.points import phd
from echoset.models.random import generator
from echoset.models.records import Meta, Recording, Sensor, Stream

SIDE, SCANS = 2000.0, 100


def recording(targets: int, clutter: float, rng: np.random.Generator) -> Recording:
    """Positions of targets that move at constant velocity in a square, among clutter."""
    start = rng.uniform(200, SIDE - 200, (targets, 2))
    velocity = rng.normal(0, 2.0, (targets, 2))
    scans = []
    for k in range(SCANS):
        z = (start + k * velocity + rng.normal(0, 10.0, (targets, 2)))[rng.random(targets) < 0.95]
        scans.append(np.vstack((z, rng.uniform(0, SIDE, (rng.poisson(clutter), 2)))))
    x, y = np.vstack(scans).T.copy()
    offset = np.cumsum([0, *map(len, scans)])
    time_ns = np.arange(SCANS, dtype=np.int64) * 10**9
    stream = Stream("position", ("radar",), {}, time_ns, offset, {}, {"x": x, "y": y})
    return Recording(Meta("bench"), {"radar": Sensor.static("radar", (0, 0))}, {"radar": stream})


def params(clutter: float) -> phd.Params:
    """The filter that matches the scene, with births at detections."""
    return phd.Params(
        p_detect=0.95,
        clutter_rate=clutter,
        clutter_region=(0.0, SIDE, 0.0, SIDE),
        std_position=10.0,
        std_acceleration=0.5,
        birth_rate=0.1,
        birth_std_velocity=(3.0, 3.0),
    )


def run(scene: Recording, clutter: float) -> list[int]:
    """The numbers of targets found in each scan."""
    rng = generator(1, "bench", "estimate")
    steps = phd.estimate(scene.setup(), scene.scans(), params(clutter), rng)
    return [len(step.objects.label) for step in steps]


def main() -> None:
    """Print the cost curve."""
    rng = generator(1, "bench", "phd")
    unit = fastest(kernel)
    print(f"calibration kernel {1e3 * unit:.1f} ms")
    print("targets clutter  ms/scan  ratio   found")
    for targets, clutter in ((5, 10), (10, 20), (20, 20), (40, 20), (10, 60), (40, 60), (40, 200)):
        scene = recording(targets, clutter, rng)
        number = np.mean(run(scene, clutter)[20:])
        seconds = fastest(partial(run, scene, clutter), 5) / SCANS
        print(f"{targets:7d} {clutter:7d} {1e3 * seconds:8.3f} {seconds / unit:6.4f} {number:7.1f}")


if __name__ == "__main__":
    main()
