"""MBM filter over targets and clutter, and Murty's algorithm: ``python benchmarks/bench_mbm.py``.

The scenes of ``bench_phd``; four targets that meet (scenario ``meeting``) with 20 and with 200
global hypotheses; the k best assignments and the grouping of Bernoullis by the definitions on
SciPy and NumPy and by their compiled twins.
Recordings are made and everything compiled beforehand. Prints milliseconds of the fastest run and
their ratio to the calibration kernel.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np
from bench_phd import SCANS, SIDE, recording
from calibration import fastest, kernel

from echoset.estimators.points import mbm
from echoset.estimators.points.kernels import bernoulli, murty
from echoset.estimators.points.kernels.compiled import bernoulli as compiled_bernoulli
from echoset.estimators.points.kernels.compiled import murty as compiled
from echoset.models.random import generator
from echoset.models.records import Recording
from echoset.simulate import meeting


def seconds(scene: Recording, params: mbm.Params, runs: int) -> tuple[float, float]:
    """Of the fastest run of the filter over a recording, and the targets that it found a scan."""
    setup, scans, rng = scene.setup(), list(scene.scans()), generator(1, "bench", "mbm")
    found: list[int] = []

    def run() -> None:
        found[:] = [len(e.objects.label) for e in mbm.estimate(setup, iter(scans), params, rng)]

    return fastest(run, runs), float(np.mean(found[20:]))


def curve(unit: float) -> None:
    """Milliseconds a scan over the numbers of targets and clutter."""
    rng = generator(1, "bench", "phd")
    print("targets clutter hypotheses  ms/scan  ratio   found")
    for targets, clutter in ((5, 10), (10, 20), (20, 20), (40, 20), (10, 60), (40, 60)):
        scene = recording(targets, clutter, rng)
        for k in (20, 100):
            params = mbm.Params(
                p_detect=0.95,
                clutter_rate=clutter,
                clutter_region=(0.0, SIDE, 0.0, SIDE),
                std_position=10.0,
                std_acceleration=0.5,
                birth_rate=0.1,
                birth_std_velocity=(3.0, 3.0),
                poisson=True,
                max_hypotheses=k,
            )
            time, number = seconds(scene, params, 3)
            print(
                f"{targets:7d} {clutter:7d} {k:10d} {1e3 * time / SCANS:8.3f} "
                f"{time / SCANS / unit:6.4f} {number:7.1f}"
            )


def meetings(unit: float) -> None:
    """Seconds a run over four targets that meet."""
    scene = meeting.simulate(meeting.Params(), generator(1, "bench", "meeting"), "bench")
    print("meeting: hypotheses  s/run  ratio")
    for k in (20, 200):
        params = mbm.Params(
            p_detect=0.9,
            clutter_rate=10.0,
            clutter_region=(0.0, 300.0, 0.0, 300.0),
            std_position=1.0,
            std_acceleration=0.1,
            birth_rate=0.05,
            birth_std_velocity=(1.0, 1.0),
            poisson=True,
            max_hypotheses=k,
            min_weight=1e-8,
            merge_distance=0.0,
        )
        time, _ = seconds(scene, params, 3)
        print(f"{k:19d} {time:6.3f} {time / unit:6.3f}")


def assignments(unit: float) -> None:
    """The k best assignments of 10 tracks to 20 detections over 20 problems."""
    rng = generator(1, "bench", "murty")
    tracks, detections = 10, 20
    costs = np.full((20, tracks, detections + tracks), np.inf)
    pair = rng.normal(-3, 4, (20, tracks, detections))
    costs[:, :, :detections] = np.where(rng.random(pair.shape) < 0.2, pair, np.inf)
    costs[:, np.arange(tracks), detections + np.arange(tracks)] = 0.0
    print("Murty: k      ms SciPy  ms compiled  ratios")
    for k in (20, 200):
        slow = fastest(lambda: murty.k_best(costs, k))  # noqa: B023
        compiled.k_best(costs, k)
        quick = fastest(lambda: compiled.k_best(costs, k))  # noqa: B023
        print(
            f"{k:8d} {1e3 * slow:13.3f} {1e3 * quick:12.3f}  {slow / unit:.4f} {quick / unit:.4f}"
        )


def groups(unit: float) -> None:
    """Merging 200 Bernoullis of 20 tracks."""
    rng = generator(1, "bench", "bernoulli")
    n = 200
    P = np.tile(np.eye(4), (n, 1, 1))
    track, weight, r = rng.integers(0, 20, n), rng.random(n), rng.random(n)
    inputs = (track, weight, r, rng.normal(size=(n, 4)), P, rng.random(n), 4.0, 0.2)
    slow = fastest(lambda: bernoulli.group(*inputs))
    compiled_bernoulli.group(*inputs)
    quick = fastest(lambda: compiled_bernoulli.group(*inputs))
    print("grouping: ms NumPy  ms compiled  ratios")
    print(f"{1e3 * slow:18.3f} {1e3 * quick:12.3f}  {slow / unit:.4f} {quick / unit:.4f}")


def main() -> None:
    """Print all tables."""
    unit = fastest(kernel)
    print(f"calibration kernel {1e3 * unit:.1f} ms")
    curve(unit)
    meetings(unit)
    assignments(unit)
    groups(unit)


if __name__ == "__main__":
    main()
