"""A tag located by differences of distance reaches its bound: Monte Carlo."""

from __future__ import annotations

import numpy as np
import pytest

from echoset.estimators.run import Estimation
from echoset.metrics.bounds import alone, pcrlb
from echoset.models.columns import TDOA
from echoset.models.motion import acceleration_variance, constant_velocity
from echoset.models.records import Meta, Recording, Sensor, Stream

ANCHORS = np.array([[0.0, 0.0], [5.0, 0.0], [5.0, 5.0], [0.0, 5.0]])
STD, DT, STEPS, ACCELERATION = 0.05, 0.1, 60, 1.0


def run_of(seed: int) -> tuple[Recording, np.ndarray]:
    """A walk by the filter's own model, with differences to the first anchor, and its states."""
    rng = np.random.default_rng(seed)
    F, G = constant_velocity(DT)
    root = np.sqrt(acceleration_variance(ACCELERATION, DT))
    x = np.empty((STEPS, 4))
    x[0] = *rng.uniform(1.5, 3.5, 2), *(0.3 * rng.normal(size=2))
    for k in range(1, STEPS):
        x[k] = F @ x[k - 1] + G @ (root * rng.normal(size=2))
    arrival = STD / np.sqrt(2) * rng.normal(size=(STEPS, 4))
    d = np.linalg.norm(x[:, None, :2] - ANCHORS, axis=2) + arrival
    time = np.repeat(np.arange(STEPS) * round(DT * 1e9), 3)
    scan = {
        "mode": np.full(3 * STEPS, TDOA, np.uint8),
        "tx": np.zeros(3 * STEPS, np.int32),
        "rx": np.tile(np.array([2, 3, 4], np.int32), STEPS),
        "reference": np.ones(3 * STEPS, np.int32),
    }
    rows = {"distance": (d[:, 1:] - d[:, :1]).ravel(), "std": np.full(3 * STEPS, STD)}
    sensors = {"T": Sensor.device()}
    sensors |= {f"A{j}": Sensor.static("anchor", a) for j, a in enumerate(ANCHORS)}
    stream = Stream("uwb", tuple(sensors), {}, time, np.arange(3 * STEPS + 1), scan, rows)
    return Recording(Meta(f"r{seed}"), sensors, {"uwb": stream}), x


@pytest.mark.verification
def test_differences_reach_the_bound() -> None:
    settings = {
        "learn": [], "range_bias_std": 0.0, "mean_clutter": 0.0, "max_range": 10.0,
        "acceleration_std": ACCELERATION, "speed_std": 0.3, "particles": 2000,
    }  # fmt: skip
    params = pcrlb.Params(
        mean_clutter=0.0, max_range=10.0, acceleration_std=ACCELERATION, speed_std=0.3
    )
    squares, bounds = [], []
    for seed in range(100):
        record, x = run_of(seed)
        run = Estimation("position", (("settings", settings),), 1).on(record.setup(), "tag")
        out = list(run.steps(record.scans()))
        found = np.array([e.objects.columns("device_x", "device_y")[0] for e in out])
        squares.append(((found - x[:, :2]) ** 2).sum(1)[20:])
        stream = record.streams["uwb"]
        P = alone.bound(record, stream, np.unique(stream.time_ns), x[:, :2], params)
        bounds.append(np.trace(P[:, :2, :2], axis1=1, axis2=2)[20:])
    ratio = np.sqrt(np.mean(squares) / np.mean(bounds))
    spread = np.std(np.mean(squares, 1)) / np.sqrt(100) / np.mean(squares) / 2
    print(f"rmse {np.sqrt(np.mean(squares)):.4f} m, {ratio:.3f} +- {spread:.3f} of the bound")
    assert ratio < 1.1
    assert ratio > 1 - 4.5 * spread
