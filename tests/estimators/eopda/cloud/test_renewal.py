"""Offsets that stay: particles against least squares, and which clouds are drawn anew."""

from __future__ import annotations

import numpy as np

from echoset.estimators.eopda.cloud.renewal import renewed
from echoset.estimators.eopda.links import NO_LINKS, Links
from echoset.estimators.eopda.state import Event, State
from echoset.estimators.run import Estimation
from echoset.models.records import Meta, Recording, Sensor, Stream

CORNERS = np.array([[0.0, 0.0], [6.0, 0.0], [6.0, 5.0], [0.0, 5.0]])
DT, SIGMA, ACCELERATION, SPEED, COMMON, OWN = 0.1, 0.05, 0.8, 1.0, 0.3, 0.1
TOO_LONG = np.array([0.19, 0.59, 0.51, 0.27])
"""Offsets whose differences are twice what their prior allows for."""


def ranges(n, seed):
    """Ranges (n, 4) from a path among the corners."""
    t = DT * np.arange(n)
    p = np.stack((3 + 2 * np.cos(0.35 * t), 2.5 + 1.6 * np.sin(0.5 * t)), 1)
    noise = SIGMA * np.random.default_rng(seed).normal(size=(n, 4))
    return np.linalg.norm(p[:, None] - CORNERS, axis=2) + TOO_LONG + noise


def least_squares(z):
    """Last position (2,) and its covariance, of the most likely path and offsets by Gauss-Newton.

    Unknown are the first position and velocity, an acceleration a step, and the offsets.
    """
    n = len(z)
    k, step = np.arange(n), np.arange(n - 1)
    of_steps = np.where(step < k[:, None], DT**2 * (k[:, None] - step - 0.5), 0.0)
    # positions along an axis are linear in its first position, velocity and accelerations
    path = np.column_stack((np.ones(n), DT * k, of_steps))
    A, m = np.kron(path, np.eye(2)).reshape(n, 2, -1), 2 * (n + 1)
    prior = np.full(m, ACCELERATION**-2.0)
    prior[:2], prior[2:4] = 1e-6, SPEED**-2.0
    weight = np.linalg.inv(COMMON**2 + OWN**2 * np.eye(4))
    x = np.zeros(m + 4)
    x[:2], x[m:] = CORNERS.mean(0), 0.0
    for _ in range(30):
        away = (A @ x[:m])[:, None] - CORNERS
        d = np.linalg.norm(away, axis=2)
        H = np.concatenate(
            (np.einsum("njk,nki->nji", away / d[..., None], A), np.tile(np.eye(4), (n, 1, 1))), 2
        ).reshape(-1, m + 4)
        J = H.T @ H / SIGMA**2
        J[np.arange(m), np.arange(m)] += prior
        J[m:, m:] += weight
        pull = np.concatenate(
            (prior * (x[:m] - np.r_[CORNERS.mean(0), np.zeros(m - 2)]), weight @ x[m:])
        )
        x = x + np.linalg.solve(J, H.T @ (z - d - x[m:]).ravel() / SIGMA**2 - pull)
    P = np.linalg.inv(J)[:m, :m]
    return A[-1] @ x[:m], A[-1] @ P @ A[-1].T


def filtered(z, seed):
    """Last position (2,), its covariance, and the evidence."""
    n = len(z)
    sensors = {f"A{j}": Sensor.static("anchor", a) for j, a in enumerate(CORNERS)}
    rx = np.tile(np.arange(4, dtype="i4"), n)
    stream = Stream(
        "uwb",
        (*sensors, "D"),
        {"sigma": SIGMA},
        np.repeat(np.rint(1e9 * DT * np.arange(n)).astype(np.int64), 4),
        np.arange(4 * n + 1),
        {"mode": np.zeros(4 * n, "u1"), "tx": np.full(4 * n, 4, "i4"), "rx": rx},
        {"distance": z.ravel()},
    )
    record = Recording(Meta("tag"), sensors | {"D": Sensor.device()}, {"uwb": stream})
    settings = {
        "learn": [],
        "particles": 2000,
        "mean_clutter": 0.001,
        "range_bias_std": COMMON,
        "range_bias_spread": OWN,
        "range_bias_walk": 0.0,
        "acceleration_std": ACCELERATION,
        "speed_std": SPEED,
    }
    asked = Estimation("position", (("settings", settings),), seed).on(record.setup(), "tag")
    out = list(asked.steps(record.scans()))
    last = out[-1].objects
    return (
        last.columns("device_x", "device_y")[0],
        last.covariance[0, -2:, -2:],
        sum(e.steps["evidence"][0] for e in out),
    )


