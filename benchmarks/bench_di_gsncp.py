"""The jump chain of DI-GSNCP: ``python benchmarks/bench_di_gsncp.py``.

CPU time of a move, by number of detections, on scenes whose clutter makes up the number; and of
the six epochs of one scene. The recordings are made and everything compiled beforehand. Prints
microseconds per move and their ratio to those of the calibration kernel, whose time is in ms.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

import time
from collections import deque

import numpy as np
from calibration import fastest, kernel

from echoset.estimators.gsncp import di_gsncp
from echoset.estimators.gsncp.chain import put, run
from echoset.estimators.gsncp.kernels import posterior as gsncp
from echoset.estimators.gsncp.kernels.posterior import Births
from echoset.estimators.run import Estimation
from echoset.models.parameters import resolve, sensor_model
from echoset.models.random import generator
from echoset.models.records import Recording
from echoset.simulate import radar_extended

NONE = Births(np.zeros((0, 3)), np.zeros(0), 1.0, 0.0)
SIZES = ((200, 1), (500, 2), (1800, 6), (20_000, 6), (200_000, 6))
"""Detections wanted, and the epochs that they come from."""


def recording(detections: int, epochs: int) -> Recording:
    """A scene of ten targets or so; about 240 detections an epoch are theirs."""
    clutter = max((detections - 243 * epochs) / (2 * epochs), 5.0)
    params = radar_extended.Params(epochs=epochs, clutter_rate=clutter)
    return radar_extended.simulate(params, generator(1, "bench", "9"), "bench")


def move_seconds(world: Recording, moves: int) -> tuple[int, float]:
    """Detections, and CPU seconds of one move of the default's mixture near the truth."""
    params = resolve(di_gsncp.Params, *sensor_model(world, di_gsncp.Params))
    *_, (_, scene) = di_gsncp.scenes(world.setup(), world.scans(), params)
    assert world.truth is not None
    C = world.truth.objects.state[: world.truth.objects.row_offset[1]]
    state, rng = (
        gsncp.empty(scene, params.places(len(scene.weight))),
        generator(1, "bench", "chain"),
    )
    put(state, C[:, :3], C[:, 3:])
    clutter = sum((s.rows["origin_id"] < 0).sum() for s in world.streams.values())
    intensity = np.array([1e-3, clutter / (1e4 * (len(scene.offset) - 1))])
    scale, weights = np.array([1.2, 0.8]), np.array(params.moves)
    run(scene, state, intensity, NONE, weights, scale, 10, rng)
    start = time.process_time()
    run(scene, state, intensity, NONE, weights, scale, moves, rng)
    return len(scene.weight), (time.process_time() - start) / moves


def six_epochs() -> None:
    """The default preset over one scene."""
    world = recording(1800, 6)
    deque(Estimation("di-gsncp").on(world.setup(), "bench").steps(world.scans()), maxlen=0)


def main() -> None:
    unit = fastest(kernel)
    print(f"calibration kernel: {unit * 1e3:.1f} ms")
    for detections, epochs in SIZES:
        world = recording(detections, epochs)
        found, seconds = move_seconds(world, max(200, 40_000_000 // (20 * detections)))
        share = seconds / unit * 1e3
        print(f"M = {found:6d}: {seconds * 1e6:8.2f} us a move, {share:.3f} thousandths")
    start = time.process_time()
    six_epochs()
    seconds = time.process_time() - start
    print(f"six epochs: {seconds * 1e3:.0f} ms, {seconds / unit:.1f} times the calibration kernel")


if __name__ == "__main__":
    main()
