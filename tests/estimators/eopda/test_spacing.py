"""Ranges whose errors stay: how long, by the integral of a known autocorrelation."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from echoset.estimators.eopda.links import NO_LINKS, Links
from echoset.estimators.eopda.spacing import LONGEST, noise_time, spaced
from echoset.estimators.eopda.state import Event
from echoset.estimators.run import Estimation
from echoset.simulate.uwb_walk import Params, simulate


def stays(tau: float, dt: float, n: int, rng: np.random.Generator) -> np.ndarray:
    """An Ornstein-Uhlenbeck process (n,) of unit variance."""
    a, e = np.exp(-dt / tau), rng.normal(size=n)
    for k in range(1, n):
        e[k] = a * e[k - 1] + np.sqrt(1 - a * a) * e[k]
    return e


@pytest.mark.parametrize("tau", [0.05, 0.3])
def test_the_time_is_the_integral_of_the_autocorrelation(tau: float) -> None:
    rng, dt, n = np.random.default_rng(3), 0.01, 20_000
    e = [0.05 * stays(tau, dt, n, rng) for _ in range(4)]
    exact = 2 * tau * (1 - np.exp(-LONGEST / tau))
    # var of a mean of products of lag up to LONGEST: each link tells n dt / (2 tau) times
    error = 4.5 * 2 * LONGEST * np.sqrt(2 * tau / (4 * n * dt))
    assert noise_time([np.arange(n) * dt] * 4, e) == pytest.approx(exact, abs=error)


def test_drawn_at_random_times_it_is_the_same() -> None:
    rng, dt, tau = np.random.default_rng(4), 0.01, 0.3
    e = stays(tau, dt, 60_000, rng)
    drawn = np.sort(rng.choice(60_000, 6000, replace=False))
    exact = 2 * tau * (1 - np.exp(-LONGEST / tau))
    error = 4.5 * 2 * LONGEST * np.sqrt(2 * tau / 600)
    assert noise_time([drawn * dt], [e[drawn]]) == pytest.approx(exact, abs=error)


def test_independent_errors_stay_for_no_time() -> None:
    rng = np.random.default_rng(5)
    e = [rng.normal(size=2000) for _ in range(4)]
    pairs = 8000 * LONGEST / 0.1
    assert noise_time([np.arange(2000) * 0.1] * 4, e) < 4.5 * 2 * LONGEST / np.sqrt(pairs)
    assert noise_time([np.arange(2000.0)], e[:1]) == 0.0
    assert noise_time([], []) == 0.0


def test_any_rate_tells_as_much_as_one_range_in_the_time() -> None:
    def event(k: int, dt: float) -> Event:
        one = np.zeros(1, np.int64)
        links = Links(one + 2, one + k % 2, np.array([0, 1]), np.ones(1), np.full(1, 0.01))
        return Event(round(k * dt * 1e9), np.zeros((2, 3)), links, NO_LINKS)

    for dt in (0.01, 0.05, 0.125):
        events = [event(k, dt) for k in range(round(10 / dt))]
        told = sum(1 / e.active.variance[0] for e in spaced(events, 0.5))
        # two links, one range in half a second each, and their first
        assert told == pytest.approx(2 * 10 / 0.5 / 0.01, rel=0.1)
        assert list(spaced(events, 0.0)) == events
    slow = [event(2 * k, 1.0) for k in range(5)]
    assert all(e.active.variance[0] == 0.01 for e in spaced(slow, 0.5))


def test_a_tag_whose_errors_stay_is_not_too_sure() -> None:
    """Fifty ranges of a link a second whose errors stay for 0.4 s: found, and the NEES is right."""
    scene = Params(
        steps=500, anchors=4, ring=5.0, size=2.0, step=0.01, dt=0.02, noise="gaussian", sigma=0.01
    )
    record = simulate(scene, np.random.default_rng(6), "walk")
    stream = record.streams["uwb"]
    rng = np.random.default_rng(7)
    z = stream.rows["distance"].copy()
    for j in np.unique(stream.scan["rx"]):
        own = stream.scan["rx"] == j
        z[own] += 0.05 * stays(0.2, 0.02, int(own.sum()), rng)
    rows = {"distance": z}
    record = replace(record, streams={"uwb": replace(stream, rows=rows)})
    settings = {"learn": ["sigma"], "range_bias_std": 0.0, "particles": 1000}
    run = Estimation("position", (("settings", settings),), 1).on(record.setup(), "walk")
    out = list(run.steps(record.scans()))
    found = out[0].meta.provenance["found"]
    assert 0.1 < found["noise_time"] < 0.6
    p = np.array([e.objects.columns("device_x", "device_y")[0] for e in out])
    C = np.array([e.objects.covariance[0, -2:, -2:] for e in out])
    e = (p - record.truth.objects.columns("device_x", "device_y"))[50:]
    nees = np.einsum("ni,ni->n", e, np.linalg.solve(C[50:], e[..., None])[..., 0])
    # about 25 independent steps; taken for independent errors it is above 8
    assert nees.mean() < 4.0


def test_what_stays_longer_than_is_compared_is_an_offset():
    """Errors that wander over seconds: no more than the span in which they are compared."""
    rng = np.random.default_rng(3)
    time = [np.arange(600) * 0.1] * 4
    e = [np.cumsum(rng.normal(size=600)) for _ in time]
    assert noise_time(time, e) == LONGEST