def test_offsets_that_stay_are_found_as_by_least_squares():
    z = ranges(180, 8)
    m, P = least_squares(z)
    found = [filtered(z, seed) for seed in range(5)]
    for device, covariance, _ in found:
        assert (device - m) @ np.linalg.solve(P, device - m) < 2.0
        assert 0.6 < np.sqrt(np.trace(covariance) / np.trace(P)) < 1.5
    assert np.ptp([evidence for *_, evidence in found]) < 10.0


def cloud(p, rng, D=5, height=0.0):
    """Particles at ``p`` (2, n) that move and have offsets as they stand."""
    n = p.shape[1]
    y = np.zeros((7, n))
    y[:2], y[2:4], y[-1] = p, 0.3 * rng.normal(size=(2, n)) + p, height
    mean = 0.2 * rng.normal(size=(n, D)) - p[:1].T
    return State(y, np.full(n, 1 / n), mean, np.tile(0.01 * np.eye(D), (n, 1, 1)))


def event(variance=1.0):
    links = Links(np.full(4, 4), np.arange(4), np.arange(5), np.full(4, 3.0), np.full(4, variance))
    return Event(0, np.column_stack((CORNERS, np.zeros(4))), links, NO_LINKS)


def test_mean_and_covariance_of_motion_and_offsets_stay_and_copies_part():
    rng = np.random.default_rng(1)
    n = 20_000
    p = np.array([[3.0], [2.0]]) + np.array([[0.3, 0.0], [0.2, 0.1]]) @ rng.normal(size=(2, n))
    state = cloud(np.repeat(p[:, ::20], 20, 1), rng)
    after = renewed(state, event(), 0.0, rng)
    x, y = (np.vstack((s.y[:4], s.mean.T)) for s in (state, after))
    assert len(np.unique(after.y[0])) == n and (after.covariance == state.covariance).all()
    scale = np.sqrt(np.diag(np.cov(x)))
    stderr = 4.5 / np.sqrt(n)
    assert (np.abs(y.mean(1) - x.mean(1)) < stderr * scale).all()
    apart = (np.cov(y) - np.cov(x)) / np.outer(scale, scale)
    assert np.abs(apart).max() < 2 * stderr
    assert (after.y[4:] == 0).all()


def test_an_offset_and_a_scale_that_exclude_each_other_stay_apart():
    rng = np.random.default_rng(2)
    state = cloud(np.array([[3.0], [2.0]]) + 0.1 * rng.normal(size=(2, 1000)), rng)
    mean, P = state.mean.copy(), state.covariance.copy()
    mean[::2, 0], P[::2, 0], P[::2, :, 0] = 0.0, 0.0, 0.0
    after = renewed(State(state.y, state.w, mean, P), event(), 0.0, rng)
    assert (after.mean[::2, 0] == 0.0).all() and (after.mean[1::2] != mean[1::2]).all()


def test_rings_images_and_heights_at_the_floor_stay_as_they_are():
    rng = np.random.default_rng(3)
    angle = 2 * np.pi * rng.random(1000)
    ring = CORNERS[:1].T + 3 * np.stack((np.cos(angle), np.sin(angle)))
    pair = np.array([[3.0], [2.0]]) * np.where(rng.random(1000) < 0.5, 1, -1)
    for p in (ring, pair + 0.01 * rng.normal(size=(2, 1000))):
        state = cloud(p, rng)
        assert renewed(state, event(0.01), 0.0, rng) is state
    close = np.array([[3.0], [2.0]]) + 0.01 * rng.normal(size=(2, 1000))
    low = cloud(close, rng, height=np.abs(0.1 * rng.normal(size=1000)))
    assert renewed(low, event(), 0.0, rng) is low
    high = cloud(close, rng, height=1 + 0.1 * rng.normal(size=1000))
    assert renewed(high, event(), 0.0, rng) is not high
